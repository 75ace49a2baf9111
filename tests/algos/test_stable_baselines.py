"""Stable-Baselines3's own tools work on algorithms of populations, which share one loop."""

import importlib
import pkgutil

import gymnasium as gym
import pytest
import sb3_contrib
import stable_baselines3
from sb3_contrib.common.maskable.callbacks import MaskableEvalCallback
from stable_baselines3.common.callbacks import (
    BaseCallback,
    CallbackList,
    CheckpointCallback,
    ConvertCallback,
    EvalCallback,
    EventCallback,
    EveryNTimesteps,
    LogEveryNTimesteps,
    ProgressBarCallback,
    StopTrainingOnMaxEpisodes,
    StopTrainingOnNoModelImprovement,
    StopTrainingOnRewardThreshold,
)
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

from curiosity_algos import CanonicalES, CuriosityES


@pytest.mark.parametrize("kind", [DummyVecEnv, SubprocVecEnv])
def test_episodes_of_a_vec_env_differ_again_after_training(kind, make_model):
    """Those of a generation have begun alike; what comes next is to be no copies of one."""
    env = kind([make_pendulum] * 3)
    model = make_model(CanonicalES, env).learn(1000)
    returns, _ = evaluate_policy(model, env, n_eval_episodes=6, return_episode_rewards=True)
    assert len(set(returns)) == 6
    env.close()


def make_pendulum():
    return Monitor(gym.make("Pendulum-v1"))


def exported(package):
    """Every callback in the modules of a package."""
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        for thing in vars(importlib.import_module(module.name)).values():
            if isinstance(thing, type) and issubclass(thing, BaseCallback):
                yield thing


ABSTRACT = {BaseCallback, EventCallback}
EVALUATED = {"eval_freq": 64, "n_eval_episodes": 1}
MADE = {
    CallbackList: lambda env: CallbackList([LogEveryNTimesteps(100)]),
    CheckpointCallback: lambda env: CheckpointCallback(1, "saved", save_replay_buffer=True),
    ConvertCallback: lambda env: ConvertCallback(lambda locals_, globals_: True),
    EvalCallback: lambda env: EvalCallback(env, **EVALUATED),
    MaskableEvalCallback: lambda env: MaskableEvalCallback(env, **EVALUATED, use_masking=False),
    EveryNTimesteps: lambda env: EveryNTimesteps(100, LogEveryNTimesteps(1)),
    LogEveryNTimesteps: lambda env: LogEveryNTimesteps(100),
    ProgressBarCallback: lambda env: ProgressBarCallback(),
    StopTrainingOnMaxEpisodes: lambda env: StopTrainingOnMaxEpisodes(3),
    StopTrainingOnNoModelImprovement: lambda env: EvalCallback(
        env, callback_after_eval=StopTrainingOnNoModelImprovement(1), **EVALUATED
    ),
    StopTrainingOnRewardThreshold: lambda env: EvalCallback(
        env, callback_on_new_best=StopTrainingOnRewardThreshold(0.1), **EVALUATED
    ),
}
"""How each callback is made, of those that Stable-Baselines3 and sb3-contrib export."""


def test_every_callback_is_known():
    assert {*exported(stable_baselines3), *exported(sb3_contrib)} == {*MADE, *ABSTRACT}


@pytest.mark.parametrize("callback", MADE, ids=lambda callback: callback.__name__)
def test_every_callback_works(make_model, make_easy_maze, tmp_path, monkeypatch, callback):
    if callback is ProgressBarCallback:
        pytest.importorskip("rich")
    monkeypatch.chdir(tmp_path)
    made = MADE[callback](Monitor(make_easy_maze()))
    model = make_model(CuriosityES, make_easy_maze()).learn(600, callback=made)
    assert model.num_timesteps > 0
    assert made.n_calls > 0


def test_callbacks_find_episodes_and_progress(make_model, make_maze):
    seen = []

    def callback(locals_, globals_):
        model = locals_["self"]
        ended = [info for info in locals_["infos"] if "episode" in info]
        assert len(locals_["rewards"]) == len(locals_["infos"]) == len(locals_["dones"])
        assert sum(locals_["dones"]) == len(ended)
        assert all("terminal_observation" in info for info in ended)
        seen.extend(info["episode"] for info in ended)
        done = min(model.num_timesteps / 900, 1.0)
        assert model._current_progress_remaining == pytest.approx(1.0 - done)
        return True

    model = make_model(CuriosityES, make_maze())
    model.learn(900, callback=callback)
    assert list(model.ep_info_buffer) == seen
    assert [episode["l"] for episode in seen] == [50] * 18
    assert all(episode.keys() >= {"r", "l", "t"} for episode in seen)
    assert list(model.ep_success_buffer) == [False] * 18
