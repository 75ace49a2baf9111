"""What a notebook shows of the objects that users hold."""

import re

import gymnasium as gym
import numpy as np
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

from curiosity_algos import BonusReplayBuffer, BonusVecEnvWrapper, MAPElites, Rollouts
from curiosity_algos.evaluation.coverage import Coverage
from curiosity_algos.evaluation.environments import env_name
from curiosity_algos.experiments import RunFolder
from curiosity_algos.motivations.novelty import NoveltyArchive

US = "CuriosityMaze-US-v0"


def test_a_model_and_its_parts():
    env = gym.make(US, horizon=20)
    model = MAPElites(env, population_size=4, policy_kwargs={"net_arch": [3]}, seed=0)
    assert repr(model) == f"<MAPElites on {US}: 0 timesteps>"
    model.learn(80)
    assert repr(model) == f"<MAPElites on {US}: 80 timesteps, best return 0.000>"
    assert repr(model.policy) == "MlpPolicy(36-3-2, 119 parameters)"
    share = r"\d\.\d%"
    expected = f"<Coverage: reachable {share}, visited {share}, all {share}>"
    assert re.fullmatch(expected, repr(model._coverage))
    assert repr(model.archive) == "<SparseGridArchive: 4 elites, best objective 0.000>"
    model.env = None
    assert repr(model).startswith("<MAPElites without an environment: 80 timesteps")


def test_other_objects():
    yes, zeros = np.ones(2, bool), np.zeros((2, 1))
    venv = DummyVecEnv([lambda: gym.make(US)] * 2)
    given = {"bonus": "rnd", "device": "cpu"}
    spaces = venv.observation_space, venv.action_space
    rollouts = Rollouts(np.ones(2), np.array([3, 4]), yes, yes, zeros, zeros.astype(np.float32))
    wrapper = BonusVecEnvWrapper(venv, weight=0.5, **given)
    buffer = BonusReplayBuffer(100, *spaces, n_envs=2, **given)
    for shown, text in [
        (Coverage(None), "Coverage: nothing is counted"),
        (NoveltyArchive(2), "NoveltyArchive: 0 behaviors of 2 entries"),
        (RunFolder("runs/0"), "RunFolder: runs/0"),
        (rollouts, "Rollouts: 2 episodes, 7 steps, 2 successes"),
        (wrapper, f"BonusVecEnvWrapper: 0.5 times RND around 2 of {US}"),
        (buffer, "BonusReplayBuffer: 0 of 100 transitions"),
    ]:
        assert repr(shown) == f"<{text}>"


def test_no_other_process_is_asked_for_a_name():
    class Elsewhere(SubprocVecEnv):
        def __init__(self):
            pass

    assert env_name(Elsewhere()) == "Elsewhere"
    assert env_name(DummyVecEnv([lambda: gym.make(US).unwrapped])) == US
