import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from curiosity_algos.evaluation.cells import VisitedCells, cell_of, compiled_grid
from curiosity_gym.core import CoverageGrid

GRID = CoverageGrid((0, 2), np.array([0.0, -1.0]), np.array([10.0, 1.0]), n_cells=5)
finite = st.floats(-1e6, 1e6)


@st.composite
def grids(draw):
    """Some of four entries, between any bounds."""
    dimensions = draw(st.lists(st.integers(0, 3), min_size=1, max_size=3, unique=True))
    bounds = st.lists(finite, min_size=2, max_size=2, unique=True).map(sorted)
    low, high = np.array([draw(bounds) for _ in dimensions]).T
    return CoverageGrid(tuple(dimensions), low, high, draw(st.integers(1, 60)))


@st.composite
def behaviors(draw, grid):
    """Four entries, those that count often at the border of two cells, or just beside it."""
    behavior = np.array(draw(st.lists(finite, min_size=4, max_size=4)))
    for i, low, high in zip(grid.dimensions, grid.low, grid.high, strict=True):
        if draw(st.booleans()):
            border = low + (high - low) * draw(st.integers(-1, grid.n_cells + 1)) / grid.n_cells
            behavior[i] = np.nextafter(border, draw(st.sampled_from([-np.inf, border, np.inf])))
    return behavior


@settings(deadline=None)  # the first example compiles
@given(st.data())
def test_compiled_functions_find_the_cell_that_the_grid_says(data):
    grid = data.draw(grids())
    behavior = data.draw(behaviors(grid))
    assert cell_of(compiled_grid(grid), behavior) == grid.cells(behavior[None])[0]


@pytest.mark.parametrize("value", [np.nan, -np.inf, 1e308])
def test_compiled_functions_leave_no_array(value):
    assert 0 <= cell_of(compiled_grid(GRID), np.full(3, value)) < 25


def test_cells_count_once_in_whatever_order():
    one, other = VisitedCells(GRID), VisitedCells(GRID)
    rows = np.random.default_rng(0).uniform([0, 0, -1], [10, 1, 1], (90, 3))
    one.add(rows)
    for row in rows[::-1]:
        other.add_each([row, row.tolist()])
    np.testing.assert_array_equal(one.indices(), np.unique(GRID.cells(rows)))
    np.testing.assert_array_equal(other.indices(), one.indices())
    assert one.indices().dtype == np.int64


@pytest.mark.parametrize("behavior", [[1.0, 1.0, np.inf], [1.0, 1.0], None])
def test_what_is_no_place_has_no_cell(behavior):
    cells = VisitedCells(GRID)
    cells.add_each([behavior])
    assert len(cells.indices()) == 0
    cells.add_each([None, [9.9, 7.0, 0.9]])
    assert cells.indices().tolist() == [24]


def test_the_environment_may_write_into_the_same_array_again():
    cells, behavior = VisitedCells(GRID), np.zeros(3)
    for x in (1.0, 3.0, 5.0):
        behavior[0] = x
        cells.add_each([behavior])
    np.testing.assert_array_equal(cells.indices(), [2, 7, 12])


def test_nothing_counts_without_a_grid():
    cells = VisitedCells(None)
    cells.add(np.zeros((2, 3)))
    assert len(cells.indices()) == 0
