import gymnasium as gym
import pytest
from gymnasium import wrappers
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from curiosity_algos.evaluation.environments import GymnasiumView, SingleVecEnv
from curiosity_algos.evaluation.evaluator import as_played, known_task, max_steps
from curiosity_gym.maze.maze_env import MazeEnv, MazeVectorEnv


def limited(n):
    return wrappers.TimeLimit(MazeEnv("hard", horizon=20), n)


def test_monitors_are_seen_through_to_the_last():
    env = limited(5)
    for outside in (
        env,
        Monitor(Monitor(env)),
        DummyVecEnv([lambda: Monitor(env)]),
        VecMonitor(DummyVecEnv([lambda: Monitor(env)])),
    ):
        assert known_task(as_played(outside)).max_steps == 5


class Halving(Monitor):
    def step(self, action):
        observation, reward, *rest = super().step(action)
        return observation, reward / 2, *rest


def test_a_monitor_that_changes_something_is_not():
    assert known_task(Halving(limited(5))) is None
    for name in ("observation_space", "action_space"):
        env = Monitor(limited(5))
        setattr(env, name, gym.spaces.Box(-1.0, 1.0, (50,)))
        assert known_task(env) is None


def test_what_nobody_asked_for_is_taken_off():
    env, monitored = limited(5), Monitor(limited(5))
    assert as_played(SingleVecEnv(env)) is env
    assert as_played(SingleVecEnv(monitored)) is monitored
    envs = MazeVectorEnv("hard", num_envs=2)
    assert as_played(GymnasiumView(envs)) is envs


def test_envs_that_differ_in_their_limit_stay_together():
    alike = DummyVecEnv([lambda n=n: Monitor(limited(n)) for n in (25, 30)])
    assert as_played(alike) is alike.envs[0]
    different = DummyVecEnv([lambda n=n: limited(n) for n in (5, 6)])
    assert as_played(different) is different
    mazes = DummyVecEnv([lambda n=n: MazeEnv(n) for n in ("hard", "snake")])
    assert as_played(mazes) is mazes
    others = DummyVecEnv([lambda: gym.make("CartPole-v1")] * 2)
    assert as_played(others) is others


def robots(*keywords):
    """What SB3's `make_vec_env` makes of Gymnasium's ants."""
    return DummyVecEnv(
        [lambda given=given: Monitor(gym.make("Ant-v5", **given)) for given in keywords]
    )


@pytest.mark.extra("locomotion")
def test_robots_that_are_the_same_become_one():
    alike = robots({}, {}, {})
    assert as_played(alike) is alike.envs[0]
    different = robots({}, {"reset_noise_scale": 0.0})
    assert as_played(different) is different
    alike.envs[1].unwrapped.set_state = lambda qpos, qvel: None
    assert as_played(alike) is alike


def test_a_window_is_no_part_of_a_task():
    env = gym.make("CuriosityMaze-US-v0", render_mode="human")
    assert "HumanRendering" in str(env)
    assert known_task(env).is_same(known_task(gym.make("CuriosityMaze-US-v0")))


@pytest.mark.parametrize(("limits", "expected"), [([], 20), ([30], 20), ([9, 7, 8], 7)])
def test_the_lowest_limit_counts(limits, expected):
    env = MazeEnv("hard", horizon=20)
    for limit in limits:
        env = wrappers.TimeLimit(env, limit)
    assert max_steps(env) == expected
