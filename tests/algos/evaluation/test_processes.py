"""Environments on several processes: the same bits."""

import copy
import gc
import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from walks import Alarmed, Walk

from curiosity_algos import CanonicalES, make_evaluator


class Doubled(gym.Wrapper):
    """A wrapper of a script, whose class no other process can import."""

    __module__ = "__main__"

    def step(self, action):
        observation, reward, *rest = self.env.step(action)
        return observation, 2.0 * reward, *rest


def make_parameters(evaluator, n=7):
    return np.random.default_rng(0).normal(0, 2, (n, evaluator.n_parameters)).astype(np.float32)


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_for_the_end_of(pids, seconds=30.0):
    deadline = time.monotonic() + seconds
    while any(map(is_running, pids)) and time.monotonic() < deadline:
        time.sleep(0.1)
    return not any(map(is_running, pids))


def pids_of(evaluator):
    pool = evaluator._processes._pool
    return [] if pool is None else list(pool._processes)


@pytest.fixture(scope="module")
def apart():
    """An evaluator whose processes have started."""
    evaluator = make_evaluator(Walk, n_threads=2)
    evaluator.evaluate(make_parameters(evaluator), 0)
    yield evaluator
    evaluator._processes.close()


class TestSameBits:
    @pytest.mark.parametrize("env", [lambda: Doubled(Walk()), "Registered-v0"])
    def test_of_rollouts(self, env, assert_same_rollouts):
        gym.register("Registered-v0", entry_point=lambda: Doubled(Walk()))
        apart, alone = (make_evaluator(env, n_threads=n) for n in (2, None))
        gym.registry.pop("Registered-v0")
        parameters = make_parameters(alone, 70)
        for seed, n in ((3, 70), (4, 1), (5, 7), (6, 70)):
            expected = alone.evaluate(parameters[:n], seed)
            assert_same_rollouts(apart.evaluate(parameters[:n], seed), expected)
        assert len(pids_of(apart)) == 2

    def test_of_a_search(self, make_model):
        alone, apart = (make_model(CanonicalES, Walk, n_threads=n) for n in (None, 2))
        for model in (alone, apart):
            model.learn(1000)
        assert len(pids_of(apart.evaluator)) == 2
        assert alone.num_timesteps == apart.num_timesteps
        np.testing.assert_array_equal(alone.policy.vector, apart.policy.vector)


def test_what_cannot_be_sent_is_refused():
    lock = threading.Lock()
    with pytest.raises(ValueError, match="`env` must be an id, or a function that can be pickled"):
        make_evaluator(lambda: (lock, Walk())[1], n_threads=2)


def test_without_a_seed_or_company_this_process_plays(apart):
    evaluator = make_evaluator(Walk, n_threads=2)
    parameters = np.repeat(make_parameters(evaluator, 1), 6, axis=0)
    starts = evaluator.evaluate(parameters).observations[:, 0]
    assert len(np.unique(starts)) == 6
    evaluator.evaluate(parameters[:1], 0)
    assert pids_of(evaluator) == []


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks")
def test_a_fork_begins_its_own(apart):
    parameters = make_parameters(apart)
    child = get_context("fork").Process(target=play_and_close, args=(apart, parameters))
    child.start()
    child.join(60)
    assert child.exitcode == 0
    apart.evaluate(parameters, 1)


def play_and_close(evaluator, parameters):
    evaluator.evaluate(parameters, 0)
    evaluator._processes.close()


def test_a_copy_begins_its_own(apart, assert_same_rollouts):
    parameters = make_parameters(apart)
    expected = apart.evaluate(parameters, 3)
    copied = copy.deepcopy(apart)
    assert pids_of(copied) == []
    for evaluator in (copied, apart):
        assert_same_rollouts(evaluator.evaluate(parameters, 3), expected)
    assert not set(pids_of(copied)) & set(pids_of(apart))
    copied._processes.close()


class TestFaults:
    def test_are_told_and_the_next_goes_on(self, tmp_path, assert_same_rollouts):
        make = partial(Alarmed, tmp_path / "alarm", os.getpid())
        apart, alone = (make_evaluator(make, n_threads=n) for n in (2, None))
        parameters = make_parameters(alone)
        for alarm, error, message in [
            ("die", RuntimeError, "`env` has ended a process that played it"),
            ("odd", RuntimeError, "OddError: the 3rd"),
            ("raise", ValueError, "`env` is out of order"),
        ]:
            (tmp_path / "alarm").write_text(alarm)
            with pytest.raises(error, match=message):
                apart.evaluate(parameters, 0)
        (tmp_path / "alarm").unlink()
        assert_same_rollouts(apart.evaluate(parameters, 1), alone.evaluate(parameters, 1))

    def test_garbage_ends_processes_and_waits_for_no_thread(self, monkeypatch):
        evaluator = make_evaluator(Walk, n_threads=2)
        evaluator.evaluate(make_parameters(evaluator), 0)
        pids, joined = pids_of(evaluator), []
        assert all(map(is_running, pids))
        monkeypatch.setattr(threading.Thread, "join", lambda self, *_: joined.append(self.name))
        del evaluator
        gc.collect()
        assert joined == []
        monkeypatch.undo()
        assert wait_for_the_end_of(pids)

    @pytest.mark.skipif(not os.path.exists("/proc/self/stat"), reason="asks Linux for processes")
    @pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT])
    def test_processes_end_with_a_script_that_has_no_guard(self, tmp_path, end):
        script = tmp_path / "script.py"
        script.write_text(
            "import time\n"
            "import gymnasium as gym\n"
            "from curiosity_algos import CanonicalES\n"
            "make = lambda: gym.make('Pendulum-v1', max_episode_steps=20)\n"
            "model = CanonicalES(make, n_threads=2).learn(1000)\n"
            "print(*model.evaluator._processes._pool._processes, flush=True)\n"
            "time.sleep(600)\n"
        )
        with subprocess.Popen(
            [sys.executable, script], stdout=subprocess.PIPE, start_new_session=True
        ) as started:
            pids = [int(word) for word in started.stdout.readline().split()]
            (os.killpg if end == signal.SIGINT else os.kill)(started.pid, end)
            assert started.wait(60) != 0
        assert len(pids) == 2
        assert wait_for_the_end_of(pids)
