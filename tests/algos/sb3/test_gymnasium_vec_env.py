"""Gymnasium's vector environments for Stable-Baselines3; a DummyVecEnv is the oracle."""

from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from packaging.version import Version
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor
from tracked import Tracked

from curiosity_algos import CanonicalES, GymnasiumVecEnv, make_evaluator
from curiosity_algos.evaluation.maze import MazeEvaluator
from curiosity_algos.experiments.description import describe_env
from curiosity_algos.sb3.gymnasium_vec_env import open_batch
from curiosity_gym.maze.maze_env import MazeEnv

N = 3
MAZE = "CuriosityMaze-US-v0"


def make_native(mode, env_id=MAZE, **keywords):
    kind = {"num_envs": N, "vectorization_mode": "vector_entry_point"}
    return gym.make_vec(env_id, **kind, autoreset_mode=mode, **keywords)


def make_cartpole():
    return gym.make("CartPole-v1", max_episode_steps=9)


def make_sync(mode, make=make_cartpole):
    return SyncVectorEnv([make] * N, autoreset_mode=mode)


def make_async(mode, make=make_cartpole):
    return AsyncVectorEnv([make] * N, autoreset_mode=mode)


class Described(gym.Env):
    """One that observes a dictionary, tells nothing but now and then, and ends at any time."""

    observation_space = gym.spaces.Dict(
        {"place": gym.spaces.Box(-9, 9, (2,)), "t": gym.spaces.Discrete(9)}
    )
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.t, self.options = 0, options
        self.place = self.np_random.uniform(-1, 1, 2).astype(np.float32)
        self.length = self.np_random.integers(3, 7)
        return self.observe(), {"begin": self.place.copy()}

    def step(self, action):
        self.t += 1
        self.place += action - 0.5
        info = {"nested": {"twice": 2.0 * self.place[0]}} if self.t % 2 else {"t": self.t}
        return self.observe(), 0.1, self.t == self.length, False, info

    def observe(self):
        return {"place": self.place.copy(), "t": self.t}


class Pool(VectorEnv):
    """One that gives observations and infos of those that it resets alone, as EnvPool does."""

    is_async = False

    def __init__(self, env):
        self.env, self.step, self.close = env, env.step, env.close
        self.num_envs, self.metadata = env.num_envs, env.metadata
        self.single_observation_space = env.single_observation_space
        self.single_action_space = env.single_action_space
        self.env_fns = env.env_fns  # so that each has a seed

    def reset(self, *, seed=None, options=None):
        observations, infos = self.env.reset(seed=seed, options=dict(options or {}))
        chosen = np.ones(N, np.bool_) if options is None else options["reset_mask"]
        infos = {key: values[chosen] for key, values in infos.items()}
        if isinstance(observations, dict):
            return {key: entry[chosen] for key, entry in observations.items()}, infos
        return observations[chosen], infos


KINDS = {
    "maze": (
        partial(make_native, horizon=7),
        lambda: gym.make(MAZE, horizon=7, disable_env_checker=True),
    ),
    "sync": (make_sync, make_cartpole),
    "async": (make_async, make_cartpole),
    "dictionary": (partial(make_sync, make=Described), Described),
    "pool": (lambda mode: Pool(make_sync(mode)), make_cartpole),
    "pool of dictionaries": (lambda mode: Pool(make_sync(mode, make=Described)), Described),
}


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("kind", KINDS)
def test_equals_a_dummy_vec_env(kind, mode):
    make, make_single = KINDS[kind]
    ours, theirs = GymnasiumVecEnv(make(mode)), DummyVecEnv([make_single] * N)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    for each in (ours, theirs):
        each.seed(4)
    np.testing.assert_equal(ours.reset(), theirs.reset())
    np.testing.assert_equal(ours.reset_infos, theirs.reset_infos)
    rng = np.random.default_rng(0)
    n_ends = 0
    for _ in range(40):
        action = np.array([theirs.action_space.sample() for _ in range(N)])
        if theirs.action_space.shape:
            action = rng.uniform(-1, 1, action.shape).astype(np.float32)
        our, their = ours.step(action), theirs.step(action)
        np.testing.assert_equal(our, their)
        np.testing.assert_equal(ours.reset_infos, theirs.reset_infos)
        assert our[1].dtype == their[1].dtype
        assert not any(isinstance(value, np.generic) for info in our[3] for value in info.values())
        n_ends += our[2].sum()
    assert n_ends >= N
    ours.close()


class TestAttributes:
    @pytest.mark.parametrize("make", [make_sync, make_async])
    def test_are_those_of_single_envs(self, make):
        venv = GymnasiumVecEnv(make(AutoresetMode.SAME_STEP))
        assert venv.get_attr("spec")[0].id == "CartPole-v1"
        assert venv.has_attr("gravity")
        assert not venv.has_attr("wings")
        venv.set_attr("gravity", 3.0, indices=[1])
        assert venv.get_attr("gravity") == [9.8, 3.0, 9.8]
        assert venv.env_method("has_wrapper_attr", "gravity") == [True] * N
        if make is make_sync:
            assert venv.env_method("has_wrapper_attr", "wings", indices=[0, 2]) == [False] * 2
        else:
            with pytest.raises(ValueError, match="`indices` must be None"):
                venv.env_method("has_wrapper_attr", "gravity", indices=0)
        venv.close()

    def test_of_a_native_one_are_of_all(self):
        venv = GymnasiumVecEnv(make_native(AutoresetMode.SAME_STEP, horizon=7))
        assert venv.get_attr("horizon", indices=[0, 2]) == [7, 7]
        assert not venv.has_attr("wings")
        for call in (lambda: venv.set_attr("horizon", 3), lambda: venv.env_method("step")):
            with pytest.raises(AttributeError):
                call()

    def test_tell_wrappers(self):
        venv = GymnasiumVecEnv(make_sync(AutoresetMode.SAME_STEP, lambda: Monitor(Described())))
        assert venv.env_is_wrapped(Monitor, indices=[0, 1]) == [True, True]
        assert venv.env_is_wrapped(gym.wrappers.TimeLimit) == [False] * N
        native = GymnasiumVecEnv(make_native(AutoresetMode.SAME_STEP))
        assert native.env_is_wrapped(Monitor) == [False] * N


