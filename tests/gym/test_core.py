import numpy as np
import pytest

from curiosity_gym.core import CoverageGrid, entry_names


def make_grid(**changes):
    values = {"dimensions": (0, 2), "low": np.array([0.0, -1.0]), "high": np.array([10.0, 1.0])}
    return CoverageGrid(**(values | {"n_cells": 5} | changes))


def test_values_out_of_bounds_and_at_the_upper_bound_count_at_the_edge():
    behaviors = np.array([[10.0, 0.0, 1.0], [1e9, 0.0, 1e9], [-3.0, 0.0, -1e300]])
    cells = make_grid().cells(behaviors)
    np.testing.assert_array_equal(cells, [24, 24, 0])
    assert cells.dtype == np.int64


def test_cells_agree_with_numpys_histogram():
    rng = np.random.default_rng(0)
    behaviors = rng.uniform([0.0, 0.0, -1.0], [10.0, 1.0, 1.0], (500, 3))
    counts = np.bincount(make_grid().cells(behaviors), minlength=25).reshape(5, 5)
    edges = np.linspace(0.0, 10.0, 6), np.linspace(-1.0, 1.0, 6)
    np.testing.assert_array_equal(counts, np.histogram2d(*behaviors[:, [0, 2]].T, bins=edges)[0])


def test_projected_cells_are_those_of_a_grid_of_their_own():
    for kept, entries in [((0,), [0]), ((1,), [2]), ((1, 0), [2, 0])]:
        rng = np.random.default_rng(0)
        behaviors = rng.uniform([0.0, 0.0, -1.0], [10.0, 1.0, 1.0], (200, 3))
        grid = make_grid(projections={"part": kept})
        alone = make_grid(
            dimensions=tuple(entries), low=grid.low[list(kept)], high=grid.high[list(kept)]
        )
        projected = grid.project(grid.cells(behaviors), "part")
        np.testing.assert_array_equal(projected, alone.cells(behaviors))


def test_grids_are_equal_when_they_count_the_same():
    for changes in [
        {"dimensions": (0, 1)},
        {"low": np.array([0.0, -2.0])},
        {"n_cells": 6},
        {"projections": {"part": (1,)}},
        {"reachable": np.ones((5, 5), dtype=bool)},
    ]:
        assert make_grid() == make_grid()
        assert make_grid(**changes) == make_grid(**changes)
        assert make_grid() != make_grid(**changes)


def test_bounds_that_leave_no_room_for_cells_are_errors():
    for low in [1.0, 2.0, np.nan]:
        with pytest.raises(ValueError, match="every `low` below its `high`"):
            make_grid(low=np.array([0.0, low]))


def test_entries_without_names_are_numbered():
    assert entry_names(None, 3) == ("behavior 1", "behavior 2", "behavior 3")
    assert entry_names(["x (m)", "y (m)"], 2) == ("x (m)", "y (m)")


def test_other_names_than_entries_are_errors():
    for names in (["x (m)"], "xy"):
        with pytest.raises(ValueError, match="`behavior_names` must be a tuple of 2 strings"):
            entry_names(names, 2)
