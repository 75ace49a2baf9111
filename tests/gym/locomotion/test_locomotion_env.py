"""One robot and many: against each other, against Gymnasium's checks, and their users' mistakes."""

import warnings
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from stable_baselines3.common import env_checker

from curiosity_gym.locomotion.locomotion_env import LocomotionEnv, LocomotionVectorEnv

pytestmark = [
    pytest.mark.extra("locomotion"),
    pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass':UserWarning"),
]

ROBOTS = ["Ant", "HalfCheetah", "Hopper", "Humanoid", "Swimmer", "Walker2d"]
MODES = list(AutoresetMode)
KEYWORDS = {"env_id": "Hopper-v5", "horizon": 20, "behavior": "feet"}
"""Some fall before the horizon, and some do not."""


def make_id(robot, **keywords):
    return gym.make(f"CuriosityLocomotion-{robot}-v0", **keywords)


@pytest.mark.parametrize("robot", ROBOTS)
class TestEveryRobot:
    def test_passes_the_checks_of_gymnasium_and_stable_baselines(self, robot):
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", ".*(infinity|symmetric).*")  # Gymnasium's own spaces
            check_env(make_id(robot).unwrapped, skip_render_check=True)
            env_checker.check_env(make_id(robot))

    def test_is_gymnasiums_environment_with_a_behavior(self, robot):
        ours, theirs = make_id(robot), gym.make(f"{robot}-v5")
        assert ours.observation_space == theirs.observation_space
        assert ours.action_space == theirs.action_space
        assert ours.metadata["render_fps"] == theirs.metadata["render_fps"]
        pairs = [(ours.reset(seed=3), theirs.reset(seed=3))]
        action = theirs.action_space.sample()
        pairs.append((ours.step(action), theirs.step(action)))
        for (observation, *said, info), (expected, *expected_said, expected_info) in pairs:
            np.testing.assert_array_equal(observation, expected)
            assert said == expected_said
            assert ours.unwrapped.behavior_space.contains(info["behavior"])
            assert set(info) == {*expected_info, "behavior", "is_success"}


def actions_of(space, n_steps=60, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (n_steps, *space.shape)).astype(np.float32)


@pytest.mark.parametrize(
    ("mode", "n_threads", "behavior"),
    [(MODES[0], 2, "feet"), (MODES[1], 1, "position"), (MODES[2], 2, "position")],
)
def test_equals_gymnasiums_sync_vector_env(mode, n_threads, behavior, run, assert_identical):
    keywords = KEYWORDS | {"behavior": behavior}
    native = LocomotionVectorEnv(**keywords, num_envs=4, autoreset_mode=mode, n_threads=n_threads)
    sync = SyncVectorEnv([partial(LocomotionEnv, **keywords)] * 4, autoreset_mode=mode)
    actions = actions_of(native.action_space)
    ours, theirs = run(native, actions), run(sync, actions)
    for our, their in zip(ours, theirs, strict=True):
        assert_identical(our, their)
    ends = np.array([result[2:4] for result in ours if len(result) == 5]).sum(axis=(0, 2))
    assert ends.min() > 0


def test_the_humanoids_tendons_come_with_the_infos_of_a_reset(run, assert_identical):
    keywords = {"env_id": "Humanoid-v5", "horizon": 8}
    native = LocomotionVectorEnv(**keywords, num_envs=2)
    sync = SyncVectorEnv([partial(LocomotionEnv, **keywords)] * 2)
    actions = actions_of(native.action_space, 20)
    for our, their in zip(run(native, actions), run(sync, actions), strict=True):
        assert_identical(our, their)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"env_id": "Pusher-v5"}, "`env_id` must be one of Ant-v5"),
        ({"behavior": "speed"}, "`behavior` must be one of position, feet"),
        ({"behavior": "feet", "env_id": "Swimmer-v5"}, '`behavior` must be "position" of Swimmer'),
        ({"env_kwargs": 5}, "`env_kwargs` must be None or a dictionary of keywords"),
        ({"horizon": 0}, "`horizon` must be"),
        ({"sparse": True}, "`sparse` must be False where there is no `world`"),
        ({"world": "trap", "env_id": "Hopper-v5"}, "`world` must be None of Hopper-v5"),
        ({"world": "labyrint"}, r"`world` must be .*trap, small_trap, maze, snake, us"),
    ],
)
def test_mistakes_are_named(change, message):
    with pytest.raises(ValueError, match=message):
        LocomotionEnv(**({"env_id": "Ant-v5"} | change))


def test_gymnasium_names_what_is_wrong_with_its_keywords():
    for wrong in ({"wings": 2}, {"render_mode": "human"}):
        with pytest.raises(TypeError, match=next(iter(wrong))):
            LocomotionEnv("Ant-v5", env_kwargs=wrong)


def test_a_state_that_physics_never_led_to_is_refused():
    env = LocomotionVectorEnv(num_envs=2, **KEYWORDS)
    env.reset(seed=0)
    good, bad = env.state_dict(), env.state_dict()
    bad["physics"][..., 1] = 1e12
    with pytest.raises(ValueError, match="`state` must"):
        env.load_state_dict(bad)
    np.testing.assert_array_equal(env.state_dict()["physics"], good["physics"])


def test_keywords_are_those_of_when_it_was_made():
    env_kwargs = {}
    envs = LocomotionVectorEnv("Hopper-v5", num_envs=2, env_kwargs=env_kwargs)
    env_kwargs["frame_skip"] = 9
    assert envs.make_single_env().task == envs.task


def test_is_drawn_where_it_is():
    env = make_id("Hopper", render_mode="rgb_array", width=64, height=48)
    env.reset(seed=0)
    try:
        first = env.render()
    except DependencyNotInstalled:
        pytest.skip("neither EGL nor OSMesa is here")
    for action in actions_of(env.action_space, 12):
        env.step(action)
    later = env.render()
    assert first.shape == later.shape == (48, 64, 3)
    assert (first != later).any()
    kind = {"num_envs": 2, "vectorization_mode": "vector_entry_point"}
    keywords = {"render_mode": "rgb_array", "width": 64, "height": 48}
    envs = gym.make_vec("CuriosityLocomotion-Hopper-v0", **kind, **keywords)
    envs.reset(seed=[1, 0])
    np.testing.assert_array_equal(envs.render()[1], first)
    env.close()
    envs.close()
