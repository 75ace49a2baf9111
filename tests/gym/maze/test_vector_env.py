import copy
import multiprocessing
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv

from curiosity_gym.layouts import MazeLayout
from curiosity_gym.maze.maze_env import MazeEnv, MazeVectorEnv

# The goal is near enough that random actions come upon it, and far enough that they often do not.
NEAR_GOAL = MazeLayout("near goal", 20, 20, (5, 10), (9, 10), [(8, 12, 4, 6), (8, 2, 4, 5)])
KEYWORDS = {"layout": NEAR_GOAL, "horizon": 25, "max_acceleration": 20.0, "n_beams": 8}
N_ENVS = 6
MODES = list(AutoresetMode)


def make_native(num_envs=N_ENVS, **changes):
    return MazeVectorEnv(num_envs=num_envs, **(KEYWORDS | changes))


def make_sync(mode, num_envs=N_ENVS, **changes):
    return SyncVectorEnv([partial(MazeEnv, **(KEYWORDS | changes))] * num_envs, autoreset_mode=mode)


def random_actions(n_steps, num_envs=N_ENVS, seed=0):
    """Some of them out of bounds; each repeated, so that the robots get somewhere."""
    rng = np.random.default_rng(seed)
    values = rng.uniform(-1.5, 1.5, (n_steps // 5 + 1, num_envs, 2))
    return np.repeat(values, 5, axis=0)[:n_steps].astype(np.float32)


class TestAgainstSingleEnvs:
    @pytest.mark.parametrize("mode", MODES)
    @pytest.mark.parametrize(
        "changes", [{}, {"restitution": 1.0, "horizon": 1}, {"num_envs": 1}, {"start_radius": 3.0}]
    )
    def test_equals_gymnasiums_sync_vector_env(self, mode, changes, assert_identical, run):
        actions = random_actions(150, num_envs=changes.get("num_envs", N_ENVS))
        ours = run(make_native(autoreset_mode=mode, **changes), actions)
        theirs = run(make_sync(mode, **changes), actions)
        for our, their in zip(ours, theirs, strict=True):
            assert_identical(our, their)
        ends = np.array([result[2:4] for result in ours if len(result) == 5]).sum(axis=(0, 2))
        assert ends.min() > 0 or changes
        assert ends.sum() >= 5

    @pytest.mark.parametrize("mode", MODES)
    def test_equals_gymnasiums_sync_vector_env_from_a_given_state(self, mode, assert_identical):
        mask = np.arange(N_ENVS) % 3 == 0
        envs = make_native(autoreset_mode=mode), make_sync(mode)
        for options in ({"state": (15.0, 4.0, -2.0, 1.0)}, {"state": (3.0, 3.0, 0.0, 0.0)}):
            assert_identical(*(env.reset(options=dict(options)) for env in envs))
            for action in random_actions(7):
                assert_identical(*(env.step(action) for env in envs))
            options["reset_mask"] = mask
            assert_identical(*(env.reset(seed=0, options=dict(options)) for env in envs))
            for action in random_actions(60 if mode != AutoresetMode.DISABLED else 7, seed=1):
                assert_identical(*(env.step(action) for env in envs))

    def test_has_the_same_spaces_and_attributes(self):
        ours, theirs = make_native(), make_sync("NextStep")
        single = theirs.envs[0]
        for name in ("observation_space", "action_space"):
            assert getattr(ours, name) == getattr(theirs, name)
            assert getattr(ours, f"single_{name}") == getattr(theirs, f"single_{name}")
        assert ours.behavior_space == single.behavior_space
        assert ours.coverage_grid == single.coverage_grid
        assert ours.layout == single.layout
        assert ours.horizon == single.horizon
        assert ours.metadata["autoreset_mode"] is theirs.metadata["autoreset_mode"]


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_results_do_not_depend_on_the_number_of_threads(mode, assert_identical, run):
    actions = random_actions(60, num_envs=700)
    runs = [
        run(make_native(700, autoreset_mode=mode, n_threads=n_threads), actions)
        for n_threads in (1, 2, 5)
    ]
    for other in runs[1:]:
        for ours, theirs in zip(runs[0], other, strict=True):
            assert_identical(ours, theirs)


@pytest.mark.parametrize("mode", MODES)
def test_buffers_are_never_overwritten_later(mode, assert_identical):
    envs = make_native(autoreset_mode=mode)
    actions = random_actions(60)
    kept = []
    results = [envs.reset()]
    for action in actions:
        kept.append(copy.deepcopy(results[-1]))
        results.append(envs.step(action))
        if mode == AutoresetMode.DISABLED and (ended := results[-1][2] | results[-1][3]).any():
            envs.reset(options={"reset_mask": ended})
    for now, then in zip(results[:-1], kept, strict=True):
        assert_identical(now, then)


class TestReset:
    def test_rejects_bad_options_and_keeps_the_episodes(self, assert_identical):
        for options in [
            {"state": (0.0, 0.0, 0.0, 0.0)},
            {"reset_mask": np.ones(N_ENVS)},
            {"reset_mask": np.ones(N_ENVS + 1, dtype=bool)},
            {"reset_mask": np.zeros(N_ENVS, dtype=bool)},
        ]:
            envs, twins = make_native(), make_native()
            for each in (envs, twins):
                each.reset()
            with pytest.raises(ValueError, match=next(iter(options))):
                envs.reset(options=options)
            for action in random_actions(3):
                assert_identical(envs.step(action), twins.step(action))

    def test_seeds_are_those_of_the_envs(self):
        assert make_native().reset(seed=list(range(N_ENVS)))[0].shape[0] == N_ENVS
        with pytest.raises(ValueError, match=f"`seed` must hold {N_ENVS} seeds"):
            make_native().reset(seed=[1, 2])
        for seeds in (-1, [-1] * N_ENVS):
            with pytest.raises(ValueError, match="`seed` must be None or a whole number of at lea"):
                make_native().reset(seed=seeds)


class TestStep:
    def test_needs_every_env_to_have_been_reset(self):
        envs = make_native()
        actions = random_actions(1)[0]
        with pytest.raises(ResetNeeded):
            envs.step(actions)
        for mask in (np.arange(N_ENVS) < 2, np.arange(N_ENVS) >= 2):
            with pytest.raises(ResetNeeded):
                envs.step(actions)
            envs.reset(options={"reset_mask": mask})
        envs.step(actions)

    def test_needs_a_reset_after_an_end_with_autoreset_disabled(self):
        envs = make_native(autoreset_mode=AutoresetMode.DISABLED, horizon=1)
        envs.reset()
        envs.step(random_actions(1)[0])
        with pytest.raises(ResetNeeded):
            envs.step(random_actions(1)[0])

    def test_rejects_bad_actions_and_does_not_move(self, assert_identical):
        for actions in [
            np.full((N_ENVS, 2), np.nan),
            np.where(np.arange(2 * N_ENVS).reshape(N_ENVS, 2) == 7, np.inf, 0.0),
            np.zeros((N_ENVS - 1, 2)),
            [[0.0, 0.0], [0.0]],
        ]:
            envs, twins = make_native(), make_native()
            for each in (envs, twins):
                each.reset()
            with pytest.raises(ValueError, match="`actions` must be finite, of shape"):
                envs.step(actions)
            assert_identical(envs.step(random_actions(1)[0]), twins.step(random_actions(1)[0]))


class TestMakeVec:
    @pytest.mark.parametrize(
        ("mode", "limit"),
        [(MODES[0], 1), (MODES[1], 7), (MODES[2], 12), (MODES[0], 25), (MODES[1], 40)],
    )
    def test_max_episode_steps_is_the_time_limit_of_single_envs(
        self, mode, limit, assert_identical, run
    ):
        actions = random_actions(150)
        keywords = KEYWORDS | {"num_envs": N_ENVS, "max_episode_steps": limit}
        native = gym.make_vec("CuriosityMaze-v0", autoreset_mode=mode, **keywords)
        sync = gym.make_vec(
            "CuriosityMaze-v0",
            vectorization_mode="sync",
            vector_kwargs={"autoreset_mode": mode},
            **keywords,
        )
        for our, their in zip(run(native, actions), run(sync, actions), strict=True):
            assert_identical(our, their)

    def test_the_single_env_has_the_same_limit(self):
        env = make_native(max_episode_steps=3).make_single_env()
        assert (env.unwrapped.horizon, env._max_episode_steps) == (25, 3)
        assert type(make_native().make_single_env()) is MazeEnv

    def test_rejects_bad_keywords(self):
        for keyword, value in [
            ("num_envs", 0),
            ("n_threads", 0),
            ("render_mode", "human"),
            ("autoreset_mode", "Sometimes"),
            ("max_episode_steps", -1),
            ("restitution", 2.0),
        ]:
            with pytest.raises(
                ValueError, match=str(value) if isinstance(value, str) else "must be"
            ):
                make_native(**{keyword: value})


class TestRender:
    def test_gives_a_frame_of_each_env_as_single_envs_do(self, run):
        ours = make_native(render_mode="rgb_array")
        theirs = make_sync(AutoresetMode.NEXT_STEP, render_mode="rgb_array")
        for envs in (ours, theirs):
            run(envs, random_actions(30))
        for frame, expected in zip(ours.render(), theirs.render(), strict=True):
            np.testing.assert_array_equal(frame, expected)
        ours.close()

    def test_needs_a_mode_and_episodes(self):
        with pytest.raises(ResetNeeded):
            make_native(render_mode="rgb_array").render()
        with pytest.warns(UserWarning, match="render_mode"):
            assert make_native().render() is None


def test_copies_continue_on_their_own(duplicate, assert_identical, run):
    envs = make_native(400, n_threads=2)
    run(envs, random_actions(10, num_envs=400))
    twins = duplicate(envs)
    for action in random_actions(30, num_envs=400, seed=1):
        assert_identical(envs.step(action), twins.step(action))


@pytest.mark.parametrize("start_method", ["fork", "spawn"])
def test_single_envs_work_in_processes_started_after_compiled_calls_on_threads(
    start_method, assert_identical, run
):
    if start_method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"no {start_method} here")
    run(make_native(700, n_threads=2), random_actions(5, num_envs=700))
    make_env = partial(gym.make, "curiosity_gym:CuriosityMaze-Hard-v0")
    envs = AsyncVectorEnv([make_env] * 2, context=start_method)
    native = MazeVectorEnv("hard", num_envs=2)
    try:
        for ours, theirs in zip(
            run(native, random_actions(20, num_envs=2)),
            run(envs, random_actions(20, num_envs=2)),
            strict=True,
        ):
            assert_identical(ours, theirs)
    finally:
        envs.close()
