"""An interrupted run, resumed, is the run that was never interrupted, in every bit."""

import pathlib
import random
import signal
import subprocess
import sys

import numpy as np
import pytest
import torch as th
from logs import read_log
from saved_files import latest_checkpoint
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from curiosity_algos import CuriosityES, MAPElites
from curiosity_algos.state.file import read
from tests.algos.conftest import SETTINGS

ROOT = pathlib.Path(__file__).parents[2]

KILLER = """
import os, pathlib, signal, sys, threading, time
sys.path[:0] = {tests!r}, {helpers!r}
from conftest import make_easy_maze, make_model
from saved_files import latest_checkpoint
from stable_baselines3.common.callbacks import CheckpointCallback
import curiosity_algos

def train_forever(algorithm, folder):
    last = latest_checkpoint(folder)
    if last is None:
        model = make_model(algorithm, make_easy_maze())
    else:
        model = algorithm.load(last, env=make_easy_maze())
    every = CheckpointCallback(1, str(folder))
    model.learn(1e9, callback=every, reset_num_timesteps=False)

def kill_ten_times(algorithm, folder):
    # Machine code is loaded once, before the forks, and by one thread: a fork would copy the locks
    # that others hold, and nobody would open them.
    make_model(algorithm, make_easy_maze(), n_threads=1).learn(2000)
    assert threading.active_count() == 1
    for moment in {moments}:
        before = latest_checkpoint(folder)
        process = os.fork()
        if process == 0:
            signal.alarm(300)  # whatever becomes of its parent
            train_forever(algorithm, folder)
        while latest_checkpoint(folder) == before:
            assert os.waitpid(process, os.WNOHANG) == (0, 0)
            time.sleep(0.002)
        time.sleep(moment)
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)

for line in sys.stdin:
    name, folder = line.split()
    kill_ten_times(getattr(curiosity_algos, name), pathlib.Path(folder))
    print("killed", flush=True)
"""


@pytest.fixture(scope="module")
def kill_ten_times():
    """Trains an algorithm in processes that are killed, one after the other, at random moments."""
    moments = np.random.default_rng(0).uniform(0.0, 0.1, 10).tolist()
    tests, helpers = str(pathlib.Path(__file__).parent), str(ROOT / "tests" / "helpers")
    code = KILLER.format(tests=tests, helpers=helpers, moments=moments)
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, **pipes) as killer:

        def kill(algorithm, folder):
            killer.stdin.write(f"{algorithm.__name__} {folder}\n")
            killer.stdin.flush()
            assert killer.stdout.readline() == "killed\n"

        yield kill
        killer.stdin.close()


class CtrlC(BaseCallback):
    """Presses Ctrl-C in a generation, before it was learned from."""

    def __init__(self, generation):
        super().__init__()
        self.generation = generation

    def _on_rollout_start(self):
        if self.model.generation == self.generation - 1:
            signal.raise_signal(signal.SIGINT)

    def _on_step(self):
        return True


def test_a_loaded_model_goes_on(algorithm, make_model, make_easy_maze, assert_resumes):
    assert_resumes(make_model(algorithm, make_easy_maze()).learn(600), make_easy_maze())


def test_an_adaptive_phi_goes_on(make_model, make_maze, assert_resumes):
    model = make_model(CuriosityES, make_maze(), phi="adaptive").learn(1500)
    assert model._fitness.weight < 0.8
    assert_resumes(model, make_maze())


def test_saving_changes_nothing(algorithm, make_model, make_easy_maze, tmp_path, assert_same_run):
    one, other = (make_model(algorithm, make_easy_maze()).learn(600) for _ in range(2))
    one.save(tmp_path / "model")
    one.save(tmp_path / "model", exclude=["buffer"])
    assert_same_run(one.learn(600), other.learn(600))


def generators(state):
    """The states of the generators within nested state dictionaries, as texts."""
    items = state.items() if isinstance(state, dict) else enumerate(state)
    for key, value in items:
        if key in ("rng", "generator", "cuda", "numpy", "torch"):
            yield str(value)
        elif isinstance(value, dict | list | tuple):
            yield from generators(value)


