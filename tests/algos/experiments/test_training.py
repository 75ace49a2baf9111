import json
import re
import signal

import pytest
from ribs.emitters import GaussianEmitter

from curiosity_algos import MAPElites
from curiosity_algos.experiments import RunFolder, load_final_states
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.training import is_finished, summary, train
from curiosity_algos.robust.solve import Enough

SMALL = {"population_size": 6, "policy_kwargs": {"net_arch": [4]}}


def small(algorithm="map_elites", timesteps=1200, seed=0, **settings):
    return RunSpec(
        algorithm, "CuriosityMaze-US-v0", seed, timesteps, {"horizon": 50}, SMALL | settings
    )


def test_a_finished_run_is_left_alone(tmp_path):
    assert train(small(), tmp_path)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    assert not train(small(), tmp_path)
    assert not train(small(timesteps=900), tmp_path)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before


def make_emitters(archive, x0, seed):
    return [GaussianEmitter(archive, sigma=0.1, x0=x0, batch_size=6, seed=seed)]


@pytest.mark.parametrize("parts", [{}, {"emitters": make_emitters}])
def test_more_timesteps_go_on(parts, tmp_path, assert_same):
    whole, grown = tmp_path / "whole", tmp_path / "grown"
    train(small(timesteps=2400, **parts), whole)
    for timesteps in (600, 2400):
        assert train(small(timesteps=timesteps, **parts), grown)
    assert_same(load_final_states(grown), load_final_states(whole))


def test_what_was_found_first_is_always_said(tmp_path):
    train(small(), tmp_path)
    assert ": best return 0.000, no success, coverage reachable" in summary(tmp_path)
    path = RunFolder(tmp_path).checkpoint / "result.json"
    result = json.loads(path.read_text())
    reward, success = {"first_reward_timesteps": 1500}, {"first_success_timesteps": 1700}
    for found, words in [
        (reward | {"best_return": 0.5}, "best return 0.500, first reward after 1,500 timesteps,"),
        (reward | success, "best return 0.000, first success after 1,700 timesteps,"),
        ({"best_return": -200.0}, "best return -200.000, no return above 0,"),
    ]:
        path.write_text(json.dumps(result | found))
        assert words in summary(tmp_path)


def test_another_run_is_refused(tmp_path):
    train(small(), tmp_path)
    message = f"`folder` must be empty or that of this run: in {tmp_path} seed is 0, not 1."
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        train(small(seed=1), tmp_path)


@pytest.mark.parametrize(("n_times", "kept"), [(1, 3), (2, None)])
def test_ctrl_c_keeps_whole_generations(tmp_path, monkeypatch, assert_same, n_times, kept):
    def press(self, *args):
        told = tell(self, *args)
        if self.generation == 2:
            for _ in range(n_times):
                signal.raise_signal(signal.SIGINT)
        return told

    whole, cut = tmp_path / "whole", tmp_path / "cut"
    train(small(), whole)
    tell = MAPElites._tell
    with monkeypatch.context() as patched:
        patched.setattr(MAPElites, "_tell", press)
        with pytest.raises(KeyboardInterrupt):
            train(small(), cut)
    assert RunFolder(cut).result().get("timesteps") == (kept and kept * 6 * 50)
    assert train(small(), cut)
    assert RunFolder(cut).result()["timesteps"] == 1200
    assert_same(load_final_states(whole), load_final_states(cut))


POLE = RunSpec("canonical_es", "CartPole-v1", 0, 1, {"max_episode_steps": 20}, SMALL)
FIELD = {"layout": "open-8x8-seed11", "start_radius": 5.0}
SEARCH = RunSpec("go_explore", "CuriosityMaze-v0", 0, 1e6, FIELD)


TRIED = "training.evaluate_starts"


@pytest.mark.parametrize(
    ("run", "enough", "killed_in"),
    [(small(), None, "run_folder.RunFolder.note"), (POLE, None, TRIED), (SEARCH, Enough(1), TRIED)],
)
def test_one_that_was_killed_at_its_end_is_ended(
    run, enough, killed_in, tmp_path, monkeypatch, assert_same
):
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    train(run, whole, enough=enough)

    def kill(*args, **kwargs):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(f"curiosity_algos.experiments.{killed_in}", kill)
        with pytest.raises(KeyboardInterrupt):
            train(run, killed, enough=enough)
    assert not is_finished(run, killed)
    assert train(run, killed, enough=enough)
    one, other = RunFolder(whole).result(), RunFolder(killed).result()
    assert killed_in != TRIED or one["starts"]["n"] == 100
    assert other == one | {"seconds": other["seconds"]}
    assert_same(load_final_states(killed), load_final_states(whole))
    assert not train(run, killed, enough=enough)
