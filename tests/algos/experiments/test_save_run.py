import csv
import gc
import json
import os
import re
import shutil
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.classic_control import PendulumEnv
from sb3_contrib import ARS
from stable_baselines3 import PPO
from stable_baselines3.common import callbacks as sb3
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

from curiosity_algos import (
    TD3ICM,
    BonusVecEnvWrapper,
    CanonicalES,
    CuriosityES,
    ExplorationCallback,
    MAPElites,
    make_evaluator,
)
from curiosity_algos.experiments import (
    SaveRun,
    load_final_states,
    load_progress,
    load_runs,
    save_run,
)
from curiosity_algos.experiments.run_folder import RunFolder

CLOCK = ["time/seconds", "time/fps", "time/time_elapsed"]


class KilledError(Exception):
    pass


class Kill(BaseCallback):
    """Ends a run in the midst of it, after so many timesteps."""

    def __init__(self, timesteps):
        super().__init__()
        self.timesteps = timesteps

    def _on_step(self):
        if self.num_timesteps >= self.timesteps:
            raise KilledError
        return True


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "run"


def without_clock(folder):
    return load_progress(folder).drop(columns=["run", *CLOCK], errors="ignore").sort_index(axis=1)


# An algorithm for each loop; that all of them resume, tests of the algorithms say.
@pytest.mark.parametrize("algorithm", [CuriosityES, MAPElites])
def test_the_folder_holds_the_run_which_is_the_same_as_without(
    algorithm, make_model, make_easy_maze, folder, assert_same_run
):
    model, other = (make_model(algorithm, make_easy_maze()) for _ in range(2))
    model.learn(400, SaveRun(folder, interval=1e-9), log_interval=1)
    assert_same_run(model, other.learn(400))
    (run,) = load_runs(folder.parent).to_dict("records")
    assert (run["algorithm"], run["run"]) == (algorithm.__name__, str(folder))
    assert (run["timesteps"], run["best_return"]) == (model.num_timesteps, model.best_return)
    assert all(run[f"coverage.{k}"] == share for k, share in model.coverage_shares.items())
    states = load_final_states(folder)
    assert states["return"].max() == model.best_return
    assert len(states["behavior"]) == run["n_episodes"] == len(states["return"]) > 1
    progress = load_progress(folder)
    assert progress["coverage/all"].iloc[-1] == model.coverage_shares["all"]
    assert (progress["seed"] == 0).all()
    assert progress["time/seconds"].is_monotonic_increasing


@pytest.mark.parametrize("algorithm", [CuriosityES, MAPElites])
def test_a_killed_run_goes_on_to_the_same_files(
    algorithm, make_model, make_easy_maze, tmp_path, assert_same, assert_same_run
):
    timesteps = 1 if algorithm is MAPElites else 500  # before the first checkpoint, or after
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    expected = make_model(algorithm, make_easy_maze())
    expected.learn(1200, SaveRun(whole), log_interval=1)
    model = make_model(algorithm, make_easy_maze())
    with pytest.raises(KilledError):
        model.learn(1200, [SaveRun(killed, interval=1e-9), Kill(timesteps)], log_interval=1)
    checkpoint = RunFolder(killed).checkpoint
    late = load_final_states(killed)  # as a kill between final states and a checkpoint leaves them
    RunFolder(killed).add_final_states(10**6, late)
    model = algorithm.load(checkpoint / "model", env=make_easy_maze())
    assert model.num_timesteps == int(checkpoint.name) <= timesteps
    rest = 1200 - model.num_timesteps
    model.learn(rest, SaveRun(killed), log_interval=1, reset_num_timesteps=False)
    assert_same_run(model, expected)
    assert_same(load_final_states(killed), load_final_states(whole))
    assert without_clock(killed).equals(without_clock(whole))
    for name in ("rewarding.npz", "sample.npz", "best_policy.npz"):
        files = [RunFolder(path).checkpoint / name for path in (killed, whole)]
        one, other = (dict(np.load(path)) for path in files)
        assert_same(one, other)


def test_curiosity_is_that_of_each_individual(make_model, make_easy_maze, folder):
    seen = []

    class Intrinsic(BaseCallback):
        def _on_step(self):
            seen.extend(self.locals["intrinsic"])
            return True

    make_model(CuriosityES, make_easy_maze()).learn(900, [SaveRun(folder), Intrinsic()])
    np.testing.assert_array_equal(load_final_states(folder)["curiosity"], seen)
    assert np.isfinite(seen).all()


