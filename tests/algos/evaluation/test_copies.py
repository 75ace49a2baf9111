import gc
import random
import warnings
import weakref

import gymnasium as gym
import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from gymnasium.utils import EzPickle
from gymnasium.wrappers import TimeLimit

from curiosity_algos import make_evaluator
from curiosity_algos.evaluation.copies import N_COPIES, env_and_copies
from curiosity_algos.evaluation.policies import build_mlp
from curiosity_gym import BehaviorWrapper, SparseRewardWrapper

WORLDS = {}
"""Handle: position, as a physics server holds its worlds."""


class Line(gym.Env):
    """A point that is pushed along a line; 20 steps."""

    observation_space = spaces.Box(-np.inf, np.inf, (1,))
    action_space = spaces.Box(-1.0, 1.0, (1,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.t = 0
        self.set_x(self.np_random.normal())
        return self.observe(), {}

    def step(self, action):
        self.t += 1
        self.set_x(self.get_x() + float(action[0]))
        return self.observe(), self.get_x(), False, self.t == 20, {}

    def observe(self):
        return np.array([self.get_x()], dtype=np.float32)

    def get_x(self):
        return self.x

    def set_x(self, x):
        self.x = x


class Handle(Line):
    """Its state is in a world outside, which a copy shares."""

    def __init__(self, handle=0):
        self.handle = handle

    def get_x(self):
        return WORLDS[self.handle]

    def set_x(self, x):
        WORLDS[self.handle] = x


class LateHandle(Handle):
    """Its state moves only after twelve steps."""

    def set_x(self, x):
        if self.t == 0 or self.t > 12:
            super().set_x(x)


class HiddenHandle(Handle):
    """Its state shows in the last reward alone."""

    def observe(self):
        return np.array([self.t], dtype=np.float32)

    def step(self, action):
        observation, reward, _, is_over, info = super().step(action)
        return observation, reward * is_over, False, is_over, info


class Client(Handle):
    """Disconnects when it is freed, as PyBullet's clients do."""

    def __init__(self, handle=0):
        super().__init__(handle)
        WORLDS[handle] = 0.0

    def get_x(self):
        if self.handle not in WORLDS:
            raise RuntimeError("Not connected to the physics server.")
        return WORLDS[self.handle]

    def set_x(self, x):
        self.get_x()
        WORLDS[self.handle] = x

    def __del__(self):
        WORLDS.pop(self.handle, None)


class Clock(Line):
    """Its time alone is shared: copies that take turns end too soon."""

    times = [0]  # noqa: RUF012

    def reset(self, *, seed=None, options=None):
        self.times[0] = 0
        return super().reset(seed=seed)

    def step(self, action):
        self.times[0] += 1
        observation, reward, _, _, info = super().step(action)
        return observation, reward, False, self.times[0] == 8, info


class Claimed(Line):
    """Whose reset lets no other episode go on: it raises where envs take turns."""

    owner = [None]  # noqa: RUF012

    def reset(self, *, seed=None, options=None):
        self.owner[0] = id(self)
        return super().reset(seed=seed)

    def step(self, action):
        if self.owner[0] != id(self):
            raise RuntimeError("no episode is under way")
        return super().step(action)


class Restless(Line):
    """No two episodes are alike."""

    def reset(self, *, seed=None, options=None):
        super().reset()
        self.t = 0
        self.set_x(np.random.default_rng().normal())
        return self.observe(), {}


class Broken(Line):
    """A copy of it cannot be stepped."""

    def __deepcopy__(self, memo):
        return gym.Env()


class Single(Line):
    """It cannot be copied."""

    def __deepcopy__(self, memo):
        raise TypeError("cannot copy")


class Global(Line):
    """Draws from every global generator."""

    def reset(self, *, seed=None, options=None):
        random.random(), np.random.random(), th.rand(1)  # noqa: NPY002
        return super().reset(seed=seed)


def highest():
    """A behavior that keeps the highest position of an episode, in a closure."""
    seen = []

    def behavior(env, observation, info):
        if env.unwrapped.t == 0:
            seen.clear()
        seen.append(observation[0])
        return [max(seen)]

    return behavior


def with_highest(env):
    return BehaviorWrapper(env, highest(), spaces.Box(-20.0, 20.0, (1,)))


def count_of_places(first=0):
    """A behavior that counts an episode's places from its first call on, in a closure."""
    visited = set()

    def behavior(env, observation, info):
        if env.unwrapped.t == first:
            visited.clear()
        visited.add(int(observation[0] // 3))
        return [len(visited)]

    return behavior


def success_of_places():
    """A success that does so; it is first called after a step."""
    behavior = count_of_places(first=1)

    def success(env, observation, reward, info):
        return behavior(env, observation, info)[0] >= 4

    return success


def copies_of(env):
    return env_and_copies(env, build_mlp(env.observation_space, env.action_space, [4]))[0]


def policies(evaluator, n=6):
    shape = (n, evaluator.n_parameters)
    return np.random.default_rng(0).normal(0, 1, shape).astype(np.float32)


SHARED = {
    "handle": Handle,
    "clock": Clock,
    "claimed": Claimed,
    "wrapped": lambda: TimeLimit(Handle(), 12),
    "closure": lambda: with_highest(Line()),
}


@pytest.mark.parametrize("kind", SHARED)
def test_an_env_whose_copies_share_state_plays_alone(kind, play, assert_equal_episodes):
    with pytest.warns(UserWarning, match="Copies of `env` that take turns do not do what one does"):
        evaluator = make_evaluator(SHARED[kind]())
    parameters = policies(evaluator)
    for seed in (1, 2):
        rollouts = evaluator.evaluate(parameters, seed)
        oracle = SHARED[kind]()
        assert_equal_episodes(rollouts, play(oracle, evaluator.mlp, parameters, seed))


LATE = {
    "handle": LateHandle,
    "hidden handle": HiddenHandle,
    "behavior": lambda: BehaviorWrapper(Line(), count_of_places(), spaces.Box(0.0, 90.0, (1,))),
    "success": lambda: SparseRewardWrapper(Line(), success_of_places(), horizon=20),
}


@pytest.mark.parametrize("n", [2, 16, 19])
@pytest.mark.parametrize("kind", LATE)
def test_state_that_shows_late_is_found_in_the_first_episodes(kind, n, play, assert_equal_episodes):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        evaluator = make_evaluator(LATE[kind]())
        parameters = policies(evaluator, n)
        evaluator.evaluate(parameters[:1], 0)  # one policy cannot tell
    with pytest.warns(UserWarning, match="Copies of `env` that take turns do not do what one does"):
        first = evaluator.evaluate(parameters, 1)
    for seed, rollouts in ((1, first), (2, evaluator.evaluate(parameters, 2))):
        episodes = play(LATE[kind](), evaluator.mlp, parameters, seed)
        assert_equal_episodes(rollouts, episodes)


def test_two_policies_are_played_again_once(monkeypatch):
    env, resets = Line(), []
    evaluator = make_evaluator(env)
    parameters = policies(evaluator, 20)
    reset = env.reset
    monkeypatch.setattr(env, "reset", lambda **given: resets.append(given) or reset(**given))
    counts = []
    for seed in (None, 3, 4):
        evaluator.evaluate(parameters, seed)
        counts.append(len(resets))
    assert counts == [20, 24, 26]  # alone; then two waves each, and once two episodes more


def test_episodes_without_a_seed_begin_where_those_of_the_env_do(play, assert_equal_episodes):
    env, oracle = Line(), Line()
    evaluator = make_evaluator(env)
    parameters = policies(evaluator, 20)
    evaluator.evaluate(parameters, 3)
    env.reset(seed=4)
    oracle.reset(seed=4)
    episodes = play(oracle, evaluator.mlp, parameters)
    assert_equal_episodes(evaluator.evaluate(parameters), episodes)


@pytest.mark.parametrize("render_mode", [None, "rgb_array"])
def test_any_number_of_policies_may_play_alone(render_mode):
    env = gym.make("CartPole-v1", render_mode=render_mode, max_episode_steps=2)
    evaluator = make_evaluator(env)
    alike = np.zeros((1500, evaluator.n_parameters), np.float32)
    assert evaluator.evaluate(alike, 0).lengths.tolist() == [2] * 1500


class Changed(EzPickle, Line):
    """One whose copies are made anew, without what was changed in it."""

    def __init__(self):
        EzPickle.__init__(self)
        Line.__init__(self)
        self.gain = 1.0

    def step(self, action):
        return super().step(self.gain * action)


def test_what_was_changed_is_in_all_episodes(play, assert_equal_episodes):
    envs = Changed(), Changed()
    for env in envs:
        env.gain = 0.5
    evaluator = make_evaluator(envs[0])
    others = policies(evaluator, 20)
    alike = np.repeat(others[:1], 20, axis=0)
    for seed in (None, 1):  # neither would tell that copies are others
        env, oracle = envs
        env.np_random, oracle.np_random = (np.random.default_rng(7) for _ in envs)
        rollouts = evaluator.evaluate(alike, seed)
        assert_equal_episodes(rollouts, play(oracle, evaluator.mlp, alike, seed))
    with pytest.warns(UserWarning, match="as they share a state or lack what was changed"):
        rollouts = evaluator.evaluate(others, 2)
    assert_equal_episodes(rollouts, play(envs[1], evaluator.mlp, others, 2))


def test_the_env_is_left_as_the_wave_left_it():
    class Noisy(Line):
        def step(self, action):
            if self.get_x() > 0.0:
                self.np_random.normal()
            return super().step(action)

    env, twin = Noisy(), Noisy()
    parameters = policies(make_evaluator(env))
    make_evaluator(env).evaluate(parameters, 3)
    make_evaluator(twin).evaluate(parameters[:1], 3)
    assert (env.t, env.x) == (twin.t, twin.x)
    assert env.np_random.bit_generator.state == twin.np_random.bit_generator.state


def test_copies_that_share_nothing_are_used_without_a_word():
    for env in (Line(), gym.make("CartPole-v1"), gym.make("Pendulum-v1")):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            envs = copies_of(env)
        assert envs[0] is env
        assert len({id(each.unwrapped) for each in envs}) == N_COPIES


def test_separately_made_envs_with_handles_are_taken_as_they_are(play, assert_equal_episodes):
    makers = [lambda handle=handle: Handle(handle) for handle in range(3)]
    evaluator = make_evaluator(gym.vector.SyncVectorEnv(makers))
    parameters = policies(evaluator)
    episodes = play(Handle(9), evaluator.mlp, parameters, 1)
    assert_equal_episodes(evaluator.evaluate(parameters, 1), episodes)


class SelfSeeded(Line):
    """Draws from a generator of its own, which no seed reaches."""

    def __init__(self):
        self.generator = np.random.default_rng(3)

    def step(self, action):
        return super().step(action + self.generator.normal())


class LateNoise(SelfSeeded):
    """Draws from it late."""

    def step(self, action):
        return super().step(action) if self.t > 12 else Line.step(self, action)


class GlobalNoise(Line):
    """Draws from the global generator."""

    def step(self, action):
        return super().step(action + np.random.normal())  # noqa: NPY002


@pytest.mark.parametrize("kind", [Restless, SelfSeeded, LateNoise, GlobalNoise])
def test_an_env_that_repeats_nothing_keeps_its_copies_without_a_word(kind):
    env = kind()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        envs = copies_of(env)
        evaluator = make_evaluator(env)
        rollouts = evaluator.evaluate(policies(evaluator), 0)
        evaluator.evaluate(policies(evaluator), 0)
    assert len(envs) == N_COPIES
    np.testing.assert_array_equal(rollouts.lengths, 20)


class Failing(Line):
    """A fault of its own."""

    def step(self, action):
        raise RuntimeError("the arm is jammed")


class Text(Line):
    """Its behavior is no number."""

    def step(self, action):
        *rest, info = super().step(action)
        return *rest, {**info, "behavior": "abc"}


@pytest.mark.parametrize(
    ("kind", "error", "message"),
    [
        (Failing, RuntimeError, "the arm is jammed"),
        (Text, ValueError, r"`env` must end every episode with an info\[\"behavior\"\] of numbers"),
    ],
)
def test_an_error_of_the_env_keeps_its_own_text(kind, error, message):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        evaluator = make_evaluator(kind())
        with pytest.raises(error, match=message):
            evaluator.evaluate(policies(evaluator), 0)


@pytest.mark.parametrize(
    "make", [Single, Broken, lambda: gym.make("CartPole-v1", render_mode="rgb_array")]
)
def test_what_cannot_be_copied_or_renders_is_left_alone(make):
    env = make()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert copies_of(env) == [env]


def test_the_env_is_left_as_it_was_found():
    env, twin = Line(), Line()
    for each in (env, twin):
        each.reset(seed=3)
        each.step([0.5])
    copies_of(env)
    assert (env.t, env.x) == (twin.t, twin.x)
    assert env.np_random.bit_generator.state == twin.np_random.bit_generator.state
    for copied in copies_of(env)[1:]:
        assert (copied.t, copied.x) == (twin.t, twin.x)


def test_global_generators_are_left_as_they_were_found():
    random.seed(0), np.random.seed(0), th.manual_seed(0)  # noqa: NPY002
    expected = random.random(), np.random.random(), th.rand(1)  # noqa: NPY002
    random.seed(0), np.random.seed(0), th.manual_seed(0)  # noqa: NPY002
    copies_of(Global())
    assert (random.random(), np.random.random(), th.rand(1)) == expected  # noqa: NPY002


def test_copies_that_would_close_a_handle_live_as_long_as_the_env():
    env = Client(7)
    with pytest.warns(UserWarning, match="Copies of `env`"):
        make_evaluator(env)
    gc.collect()
    env.reset(seed=0)  # raises where it is closed
    del env
    gc.collect()
    assert 7 not in WORLDS


def test_no_more_copies_are_alive_at_once_than_are_used():
    alive, counts = weakref.WeakSet(), []

    class Large(Line):
        def __deepcopy__(self, memo):
            copied = Large()
            alive.add(copied)
            counts.append(len(alive))
            return copied

    copies_of(Large())
    assert max(counts) == N_COPIES - 1
