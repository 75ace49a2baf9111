import base64

import numpy as np
import pytest

from curiosity_algos import CuriosityES
from curiosity_algos.experiments.report.arrays import NO_VALUE
from curiosity_algos.experiments.report.bonus_maps import ACTIONS, bonus_map, has_bonus, steps_of
from curiosity_algos.experiments.report.planes import N_CELLS, plane_of


@pytest.fixture(scope="module")
def seen():
    return {}


@pytest.fixture
def steps(maze, seen):
    if not seen:
        seen["steps"] = steps_of(plane_of(maze))
    return seen["steps"]


def test_a_robot_stands_in_every_cell_that_it_can_reach(maze, steps):
    reachable = plane_of(maze).maze.coverage_grid.reachable.T.ravel()
    free = np.zeros(N_CELLS * N_CELLS, dtype=bool)
    free[steps.cells] = True
    assert (reachable & ~free).sum() < 0.02 * reachable.sum()  # narrow ones at corners


def test_a_robot_at_rest_sees_its_place_and_where_each_action_leads(maze, steps):
    before = steps.observations.reshape(-1, len(ACTIONS), 36)
    after = steps.next_observations.reshape(-1, len(ACTIONS), 36)
    assert (before == before[:, :1]).all()
    x = (before[:, 0, 0] + 1.0) / 2.0 * N_CELLS
    np.testing.assert_array_equal(np.floor(x), steps.cells % N_CELLS)
    moved = after[:, :, 2:4]
    np.testing.assert_array_equal(moved[:, 0], 0.0)  # without an action it stays
    assert (moved[:, 1, 0] >= 0.0).all()
    assert (moved[:, 1, 0] > 0.0).mean() > 0.8


def test_a_map_is_the_mean_bonus_of_the_actions(maze, steps):
    run = maze.of("CuriosityES")[0]
    drawn = bonus_map(run, steps)
    values = np.frombuffer(base64.b64decode(drawn["data"]), dtype="<u2")
    assert ((values != NO_VALUE).nonzero()[0] == steps.cells).all()
    bonus = CuriosityES.load(run.folder.checkpoint / "model").trained_bonus
    first = slice(len(ACTIONS))
    expected = bonus.score(*(each[first] for each in steps[1:])).mean()
    found = drawn["low"] + values[steps.cells[0]] * drawn["width"] / (NO_VALUE - 1)
    assert found == pytest.approx(expected, abs=drawn["width"] / NO_VALUE)
    low, high = drawn["shown"]
    assert drawn["low"] < low < high < drawn["low"] + drawn["width"]


def test_only_some_algorithms_have_a_bonus(maze, mountain):
    runs = [*maze.runs, *mountain.runs]
    assert {run.label for run in runs if has_bonus(run)} == {"CuriosityES", "TD3ICM"}
    assert steps_of(plane_of(mountain)) is None


def test_a_bonus_of_ones_own_cannot_be_made_again(maze):
    run = maze.of("CuriosityES")[0]
    run.description["settings"]["bonus"] = "MyBonus"
    assert not has_bonus(run)