@pytest.mark.parametrize("name", ["rewarding", "sample"])
def test_policies_can_be_played_again(name, make_model, make_easy_maze, folder, monkeypatch):
    monkeypatch.setattr(save_run, f"N_{'SAMPLED' if name == 'sample' else name.upper()}", 7)
    model = make_model(CanonicalES, make_easy_maze(), sigma=2.0)
    model.learn(10_000, SaveRun(folder))
    kept = dict(np.load(RunFolder(folder).checkpoint / f"{name}.npz"))
    states = load_final_states(folder)
    n_seen = states["success"].sum() if name == "rewarding" else len(states["return"])
    assert kept["n_seen"] == n_seen > 7 == len(kept["return"])
    evaluator = make_evaluator(make_easy_maze(), model.policy_kwargs)
    rollouts = evaluator.evaluate(kept["parameters"], int(kept["episode_seed"][0]))
    np.testing.assert_allclose(rollouts.returns, kept["return"], atol=1e-6)


def test_the_best_policy_is_there(make_model, folder):
    model = make_model(CuriosityES, "CuriosityMaze-US-v0").learn(1, SaveRun(folder))
    best = np.load(RunFolder(folder).checkpoint / "best_policy.npz")
    np.testing.assert_array_equal(best["parameters"], model.policy.vector)
    assert best["net_arch"].tolist() == [4]
    assert best["return"] == model.best_return


def test_an_env_may_have_no_id(make_model, folder):
    env = gym.wrappers.TimeLimit(PendulumEnv(), 20)
    with pytest.warns(UserWarning, match="cannot say how to make `env`: PendulumEnv was not made"):
        make_model(CuriosityES, env).learn(1, SaveRun(folder))
    assert json.loads((folder / "run.json").read_text())["env"] is None


def test_another_run_is_refused(make_model, make_easy_maze, folder):
    make_model(CuriosityES, make_easy_maze()).learn(600, SaveRun(folder))
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    found = load_runs(folder).iloc[0]
    steps = f"num_timesteps is {found['timesteps']}, not 0"
    for algorithm, changes, what in [
        (CanonicalES, {}, 'algorithm is "CuriosityES", not "CanonicalES"'),
        (CuriosityES, {}, steps),
        (CuriosityES, {"sigma": 9.0}, f"sigma is {found['settings.sigma']}, not 9.0"),
    ]:
        other = make_model(algorithm, make_easy_maze(), **changes)
        message = f"`folder` must be empty or that of this run: in {folder} "
        with pytest.raises(ValueError, match=rf"^{re.escape(message)}.*{re.escape(what)}\.$"):
            other.learn(600, SaveRun(folder))
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def test_a_monitor_must_see_the_episodes(folder):
    envs = DummyVecEnv([lambda: gym.make("Pendulum-v1", max_episode_steps=20)])
    with pytest.raises(ValueError, match="`env` must have a Monitor"):
        make_ppo(envs).learn(60, SaveRun(folder))
    assert not folder.exists()
    make_ppo(VecMonitor(envs)).learn(60, SaveRun(folder))
    assert len(load_final_states(folder)["return"]) == 3


class Lives(gym.Wrapper):
    """Ends an episode for the learner with each life of 10 steps, as SB3's `EpisodicLifeEnv`."""

    def reset(self, **kwargs):
        if self.env.get_wrapper_attr("needs_reset"):
            self.t, self.seen = 0, self.env.reset(**kwargs)
        return self.seen

    def step(self, action):
        observation, reward, terminated, truncated, info = self.env.step(action)
        self.t, self.seen = self.t + 1, (observation, info)
        return observation, reward, terminated or self.t % 10 == 0, truncated, info


@pytest.mark.filterwarnings("ignore:run.json cannot say")
def test_what_ends_for_the_learner_alone_is_no_episode(folder):
    model = make_ppo(Lives(Monitor(gym.make(US, horizon=35))))
    model.learn(120, SaveRun(folder))
    states = load_final_states(folder)
    assert states["length"].tolist() == [35] * 3
    assert the_run(folder)["n_episodes"] == 3


class Behaves(gym.Wrapper):
    """Ends each episode after a step, with the next of some behaviors; None: with none."""

    def __init__(self, behaviors):
        super().__init__(gym.make("Pendulum-v1"))
        self.behaviors = iter(behaviors)

    def step(self, action):
        observation, reward, *_ = self.env.step(action)
        behavior = next(self.behaviors)
        return observation, reward, True, False, {"behavior": behavior} if behavior else {}


@pytest.mark.parametrize(
    ("behaviors", "words"),
    [
        ([[1.0], [float("nan")]], "give finite behaviors"),
        ([[1.0], None], "of as many numbers, or none with any: one had 0, those before 1."),
        (["fast"], "of numbers, of the same shape"),
    ],
)
@pytest.mark.filterwarnings("ignore:run.json cannot say")
def test_a_wrong_behavior_is_an_error_at_once(folder, behaviors, words):
    model = make_ppo(Behaves(behaviors))
    with pytest.raises(ValueError, match=rf"^`env` must .*{re.escape(words)}"):
        model.learn(60, SaveRun(folder))


