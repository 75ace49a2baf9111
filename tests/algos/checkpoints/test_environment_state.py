from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import TimeLimit
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecFrameStack, VecMonitor

from curiosity_algos.checkpoints.environment_state import (
    environment_states,
    load_environment_states,
)
from curiosity_algos.checkpoints.plain_json import decode, encode
from curiosity_algos.sb3.gymnasium_vec_env import GymnasiumVecEnv
from curiosity_gym import BehaviorWrapper

MAZE = "CuriosityMaze-US-v0"


def step_n(venv, n, seed):
    rng = np.random.default_rng(seed)
    for _ in range(n):
        actions = rng.uniform(-1, 1, (venv.num_envs, 2)).astype(np.float32)
        observations, rewards, dones, infos = venv.step(actions)
    return observations, rewards, dones, infos


@pytest.mark.parametrize("env_id", [MAZE, "CuriosityControl-BallInCup-v0"])
def test_episodes_go_on_elsewhere(env_id):
    one, other = (
        make_vec_env(env_id, n_envs=2, env_kwargs={"horizon": 50}, seed=0) for _ in range(2)
    )
    one.reset()
    other.reset()
    step_n(one, 30, seed=0)
    load_environment_states(other, environment_states(one))
    ends = [step_n(venv, 20, seed=1) for venv in (one, other)]
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    assert all(ends[1][2])
    for info in ends[1][3]:
        assert info["episode"]["l"] == 50  # the Monitor's rewards went with it


def make_batched(env_id=MAZE, horizon=50, num_envs=2):
    mode = {"vectorization_mode": "vector_entry_point", "autoreset_mode": "SameStep"}
    envs = gym.make_vec(env_id, num_envs=num_envs, horizon=horizon, **mode)
    return VecMonitor(GymnasiumVecEnv(envs))


def make_held(horizon=50):
    held = lambda: gym.wrappers.RepeatAction(gym.make(MAZE, horizon=horizon), 1)  # noqa: E731
    return VecMonitor(DummyVecEnv([held, held]))


@pytest.mark.parametrize(
    "make",
    [
        make_batched,
        pytest.param(
            partial(make_batched, "CuriosityControl-BallInCup-v0"),
            id="control",
            marks=pytest.mark.extra("control"),
        ),
        pytest.param(
            make_held,
            marks=pytest.mark.skipif(
                not hasattr(gym.wrappers, "RepeatAction"), reason="gymnasium < 1.3"
            ),
        ),
    ],
)
def test_episodes_that_are_stepped_at_once_or_held_go_on_too(make):
    one, other = make(), make()
    one.reset()
    other.reset()
    step_n(one, 30, seed=0)
    one.episode_returns[:] = [0.5, 0.25]
    load_environment_states(other, decode(encode(environment_states(one))))
    ends = [step_n(venv, 20, seed=1) for venv in (one, other)]
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    for info, begun in zip(ends[1][3], [0.5, 0.25], strict=True):
        assert info["episode"]["l"] == 50  # the monitor's counts went with it
        assert info["episode"]["r"] >= begun


def test_what_is_stepped_at_once_has_no_state_before_it_begins():
    assert environment_states(make_batched()) is None


def test_a_state_is_a_copy():
    venv = DummyVecEnv([lambda: Monitor(gym.make(MAZE))])
    venv.reset()
    states = environment_states(venv)
    step_n(venv, 5, seed=0)
    load_environment_states(venv, states)
    step_n(venv, 5, seed=0)
    assert states[0]["rewards"] == [[]]
    assert states[0]["env"]["steps"] == 0


@pytest.mark.parametrize(
    "other",
    [
        lambda: make_vec_env(MAZE, n_envs=2, env_kwargs={"horizon": 50}),
        lambda: VecMonitor(DummyVecEnv([lambda: gym.make(MAZE, horizon=50)] * 2)),
        lambda: make_batched(num_envs=3),
    ],
)
def test_what_is_stepped_otherwise_is_refused(other):
    one, other = make_batched(), other()
    for venv in (one, other):
        venv.reset()
    with pytest.raises(ValueError, match=r"`(env|state|venv)` must"):
        load_environment_states(other, environment_states(one))
    with pytest.raises(ValueError, match=r"`(env|state|venv)` must"):
        load_environment_states(one, environment_states(other))


