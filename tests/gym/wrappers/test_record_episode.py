import random

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import FrameStackObservation, StickyAction, TimeLimit
from stable_baselines3.common.monitor import Monitor

from curiosity_gym import BehaviorWrapper, RecordEpisode
from curiosity_gym.wrappers import record_episode


class MeanPosition:
    """The mean of all positions of an episode, in x."""

    def reset(self, env, observation, info):
        self.positions = [observation[0]]

    def step(self, env, observation, info):
        self.positions.append(observation[0])

    def result(self):
        return [np.mean(self.positions)]


def dm_control():
    import shimmy  # noqa: F401  registers the ids

    return gym.make("dm_control/cartpole-swingup-v0")


def minigrid():
    pytest.importorskip("minigrid")
    return gym.make("MiniGrid-MultiRoom-N2-S4-v0")


MAKERS = {
    "maze": lambda: gym.make("CuriosityMaze-Hard-v0", horizon=40),
    "cart_pole": lambda: gym.make("CartPole-v1"),
    "sticky": lambda: StickyAction(gym.make("CartPole-v1"), 0.3),
    "taxi": lambda: TimeLimit(gym.make("Taxi-v4"), 40),
    "stacked": lambda: FrameStackObservation(gym.make("Pendulum-v1"), 4),
    "accumulator": lambda: BehaviorWrapper(
        gym.make("MountainCarContinuous-v0"), MeanPosition(), gym.spaces.Box(-2.0, 2.0, (1,))
    ),
    "minigrid": minigrid,
    **{
        name: pytest.param(make, id=name, marks=pytest.mark.extra("control"))
        for name, make in {
            "ant": lambda: gym.make("Ant-v5"),
            "stacker": lambda: gym.make("CuriosityControl-Stacker-v0", random_start=True),
            "dm_control": dm_control,
        }.items()
    },
}


def play(env, n, seed):
    """What n steps come to, of actions that `seed` draws."""
    env.action_space.seed(seed)
    outcomes = []
    for _ in range(n):
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        behavior = np.asarray(info.get("behavior", 0.0)).tolist()
        outcomes.append((str(observation), reward, behavior, info.get("episode", {}).get("r")))
        if terminated or truncated:
            env.reset()
    return outcomes


@pytest.mark.parametrize("n_steps", [0, 67])
@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_an_episode_goes_on_bit_for_bit_elsewhere(make, n_steps):
    one, other = (RecordEpisode(Monitor(make())) for _ in range(2))
    one.reset(seed=5)
    play(one, n_steps, seed=0)
    assert other.load_episode_state(one.episode_state())
    assert play(one, 150, seed=1) == play(other, 150, seed=1)


class Noisy(gym.ObservationWrapper):
    """Draws from a generator that no reset seeds."""

    rng = np.random.default_rng(0)

    def observation(self, observation):
        return observation + self.rng.normal(size=observation.shape)


@pytest.mark.parametrize(
    "other",
    [
        lambda: Noisy(gym.make("CartPole-v1")),
        lambda: gym.make("CartPole-v1", max_episode_steps=3),
        lambda: gym.make("MountainCar-v0"),
        lambda: gym.make("Pendulum-v1"),
        lambda: Odd(),
    ],
    ids=["draws from elsewhere", "ends before", "another", "other actions", "another generator"],
)
def test_an_environment_that_cannot_go_on_says_so(other):
    env = RecordEpisode(Noisy(gym.make("CartPole-v1")))
    env.reset(seed=0)
    play(env, 5, seed=0)
    assert not RecordEpisode(other()).load_episode_state(env.episode_state())


def test_what_is_remembered_from_other_episodes_is_missed():
    """Of rewards alone, too: observations are the same here."""
    one, other = (
        RecordEpisode(gym.wrappers.NormalizeReward(gym.make("CartPole-v1"))) for _ in range(2)
    )
    one.reset(seed=0)
    play(one, 50, seed=0)
    one.step(0)
    assert not other.load_episode_state(one.episode_state())


class Odd(gym.Env):
    """Observes lists, and draws from Python's generator."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (2,))
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        self.np_random = random.Random(seed)
        return [0.0, self.np_random.random()], {}

    def step(self, action):
        return [0.5, self.np_random.random()], 1.0, False, False, {}


class OddActions(Odd):
    action_space = gym.spaces.Tuple((gym.spaces.Discrete(2), gym.spaces.Box(-1.0, 1.0, (2,))))


def test_odd_environments_are_recorded_as_far_as_that_can_be():
    one, other = (RecordEpisode(Odd()) for _ in range(2))
    one.reset(seed=0)
    one.step(1)
    assert other.load_episode_state(one.episode_state())
    one.reset()  # from where no generator of numpy's says
    assert one.episode_state() is None
    env = RecordEpisode(OddActions())
    env.reset(seed=0)
    env.step(env.action_space.sample())
    assert env.episode_state() is None


def test_there_is_no_state_before_an_episode_or_of_a_very_long_one(monkeypatch):
    env = RecordEpisode(gym.make("MountainCarContinuous-v0"))
    assert env.episode_state() is None
    env.reset(seed=0)
    monkeypatch.setattr(record_episode, "LONGEST", 10)
    play(env, 10, seed=0)
    assert len(env.episode_state()["actions"]) == 10
    play(env, 10, seed=0)
    assert env.episode_state() is None


def test_recording_changes_no_spec():
    env = gym.make("CartPole-v1")
    assert RecordEpisode(env).spec == env.spec