def test_a_checkpoint_is_on_disk_before_the_one_before_is_removed(folder, monkeypatch):
    synced, checked = [], []
    fsync, rmtree = os.fsync, shutil.rmtree

    def note(file):
        synced.append(os.fstat(file).st_ino)
        fsync(file)

    def check(path, *arguments, **kwargs):
        if path.name.isdecimal():
            new = max(path.parent.iterdir(), key=lambda each: int(each.name))
            checked.extend(each.name for each in new.iterdir())
            assert {each.stat().st_ino for each in new.iterdir()} <= set(synced)
            assert synced[-1] == path.parent.stat().st_ino
        rmtree(path, *arguments, **kwargs)

    monkeypatch.setattr(os, "fsync", note)
    monkeypatch.setattr(shutil, "rmtree", check)
    model = make_ppo(VecNormalize(make_mazes(bonus="rnd")))
    model.learn(240, SaveRun(folder, interval=1e-9))
    assert {"bonus.npz", "found.npz", "result.json", "vecnormalize.pkl", "model.zip"} <= {*checked}


US = "CuriosityMaze-US-v0"


def make_mazes(n_envs=2, bonus=None):
    """Mazes for an algorithm of Stable-Baselines3's own, with or without a bonus."""
    venv = make_vec_env(US, n_envs, seed=0, env_kwargs={"horizon": 50})
    if bonus is None:
        return venv
    settings = {"train_interval": 40, "n_updates": 2, "seed": 0, "device": "cpu"}
    return BonusVecEnvWrapper(venv, bonus=bonus, **settings)


def make_ppo(env, **settings):
    small = {"n_steps": 60, "batch_size": 60, "n_epochs": 1, "seed": 0, "device": "cpu"}
    return PPO("MlpPolicy", env, **(small | settings))


def the_run(folder):
    (run,) = load_runs(folder).to_dict("records")
    return run


class TestStableBaselines:
    def test_the_record_is_what_was_explored(self, folder):
        seen = ExplorationCallback()
        model = make_ppo(make_mazes(bonus="icm"))
        model.learn(6e2, [SaveRun(folder), seen], log_interval=1)
        run = the_run(folder)
        assert run["algorithm"] == "PPO + ICM"
        assert (run["timesteps"], run["n_episodes"]) == (600, 12)
        assert run["coverage.all"] == seen.coverage.all > 0
        assert run["best_return"] == seen.best_return == load_final_states(folder)["return"].max()
        assert run["env_kwargs.horizon"] == 50
        progress = load_progress(folder)
        assert progress["coverage/all"].iloc[-1] == seen.coverage.all
        assert progress["intrinsic/mean"].notna().any()

    def test_a_killed_run_goes_on(self, folder):
        killed = make_ppo(VecNormalize(make_mazes(bonus="icm")))
        with pytest.raises(KilledError):
            killed.learn(600, [SaveRun(folder, interval=1e-9), Kill(500)], log_interval=1)
        checkpoint, before = RunFolder(folder).checkpoint, the_run(folder)
        assert int(checkpoint.name) == before["timesteps"] == 480
        wrapped = BonusVecEnvWrapper.load(checkpoint / "bonus.npz", make_mazes())
        assert len(wrapped.buffer) == 480
        env = VecNormalize.load(checkpoint / "vecnormalize.pkl", wrapped)
        model = PPO.load(checkpoint / "model", env=env)
        model.learn(120, SaveRun(folder), log_interval=1, reset_num_timesteps=False)
        run = the_run(folder)
        assert run["timesteps"] == 600
        assert run["coverage.all"] >= before["coverage.all"]
        assert run["n_episodes"] == len(load_final_states(folder)["return"])
        assert load_progress(folder)["time/total_timesteps"].tolist() == list(range(120, 601, 120))
        with RunFolder(folder).progress.open() as file:
            counted = [row["train/n_updates"] for row in csv.DictReader(file)]
        assert counted[-1].isdecimal()
        assert all(n.isdecimal() for n in counted if n)  # as from a run that was not killed

    def test_those_that_step_no_vec_env_are_refused(self, folder):
        with pytest.raises(ValueError, match="step a VecEnv, got ARS"):
            ARS("MlpPolicy", "Pendulum-v1").learn(1, SaveRun(folder))
        assert not folder.exists()

    @pytest.mark.parametrize("wrap", [lambda env: BonusVecEnvWrapper(env, seed=0), VecNormalize])
    def test_a_monitor_must_see_the_tasks_rewards(self, folder, wrap):
        with pytest.raises(ValueError, match="below wrappers that change rewards"):
            make_ppo(VecMonitor(wrap(make_mazes()))).learn(1, SaveRun(folder))
        assert not folder.exists()