class TestNoState:
    """Better none than half of it."""

    def test_of_other_environments(self):
        venv = make_vec_env("Pendulum-v1")
        venv.reset()
        assert environment_states(venv) is None

    @pytest.mark.parametrize("n_known", [0, 1])
    def test_of_wrappers_that_count(self, n_known):
        makers = [lambda: gym.make(MAZE)] * n_known
        venv = DummyVecEnv([*makers, lambda: TimeLimit(gym.make(MAZE), 10)])
        venv.reset()
        assert environment_states(venv) is None

    def test_of_stacks_of_observations(self):
        venv = VecFrameStack(make_vec_env(MAZE), 2)
        venv.reset()
        assert environment_states(venv) is None

    def test_of_other_processes(self):
        venv = SubprocVecEnv([lambda: gym.make(f"curiosity_gym:{MAZE}")], start_method="spawn")
        venv.reset()
        assert environment_states(venv) is None
        venv.close()


def test_wrappers_that_know_nothing_are_seen_through():
    space = gym.spaces.Box(0, 1, (1,))
    behavior = lambda env, observation, info: observation[:1]  # noqa: E731
    venv = DummyVecEnv([lambda: BehaviorWrapper(gym.make(MAZE), behavior, space)])
    venv.reset()
    (state,) = environment_states(venv)
    assert state["rewards"] == []


class MeanPosition:
    """The mean of all positions of an episode, in x."""

    def reset(self, env, observation, info):
        self.seen = [info["behavior"][0]]

    def step(self, env, observation, info):
        self.seen.append(info["behavior"][0])

    def result(self):
        return [np.mean(self.seen)]


class Slotted:
    """The first position alone."""

    __slots__ = ("first",)

    def reset(self, env, observation, info):
        self.first = info["behavior"][:1]

    def step(self, env, observation, info):
        pass

    def result(self):
        return self.first


class Opaque(MeanPosition):
    def reset(self, env, observation, info):
        super().reset(env, observation, info)
        self.env = env


def make_accumulating(accumulator=MeanPosition):
    space = gym.spaces.Box(0, 1, (1,))
    make = lambda: BehaviorWrapper(gym.make(MAZE, horizon=50), accumulator(), space)  # noqa: E731
    return DummyVecEnv([make, make])


def test_what_a_behavior_has_gathered_goes_on():
    one, other = make_accumulating(), make_accumulating()
    one.reset()
    step_n(one, 30, seed=0)
    states = decode(encode(environment_states(one)))
    other.reset()
    step_n(other, 7, seed=2)
    load_environment_states(other, states)
    ends = [[info["behavior"] for info in step_n(venv, 20, seed=1)[3]] for venv in (one, other)]
    np.testing.assert_array_equal(*ends)
    batched = make_batched()
    batched.reset()
    with pytest.raises(ValueError, match="`venv` must"):
        load_environment_states(batched, states)


@pytest.mark.parametrize("accumulator", [Opaque, Slotted])
def test_what_no_file_can_hold_of_a_behavior_is_no_state(accumulator):
    venv = make_accumulating(accumulator)
    venv.reset()
    assert environment_states(venv) is None


class TestOtherEnvironments:
    @pytest.fixture
    def states(self):
        venv = make_vec_env(MAZE)
        venv.reset()
        step_n(venv, 30, seed=0)
        return environment_states(venv)

    def test_in_number(self, states):
        venv = make_vec_env(MAZE, n_envs=2)
        venv.reset()
        with pytest.raises(ValueError, match="must have 1 environments, got 2"):
            load_environment_states(venv, states)

    @pytest.mark.parametrize(("env_id", "kwargs"), [(MAZE, {"horizon": 20}), ("Pendulum-v1", {})])
    def test_in_kind(self, states, env_id, kwargs):
        venv = make_vec_env(env_id, env_kwargs=kwargs)
        venv.reset()
        with pytest.raises(ValueError, match=r"`(env|state)` must"):
            load_environment_states(venv, states)

    def test_in_wrappers(self, states):
        venv = DummyVecEnv([lambda: gym.make(MAZE)])
        venv.reset()
        with pytest.raises(ValueError, match="wrapped as"):
            load_environment_states(venv, states)
