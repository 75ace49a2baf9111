from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from stable_baselines3.common.vec_env import DummyVecEnv

from curiosity_algos.evaluation.coverage import Coverage, coverage_grid
from curiosity_gym.core import CoverageGrid

REACHABLE = np.array([[True, True, False], [False, False, False], [False, False, True]])
GRID = CoverageGrid((0, 1), np.zeros(2), np.full(2, 3.0), n_cells=3, reachable=REACHABLE)


class BehaviorEnv(gym.Env):
    observation_space = action_space = spaces.Box(-1, 1, (1,))

    def __init__(self, high=2.0):
        self.behavior_space = spaces.Box(-1, high, (2,))


def test_shares_count_each_visited_cell_once():
    coverage = Coverage(GRID)
    assert (coverage.all, coverage.reachable) == (0.0, 0.0)
    coverage.add(np.array([[0.5, 0.5], [0.6, 0.4], [1.5, 1.5]]))
    coverage.add(np.array([[0.5, 0.5], [0.5, 1.5]]))
    assert coverage.all == pytest.approx(3 / 9)
    assert coverage.reachable == pytest.approx(2 / 3)


def test_parts_that_the_grid_names_are_counted_beside_the_whole():
    grid = CoverageGrid((0, 1), np.zeros(2), np.full(2, 3.0), 3, projections={"height": (1,)})
    coverage = Coverage(grid)
    assert coverage.shares == {"reachable": 0.0, "visited": 0.0, "all": 0.0, "height": 0.0}
    coverage.add(np.array([[0.5, 0.5], [1.5, 0.5], [2.5, 0.5], [2.5, 1.5]]))
    assert coverage.shares == {
        "reachable": 4 / 9,
        "visited": 4 / 9,
        "all": 4 / 9,
        "height": 2 / 3,
    }


def test_nothing_to_count_is_none():
    coverage = Coverage(None)
    coverage.add(np.zeros((3, 0)))
    assert coverage.all is coverage.reachable is coverage.visited is None


def test_the_state_goes_over():
    one, other = Coverage(GRID), Coverage(GRID)
    one.add(np.array([[0.5, 0.5], [2.5, 2.5]]))
    other.load_state_dict(one.state_dict())
    assert other.reachable == one.reachable
    other.add(np.array([[0.5, 1.5]]))
    assert (one.reachable, other.reachable) == (2 / 3, 1.0)
    assert (one.visited, other.visited) == (2 / 3, 1.0)


def test_cells_of_steps_count_as_visited_alone():
    coverage = Coverage(GRID)
    coverage.add_steps([[0.5, 0.5], [1.5, 1.5]])
    coverage.add_steps([])
    assert (coverage.reachable, coverage.visited, coverage.all) == (0.0, 1 / 3, 0.0)
    coverage.add(np.array([[0.5, 1.5]]), np.array([1, 8]))
    assert (coverage.reachable, coverage.visited, coverage.all) == (1 / 3, 1.0, 1 / 9)


@given(st.lists(arrays(np.float64, (3, 2), elements=st.floats(-1, 4)), min_size=1), st.booleans())
def test_more_cells_are_visited_than_ended_in(places, is_known):
    coverage = Coverage(GRID if is_known else replace(GRID, reachable=None))
    ended = set()
    for i, behaviors in enumerate(places):
        if i % 2:
            coverage.add(behaviors, None if i % 3 else np.array([i % 9]))
            ended |= set(GRID.cells(behaviors).tolist())
        else:
            coverage.add_steps(list(behaviors))
        assert coverage.visited >= coverage.reachable
    assert coverage.state_dict()["final"].tolist() == sorted(ended)
    assert ended <= set(coverage.state_dict()["visited"].tolist())


def test_the_grid_of_an_env_is_its_own_or_its_behavior_space(make_maze):
    maze = make_maze()
    assert coverage_grid(DummyVecEnv([lambda: maze])) == maze.unwrapped.coverage_grid
    grid = coverage_grid(DummyVecEnv([BehaviorEnv]))
    assert grid.dimensions == (0, 1)
    np.testing.assert_array_equal([grid.low, grid.high], [[-1, -1], [2, 2]])


def test_an_env_without_a_bounded_behavior_space_has_no_grid():
    assert coverage_grid(DummyVecEnv([lambda: gym.make("CartPole-v1")])) is None
    assert coverage_grid(DummyVecEnv([lambda: BehaviorEnv(np.inf)])) is None