class TestSeeds:
    def test_every_generator_begins_anew(self, algorithm, make_model, make_easy_maze):
        model = make_model(algorithm, make_easy_maze()).learn(300)
        before = list(generators(model.get_parameters()))
        model.set_random_seed(7)
        after = list(generators(model.get_parameters()))
        assert len(after) > 1
        assert not set(before) & set(after)
        model.set_random_seed(None)
        assert list(generators(model.get_parameters())) == after

    def test_the_seed_decides_how_it_goes_on(
        self, algorithm, make_model, make_easy_maze, assert_same, assert_same_run
    ):
        models = [make_model(algorithm, make_easy_maze()).learn(300) for _ in range(4)]
        for model, seed in zip(models, [1, 1, 2, None], strict=True):
            model.set_random_seed(seed)
            model.learn(600, reset_num_timesteps=False)
        assert_same_run(models[0], models[1])
        for other in models[2:]:
            with pytest.raises(AssertionError):
                assert_same(models[0].get_parameters(), other.get_parameters())

    @pytest.mark.parametrize("algorithm", [CuriosityES, MAPElites])
    def test_the_seed_of_load_decides_as_set_random_seed(
        self, algorithm, make_model, make_easy_maze, tmp_path, assert_same_run
    ):
        model = make_model(algorithm, make_easy_maze()).learn(300)
        model.save(tmp_path / "model")
        loaded = algorithm.load(tmp_path / "model", env=make_easy_maze(), seed=1)
        model.set_random_seed(1)
        for each in (model, loaded):
            each.learn(600, reset_num_timesteps=False)
        assert_same_run(model, loaded)

    def test_global_settings_stay(self, algorithm, make_model, make_easy_maze, tmp_path):
        th.set_num_threads(2)
        random.seed(3), np.random.seed(3), th.manual_seed(3)  # noqa: NPY002
        before = random.getstate(), np.random.get_state(), th.get_rng_state()  # noqa: NPY002
        model = make_model(algorithm, make_easy_maze()).learn(1000)
        model.save(tmp_path / "model")
        model.set_random_seed(7)
        algorithm.load(tmp_path / "model", env=make_easy_maze(), seed=7)
        assert th.get_num_threads() == 2
        assert random.getstate() == before[0]
        np.testing.assert_equal(np.random.get_state(), before[1])  # noqa: NPY002
        assert th.equal(th.get_rng_state(), before[2])

    @pytest.mark.parametrize("seed", [-1, 0.5, "1"])
    def test_seeds_are_whole_numbers(self, make_model, make_easy_maze, tmp_path, seed):
        model = make_model(CuriosityES, make_easy_maze())
        model.save(tmp_path / "model")
        with pytest.raises(ValueError, match="`seed` must be None or a whole number"):
            model.set_random_seed(seed)
        with pytest.raises(ValueError, match="`seed` must be None or a whole number"):
            CuriosityES.load(tmp_path / "model", seed=seed)


def logged(folder):
    """The rows of a log, without the clock's."""
    return [{k: v for k, v in row.items() if k != "time/fps"} for row in read_log(folder)]


@pytest.mark.parametrize("algorithm", [CuriosityES, MAPElites])
def test_the_log_of_two_halves_is_the_log_of_the_whole(
    algorithm, make_model, make_easy_maze, tmp_path
):
    first = make_model(algorithm, make_easy_maze())
    first.set_logger(configure(str(tmp_path / "first"), ["json"]))
    first.learn(1000).save(tmp_path / "model")
    second = algorithm.load(tmp_path / "model", env=make_easy_maze())
    second.set_logger(configure(str(tmp_path / "second"), ["json"]))
    second.learn(1000, reset_num_timesteps=False)
    whole = make_model(algorithm, make_easy_maze())
    whole.set_logger(configure(str(tmp_path / "whole"), ["json"]))
    whole.learn(first.num_timesteps + 1000)
    rows = logged(tmp_path / "whole")
    assert logged(tmp_path / "first") + logged(tmp_path / "second") == rows
    assert len(rows) > 4


@pytest.mark.parametrize("algorithm", [CuriosityES, MAPElites])
def test_ctrl_c_leaves_a_model_that_resumes(
    algorithm, make_model, make_easy_maze, tmp_path, assert_same_run
):
    interrupted = make_model(algorithm, make_easy_maze())
    with pytest.raises(KeyboardInterrupt):
        interrupted.learn(1e9, callback=CtrlC(generation=3))
    assert interrupted.generation == 3
    interrupted.save(tmp_path / "model")
    loaded = algorithm.load(tmp_path / "model", env=make_easy_maze())
    uninterrupted = make_model(algorithm, make_easy_maze())
    uninterrupted.learn(interrupted.num_timesteps + 900)
    for model in (interrupted, loaded):
        model.learn(900, reset_num_timesteps=False)
        assert_same_run(model, uninterrupted)


@pytest.mark.parametrize(
    "algorithm",
    [
        pytest.param(each, marks=[] if each is CuriosityES else pytest.mark.nightly)
        for each in SETTINGS
    ],
)
def test_a_process_killed_ten_times_ends_in_the_run_that_never_was(
    algorithm, kill_ten_times, make_model, make_easy_maze, tmp_path, assert_same_run
):
    kill_ten_times(algorithm, tmp_path)
    for path in tmp_path.glob("*.zip"):
        read(path, algorithm.__name__)
    resumed = algorithm.load(latest_checkpoint(tmp_path), env=make_easy_maze())
    uninterrupted = make_model(algorithm, make_easy_maze())
    uninterrupted.learn(resumed.num_timesteps + 900)
    resumed.learn(900, reset_num_timesteps=False)
    assert_same_run(resumed, uninterrupted)