def make_eval(eval_freq=30, **settings):
    env = Monitor(gym.make(US, horizon=50))
    return sb3.EvalCallback(env, eval_freq=eval_freq, n_eval_episodes=1, verbose=0, **settings)


def check_record(folder, model):
    """The folder can be read, and each row of its log is whole."""
    run = the_run(folder)
    assert run["timesteps"] == model.num_timesteps
    progress = load_progress(folder)
    needed = ["time/total_timesteps", "time/seconds", "coverage/reachable", "coverage/all"]
    assert progress[needed].notna().all(axis=None)
    assert progress["time/total_timesteps"].is_monotonic_increasing
    last = progress.iloc[-1]
    assert last["time/total_timesteps"] == model.num_timesteps
    assert last["coverage/all"] == run["coverage.all"]
    assert "eval/mean_reward" not in progress or progress["eval/mean_reward"].notna().any()


BESIDE = {
    "LogEveryNTimesteps": lambda: sb3.LogEveryNTimesteps(70),
    "StopTrainingOnMaxEpisodes": lambda: sb3.StopTrainingOnMaxEpisodes(2),
    "EvalCallback": lambda: make_eval(callback_on_new_best=sb3.StopTrainingOnRewardThreshold(-1.0)),
}


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("name", BESIDE)
def test_other_callbacks_leave_the_record_whole(folder, name, order):
    model = make_ppo(make_mazes())
    model.learn(360, [SaveRun(folder), BESIDE[name]()][::order], log_interval=1)
    check_record(folder, model)


@pytest.mark.parametrize(("algorithm", "eval_freq"), [(CanonicalES, 1), (TD3ICM, 30)])
def test_other_callbacks_of_this_packages_algorithms(make_model, folder, algorithm, eval_freq):
    model = make_model(algorithm, gym.make(US, horizon=50))
    model.learn(700, [SaveRun(folder), make_eval(eval_freq)])
    check_record(folder, model)


@pytest.mark.parametrize("algorithm", [CanonicalES, TD3ICM])
def test_the_last_row_is_there_whatever_was_logged(make_model, make_easy_maze, folder, algorithm):
    model = make_model(algorithm, make_easy_maze())
    model.learn(70, SaveRun(folder), log_interval=1000)
    (row,) = load_progress(folder).to_dict("records")
    assert row["time/total_timesteps"] == model.num_timesteps
    assert row["coverage/reachable"] == model.coverage


@pytest.mark.parametrize("is_used_again", [False, True])
def test_after_an_error_the_folder_is_locked_again(
    make_model, make_easy_maze, folder, is_used_again
):
    kept = SaveRun(folder)  # as a notebook keeps what has failed
    with pytest.raises(KilledError):
        make_model(MAPElites, make_easy_maze()).learn(600, [kept, Kill(1)])
    save = kept if is_used_again else SaveRun(folder)
    locked = []

    class Look(BaseCallback):
        def _on_step(self):
            gc.collect()  # what an earlier training has left open is closed
            locked.append(is_locked_for_another(folder))
            return True

    make_model(MAPElites, make_easy_maze()).learn(600, [save, Look()])
    assert locked
    assert all(locked)
    assert not is_locked_for_another(folder)


def is_locked_for_another(folder):
    """Whether another process could not train there."""
    code = "import fcntl, sys; fcntl.flock(open(sys.argv[1], 'ab'), fcntl.LOCK_EX | fcntl.LOCK_NB)"
    words = [sys.executable, "-I", "-c", code, folder / "lock"]
    other = subprocess.run(words, capture_output=True, text=True)
    return "BlockingIOError" in other.stderr


class Anneal(BaseCallback):
    def _on_step(self):
        self.model.sigma *= 0.9
        return True


def test_a_run_whose_settings_a_callback_changes_goes_on(make_model, make_easy_maze, tmp_path):
    folder = RunFolder(tmp_path / "run")
    model = make_model(CanonicalES, make_easy_maze())
    model.learn(500, callback=[Anneal(), SaveRun(folder.path)])
    loaded = CanonicalES.load(folder.checkpoint / "model", env=make_easy_maze())
    assert loaded.sigma == model.sigma < 0.3
    loaded.learn(500, callback=[Anneal(), SaveRun(folder.path)], reset_num_timesteps=False)
    assert folder.describe()["settings"]["sigma"] == 0.3
    other = CanonicalES.load(folder.checkpoint / "model", env=make_easy_maze(), sigma=0.25)
    with pytest.raises(ValueError, match=r"settings\.sigma is .*, not 0\.25"):
        other.learn(500, callback=SaveRun(folder.path), reset_num_timesteps=False)
