import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from curiosity_algos.experiments.description import describe_env
from curiosity_algos.experiments.run_envs import make_single, open_envs
from curiosity_algos.sb3.gymnasium_vec_env import GymnasiumVecEnv

US = "CuriosityMaze-US-v0"
HOLDS = pytest.mark.skipif(not hasattr(gym.wrappers, "RepeatAction"), reason="gymnasium < 1.3")


@pytest.mark.parametrize(
    ("env", "n_envs", "repeat_action", "expected"),
    [
        (US, 1, 1, DummyVecEnv),
        (US, 3, 1, GymnasiumVecEnv),
        (f"curiosity_gym:{US}", 3, 1, GymnasiumVecEnv),
        pytest.param(US, 3, 2, DummyVecEnv, marks=HOLDS),
        ("CartPole-v1", 3, 1, DummyVecEnv),  # whose vector environment resets a step later
        ("Pendulum-v1", 3, 1, DummyVecEnv),
    ],
)
def test_several_are_stepped_at_once_where_they_can_be(env, n_envs, repeat_action, expected):
    venv = open_envs(env, n_envs, repeat_action, {})
    assert isinstance(venv, VecMonitor)
    assert isinstance(venv.venv, expected)
    assert venv.num_envs == n_envs


def test_stepped_at_once_or_not_they_are_the_same():
    """In description and in every step, the limit of `make` among their keywords."""
    kwargs = {"horizon": 50, "max_episode_steps": 7}
    one, other = open_envs(US, 1, 1, kwargs), open_envs(US, 2, 1, kwargs)
    assert describe_env(one) == describe_env(other)
    np.testing.assert_array_equal(one.reset()[0], other.reset()[1])
    for _ in range(10):
        single, both = (venv.step(np.full((venv.num_envs, 2), 0.5)) for venv in (one, other))
        np.testing.assert_array_equal(single[0][0], both[0][1])
        assert single[2][0] == both[2][1]
        assert single[3][0].get("episode", {}).get("l") == both[3][1].get("episode", {}).get("l")


@HOLDS
def test_an_action_is_held():
    once, held = make_single(US, 1, {}), make_single(US, 3, {})
    for env in (once, held):
        env.reset()
    action = np.array([1.0, 0.5], np.float32)
    for _ in range(3):
        expected = once.step(action)[0]
    np.testing.assert_array_equal(held.step(action)[0], expected)


def test_an_older_gymnasium_is_told(monkeypatch):
    monkeypatch.delattr(gym.wrappers, "RepeatAction", raising=False)
    with pytest.raises(ImportError, match=r"`repeat_action` needs gymnasium 1\.3"):
        make_single(US, 3, {})
