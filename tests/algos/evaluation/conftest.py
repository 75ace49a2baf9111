"""The oracle of every evaluator: a plain loop over one env."""

import numpy as np

from curiosity_algos.evaluation.coverage import coverage_grid
from curiosity_algos.evaluation.flat_spaces import FlatActions
from curiosity_algos.evaluation.mlp import act
from curiosity_algos.evaluation.rollouts import Rollouts
from tests.algos.conftest import as_fixture


def play(env, mlp, parameters, seed=None):
    """One episode of each policy, the way a reader of Gymnasium's documentation writes it."""
    episodes, grid, choose = [], coverage_grid(env), FlatActions(env.action_space).choose
    for vector in parameters:
        observation, _ = env.reset(seed=seed)
        observations, actions, total, is_over = [observation], [], 0.0, False
        cells = None if grid is None else set()
        while not is_over:
            actions.append(choose(act(mlp, vector[None], observations[-1][None]))[0])
            observation, reward, terminated, truncated, info = env.step(actions[-1])
            observations.append(observation)
            total += float(reward)
            if grid is not None:
                cells.add(grid.cells(np.array(info["behavior"])[None]).item())
            is_over = terminated or truncated
        info = {**info, "terminated": terminated}
        episodes.append((np.array(observations), np.array(actions), total, info, cells))
    return episodes


def assert_equal_episodes(rollouts, episodes):
    """Rollouts hold the episodes, bit for bit, at the documented shapes and types."""
    assert isinstance(rollouts, Rollouts)
    assert len(rollouts) == len(episodes)
    assert rollouts.returns.dtype == rollouts.behaviors.dtype == np.float64
    assert (rollouts.lengths.dtype, rollouts.success.dtype) == (np.int64, np.bool_)
    assert rollouts.observations.dtype == rollouts.final_observations.dtype == np.float32
    longest = rollouts.actions.shape[1]
    assert longest >= rollouts.lengths.max()
    assert rollouts.observations.shape[1] == longest + 1
    all_cells = [cells for *_, cells in episodes if cells is not None]
    expected = sorted(set().union(*all_cells)) if all_cells else None
    np.testing.assert_equal(rollouts.visited, expected)
    for i, (observations, actions, total, info, _) in enumerate(episodes):
        length = len(actions)
        assert rollouts.lengths[i] == length
        assert rollouts.returns[i] == total
        assert rollouts.success[i] == info.get("is_success", False)
        assert rollouts.terminated[i] == info["terminated"]
        np.testing.assert_array_equal(rollouts.behaviors[i], info.get("behavior", ()))
        np.testing.assert_array_equal(rollouts.observations[i, : length + 1], observations)
        np.testing.assert_array_equal(rollouts.actions[i, :length], actions)
        np.testing.assert_array_equal(rollouts.final_observations[i], observations[-1])


def assert_same_rollouts(one, other):
    """Two rollouts are the same, in every bit that is defined, and that both have."""
    same = ("returns", "lengths", "success", "terminated", "behaviors", "final_observations")
    for name in (*same, "visited"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    if one.observations is None or other.observations is None:
        return
    for i, length in enumerate(one.lengths):
        np.testing.assert_array_equal(
            one.observations[i, : length + 1], other.observations[i, : length + 1]
        )
        np.testing.assert_array_equal(one.actions[i, :length], other.actions[i, :length])


play_fixture = as_fixture(play)
assert_equal_episodes_fixture = as_fixture(assert_equal_episodes)
assert_same_rollouts_fixture = as_fixture(assert_same_rollouts)
