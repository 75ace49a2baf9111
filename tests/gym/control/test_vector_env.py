import multiprocessing
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import Error, ResetNeeded
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv

from curiosity_gym.control.control_env import ControlEnv, ControlVectorEnv
from curiosity_gym.core import SimulationError

pytestmark = pytest.mark.extra("control")

N_ENVS = 4
MODES = list(AutoresetMode)
KEYWORDS = {"task": "stacker", "success_threshold": 1e-45, "horizon": 40}
"""Kicking the box is enough to succeed: episodes end at the goal and at the horizon."""


def make_native(**changes):
    return ControlVectorEnv(**({"num_envs": N_ENVS} | KEYWORDS | changes))


def make_sync(mode, **changes):
    return SyncVectorEnv(
        [partial(ControlEnv, **(KEYWORDS | changes))] * N_ENVS, autoreset_mode=mode
    )


@pytest.fixture(name="actions")
def actions_fixture(make_actions):
    """Actions (150, N_ENVS, 5)."""
    return np.stack([make_actions("bang-bang", 150, 5, seed) for seed in (5, 1, 10, 4)], axis=1)


class TestAgainstSingleEnvs:
    @pytest.mark.parametrize("random_start", [False, True])
    @pytest.mark.parametrize("mode", MODES)
    def test_equals_gymnasiums_sync_vector_env(
        self, random_start, mode, actions, run, assert_identical
    ):
        changes = {"random_start": random_start}
        ours = run(make_native(autoreset_mode=mode, n_threads=2, **changes), actions)
        theirs = run(make_sync(mode, **changes), actions)
        for our, their in zip(ours, theirs, strict=True):
            assert_identical(our, their)
        ends = np.array([result[2:4] for result in ours if len(result) == 5]).sum(axis=(0, 2))
        assert ends.min() > 0

    def test_is_dm_controls_environment(self, name, make_actions, play_reference):
        envs = ControlVectorEnv(name, num_envs=3, n_threads=2, autoreset_mode="Disabled")
        n_actions = envs.single_action_space.shape[0]
        actions = np.stack([make_actions("uniform", 1000, n_actions, i) for i in range(3)], axis=1)
        expected, solved = zip(
            *(play_reference(name, actions[:, i]) for i in range(3)), strict=True
        )
        first = min(int(np.argmax(each)) if each.any() else 1000 for each in solved)
        observations = [envs.reset()[0]]
        terminated = np.zeros(3, dtype=bool)
        for action in actions[: first + 1]:
            observation, _, terminated, truncated, _ = envs.step(action)
            observations.append(observation)
        np.testing.assert_array_equal(
            np.stack(observations, axis=1), np.array(expected)[:, : len(observations)]
        )
        assert len(observations) > 100
        np.testing.assert_array_equal(terminated, [first < 1000 and each[first] for each in solved])
        assert truncated.all() == (first == 1000)


class TestRandomStarts:
    @pytest.mark.parametrize(
        ("seed", "mask"),
        [
            (7, None),
            ([7, 3, 7, 20], [True, False, False, True]),
            ([5, None, 5, None], [True, False, False, True]),
        ],
    )
    def test_are_those_of_single_envs_with_the_same_seeds(self, name, seed, mask, assert_identical):
        changes = {"task": name, "success_threshold": None, "random_start": True}
        native, sync = make_native(**changes), make_sync("NextStep", **changes)
        results = []
        for envs in (native, sync):
            envs.reset(seed=1)
            options = {} if mask is None else {"reset_mask": np.array(mask)}
            results.append([envs.reset(seed=seed, options=options), envs.reset()])
        for ours, theirs in zip(*results, strict=True):
            np.testing.assert_array_equal(ours[0], theirs[0])
        assert len(np.unique(results[0][1][0], axis=0)) >= 3

    def test_of_a_bad_seed_leave_the_episodes_alone(self, actions, assert_identical):
        envs, twins = (make_native(random_start=True) for _ in range(2))
        for each in (envs, twins):
            each.reset(seed=2)
        for seed in (-1, [3, 4, 5, -6], [1, 2]):
            with pytest.raises((ValueError, Error)):
                envs.reset(seed=seed)
        assert_identical(envs.step(actions[0]), twins.step(actions[0]))
        assert_identical(envs.reset(), twins.reset())


class TestStep:
    def test_overwrites_observations_without_copies(self, actions):
        envs, twins = make_native(copy=False), make_native()
        observations = envs.reset()[0]
        twins.reset()
        for action in actions[:60]:
            assert envs.step(action)[0] is observations
            np.testing.assert_array_equal(observations, twins.step(action)[0])

    def test_raises_where_the_physics_fail_and_needs_a_reset_then(self, actions, assert_identical):
        envs, twins = make_native(), make_native()
        envs.reset()
        envs.simulation._batch.bind("qvel")[3, 0] = 1e12
        with pytest.raises(SimulationError, match="simulation 3"):
            envs.step(actions[0])
        with pytest.raises(ResetNeeded):
            envs.step(actions[0])
        # The others have moved in a step that nobody saw: they need a reset too.
        envs.reset(options={"reset_mask": np.arange(N_ENVS) == 3})
        with pytest.raises(ResetNeeded):
            envs.step(actions[0])
        assert_identical(envs.reset(), twins.reset())
        assert_identical(envs.step(actions[0]), twins.step(actions[0]))


class TestMakeVec:
    @pytest.mark.parametrize("mode", MODES)
    def test_max_episode_steps_is_the_time_limit_of_single_envs(
        self, mode, actions, assert_identical, run
    ):
        keywords = {"success_threshold": 1e-45, "num_envs": N_ENVS, "max_episode_steps": 25}
        make_vec = partial(gym.make_vec, "CuriosityControl-Stacker-v0", **keywords)
        native = make_vec(autoreset_mode=mode)
        sync = make_vec(vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode})
        assert (native.horizon, native.max_episode_steps) == (1000, 25)
        for our, their in zip(run(native, actions), run(sync, actions), strict=True):
            assert_identical(our, their)


def test_copies_continue_on_their_own(actions, run, assert_identical, duplicate):
    for random_start in [False, True]:
        envs = make_native(random_start=random_start)
        run(envs, actions[:25])
        twins = duplicate(envs)
        for action in actions[25:]:
            assert_identical(envs.step(action), twins.step(action))


@pytest.mark.parametrize("start_method", ["fork", "spawn"])
def test_single_envs_work_in_processes_started_after_threads(
    start_method, actions, run, assert_identical
):
    if start_method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"no {start_method} here")
    native = make_native(n_threads=2)
    expected = run(native, actions[:20])
    envs = AsyncVectorEnv(
        [partial(gym.make, "curiosity_gym:CuriosityControl-Stacker-v0", success_threshold=1e-45)]
        * N_ENVS,
        context=start_method,
    )
    try:
        for ours, theirs in zip(run(envs, actions[:20]), expected, strict=True):
            np.testing.assert_array_equal(ours[0], theirs[0])
    finally:
        envs.close()
