import copy
import math

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env

from curiosity_gym.wrappers.behavior import BehaviorWrapper
from curiosity_gym.wrappers.sparse import SparseRewardWrapper

SPACE = spaces.Box(np.array([-4.8, -0.5]), np.array([4.8, 0.5]), dtype=np.float64)


def cart_and_pole(env, observation, info):
    return observation[[0, 2]]


def make_cart_pole(behavior=cart_and_pole, behavior_space=SPACE):
    return BehaviorWrapper(gym.make("CartPole-v1"), behavior, behavior_space)


def test_every_info_holds_the_behavior():
    env = make_cart_pole()
    observation, info = env.reset(seed=0)
    for action in [None, 0, 1, 1]:
        if action is not None:
            observation, _, _, _, info = env.step(action)
        assert info["behavior"].dtype == np.float64
        np.testing.assert_array_equal(info["behavior"], observation[[0, 2]].astype(np.float64))


def test_the_function_is_given_the_wrapped_environment_and_its_info():
    seen = []

    def behavior(env, observation, info):
        seen.append((env, dict(info)))
        return [0.0, 0.0]

    env = make_cart_pole(behavior)
    info = {"own": 1}
    env.env.reset = lambda **kwargs: (np.zeros(4), info)
    assert set(env.reset()[1]) == {"own", "behavior"}
    assert seen == [(env.env, {"own": 1})]
    assert info == {"own": 1}


@pytest.mark.parametrize("value", [[0.0], [[0.0, 0.0]], [0.0, math.nan]])
def test_behaviors_of_another_shape_are_errors(value):
    env = make_cart_pole(lambda env, observation, info: value)
    with pytest.raises(ValueError, match="`behavior`"):
        env.reset()


EXTENT = "`behavior_space` must have every `low` below its `high`"


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"behavior": [0.0, 0.0]}, "`behavior`"),
        ({"behavior_space": spaces.Box(0.0, np.zeros(2), dtype=np.float64)}, EXTENT),
        ({"behavior_space": spaces.Box(0.0, np.array([1.0, 0.0]), dtype=np.float64)}, EXTENT),
        *(
            ({"behavior_space": space}, "`behavior_space`")
            for space in (None, spaces.Discrete(3), spaces.Box(0, 1, (2, 2)), (2,))
        ),
    ],
)
def test_errors_name_the_argument(wrong, message):
    with pytest.raises(ValueError, match=message):
        make_cart_pole(**wrong)


@pytest.mark.filterwarnings(
    "error",
    "ignore:.*different from the unwrapped version",
    "ignore:.*minimum value is -infinity|.*maximum value is inf",
)
def test_passes_gymnasiums_checks_and_can_be_copied():
    env = make_cart_pole()
    check_env(env, skip_render_check=True)
    twin = copy.deepcopy(env)
    for one in (env, twin):
        assert one.reset(seed=5)[1]["behavior"].shape == (2,)


def test_a_spec_makes_the_same_again():
    env = make_cart_pole()
    again = gym.make(env.spec)
    assert type(again) is BehaviorWrapper
    np.testing.assert_array_equal(
        again.reset(seed=1)[1]["behavior"], env.reset(seed=1)[1]["behavior"]
    )


class MeanPosition:
    """The cart's and the pole's mean position over the episode."""

    def reset(self, env, observation, info):
        self.positions = [observation[[0, 2]]]

    def step(self, env, observation, info):
        self.positions.append(observation[[0, 2]])

    def result(self):
        return np.mean(self.positions, axis=0)


def never(env, observation, reward, info):
    return False


def make_mean_cart_pole(kind="behavior", behavior=None):
    behavior = MeanPosition() if behavior is None else behavior
    if kind == "behavior":
        return make_cart_pole(behavior)
    keywords = {"horizon": 500, "behavior": behavior, "behavior_space": SPACE}
    return SparseRewardWrapper(gym.make("CartPole-v1"), never, **keywords)


def play(env, actions, seed=0):
    """The behaviors, and the means of what was observed until then, of an episode."""
    observation, info = env.reset(seed=seed)
    observations, behaviors = [observation], [info["behavior"]]
    for action in actions:
        observation, _, _, _, info = env.step(action)
        observations.append(observation)
        behaviors.append(info["behavior"])
    return behaviors, [
        np.mean(observations[:t], axis=0)[[0, 2]] for t in range(1, len(actions) + 2)
    ]


@pytest.mark.parametrize("kind", ["behavior", "sparse"])
class TestAccumulator:
    def test_gathers_each_episode_from_its_start(self, kind):
        env = make_mean_cart_pole(kind)
        for seed, actions in enumerate([[0, 1, 1], [], [1, 1]]):
            behaviors, means = play(env, actions, seed)
            np.testing.assert_allclose(behaviors, means, rtol=1e-6)

    def test_is_copied_with_its_environment(self, kind, duplicate):
        env = make_mean_cart_pole(kind)
        env.reset(seed=0)
        env.step(0)
        twin = duplicate(env)
        expected = play(duplicate(env), [1, 1])[0]
        other = play(twin, [0, 0], seed=1)
        np.testing.assert_array_equal(play(env, [1, 1])[0], expected)
        np.testing.assert_allclose(other[0], other[1], rtol=1e-6)

    def test_given_to_several_environments_is_not_shared(self, kind):
        behavior = MeanPosition()
        envs = [make_mean_cart_pole(kind, behavior) for _ in range(2)]
        for env in envs:
            env.reset(seed=0)
        envs[0].step(0)
        behavior_alone = play(make_mean_cart_pole(kind), [1])[0][-1]
        np.testing.assert_array_equal(envs[1].step(1)[4]["behavior"], behavior_alone)
        assert vars(behavior) == {}