class TestAlgorithms:
    @pytest.mark.skipif(
        Version(gym.__version__) < Version("1.4"),
        reason="Gymnasium before 1.4 counts a step less of each episode but the first",
    )
    def test_know_episodes_that_gymnasium_records(self):
        native = make_native(AutoresetMode.SAME_STEP, horizon=7)
        venv = GymnasiumVecEnv(RecordEpisodeStatistics(native))
        model = PPO("MlpPolicy", venv, n_steps=8, batch_size=8, device="cpu").learn(48)
        assert {int(info["l"]) for info in model.ep_info_buffer} == {7}
        assert not any("episode" in info for info in venv.reset_infos)

    def test_of_populations_see_the_env_inside(self):
        native = make_native(AutoresetMode.SAME_STEP, horizon=7)
        assert isinstance(make_evaluator(GymnasiumVecEnv(native)), MazeEvaluator)
        model = CanonicalES(GymnasiumVecEnv(make_native(AutoresetMode.SAME_STEP)), seed=0)
        assert isinstance(model.evaluator, MazeEvaluator)


class TestMistakes:
    @pytest.mark.parametrize(
        "make",
        [
            lambda: gym.make_vec("CartPole-v1", N, "vector_entry_point"),
            lambda: RecordEpisodeStatistics(make_sync(AutoresetMode.NEXT_STEP)),
            lambda: RecordEpisodeStatistics(make_native(AutoresetMode.DISABLED)),
        ],
    )
    def test_all_episodes_would_begin_at_once(self, make):
        with pytest.raises(ValueError, match="`vector_env` must begin an episode in"):
            GymnasiumVecEnv(make())

    def test_a_single_environment(self):
        with pytest.raises(ValueError, match=r"`vector_env` must be a VectorEnv, .* got Time"):
            GymnasiumVecEnv(gym.make("CartPole-v1", disable_env_checker=True))

    def test_not_all_envs_step_at_once(self):
        pool = Pool(make_sync(AutoresetMode.NEXT_STEP))
        pool.is_async = True
        with pytest.raises(ValueError, match="`vector_env` must step all its envs at once"):
            GymnasiumVecEnv(pool)

    def test_options_for_each(self):
        venv = GymnasiumVecEnv(make_sync(AutoresetMode.SAME_STEP, Described))
        venv.set_options({"low": 1})
        venv.reset()
        assert venv.get_attr("options") == [{"low": 1}] * N
        venv.set_options([{"low": 1}, {}, {}])
        with pytest.raises(ValueError, match="`options` must be the same"):
            venv.reset()


@pytest.mark.parametrize("mode", AutoresetMode)
def test_observations_are_kept_where_the_env_overwrites_its_own(mode):
    venv = GymnasiumVecEnv(make_native(mode, copy=False))
    observed = venv.reset()
    for _ in range(2):
        kept = observed.copy()
        after = venv.step(np.ones((N, 2), np.float32))[0]
        np.testing.assert_array_equal(observed, kept)
        observed = after


def make_maze(**kwargs):
    return gym.make("CuriosityMaze-US-v0", horizon=50, max_episode_steps=7, **kwargs)


@pytest.mark.parametrize(
    ("make", "n", "expected"),
    [
        (make_maze, 1, DummyVecEnv),
        (make_maze, 3, GymnasiumVecEnv),
        (lambda: gym.wrappers.ClipReward(make_maze(), 0.0, 1.0), 3, DummyVecEnv),
        (lambda: MazeEnv(layout="us"), 3, DummyVecEnv),  # that no id made
        (lambda: gym.make("CartPole-v1"), 3, DummyVecEnv),  # whose own resets a step later
        (lambda: gym.make("Pendulum-v1"), 3, DummyVecEnv),
    ],
)
def test_several_are_stepped_at_once_where_they_can_be(make, n, expected):
    venv = open_batch(make, n)
    assert isinstance(venv, expected)
    assert venv.num_envs == n


def test_stepped_at_once_or_not_they_are_the_same():
    """In description and in every step, the limit of `make` among their keywords."""
    one, other = (VecMonitor(open_batch(make_maze, n)) for n in (1, 2))
    assert describe_env(one) == describe_env(other)
    np.testing.assert_array_equal(one.reset()[0], other.reset()[1])
    for _ in range(10):
        single, both = (venv.step(np.full((venv.num_envs, 2), 0.5)) for venv in (one, other))
        np.testing.assert_array_equal(single[0][0], both[0][1])
        assert single[2][0] == both[2][1]
        assert single[3][0].get("episode", {}).get("l") == both[3][1].get("episode", {}).get("l")


def test_what_cannot_be_stepped_is_closed(tracked, monkeypatch):
    monkeypatch.setattr(Tracked, "observation_space", gym.spaces.Text(3))
    with pytest.raises(ValueError, match="is not supported"):
        open_batch(lambda: gym.make(tracked, disable_env_checker=True), 2)
    assert not Tracked.opened
