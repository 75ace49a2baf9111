import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from curiosity_gym.built_in import BUILT_IN
from curiosity_gym.layouts import ROBOT_RADIUS
from curiosity_gym.reachability import reachable_region

SIZE = (16.0, 12.0)


def oracle_cells(walls, size, start, radius, n_cells):
    """The same by polygon clipping: the pieces of the free space that hold the start."""
    boxes = [
        shapely.box(x - radius, y - radius, x + w + radius, y + h + radius) for x, y, w, h in walls
    ]
    inner = shapely.box(radius, radius, size[0] - radius, size[1] - radius)
    pieces = shapely.get_parts(inner.difference(shapely.union_all(boxes)))
    reached = shapely.union_all(pieces[shapely.intersects(pieces, shapely.Point(start))])
    x, y = (np.linspace(0.0, side, n_cells + 1) for side in size)
    cells = shapely.box(x[:-1, None], y[None, :-1], x[1:, None], y[None, 1:])
    return shapely.area(shapely.intersection(cells, reached)) > 1e-9


@pytest.mark.parametrize(
    ("name", "n_reachable"), [("snake", 1650), ("us", 1652), ("hard", 1994), ("labyrinth", 1694)]
)
def test_built_in_mazes_match_polygon_clipping(name, n_reachable):
    layout = BUILT_IN[name]
    size = layout.width, layout.height
    region = reachable_region(layout.walls, size, layout.start, ROBOT_RADIUS)
    cells = region.cells(size, 50)
    assert cells.sum() == n_reachable
    np.testing.assert_array_equal(
        cells, oracle_cells(layout.walls, size, layout.start, ROBOT_RADIUS, 50)
    )


# Halves are exact in binary, so that walls, start and cells often touch exactly.
halves = st.integers(-4, 32).map(lambda n: n / 2)
lengths = st.integers(1, 12).map(lambda n: n / 2)


@given(
    walls=st.lists(st.tuples(halves, halves, lengths, lengths), max_size=12),
    start=st.tuples(
        st.integers(2, 30).map(lambda n: n / 2), st.integers(2, 22).map(lambda n: n / 2)
    ),
    n_cells=st.integers(1, 9),
)
def test_random_mazes_match_polygon_clipping(walls, start, n_cells):
    walls = np.array(walls).reshape(-1, 4)
    low, high = walls[:, :2] - 1.0, walls[:, :2] + walls[:, 2:] + 1.0
    assume(not ((low < start) & (start < high)).all(axis=1).any())
    cells = reachable_region(walls, SIZE, start, 1.0).cells(SIZE, n_cells)
    np.testing.assert_array_equal(cells, oracle_cells(walls, SIZE, start, 1.0, n_cells))


@pytest.mark.parametrize(("gap", "is_open"), [(2.0, False), (2.0 + 1e-6, True)])
def test_a_gap_as_wide_as_the_robot_is_closed(gap, is_open):
    walls = np.array([[7.0, 0.0, 1.0, 4.0], [7.0, 4.0 + gap, 1.0, 8.0]])
    cells = reachable_region(walls, SIZE, (2.0, 2.0), 1.0).cells(SIZE, 4)
    assert cells[0].any()
    assert cells[3].any() == is_open


def test_a_gap_of_one_rounding_is_closed():
    # 0.1 + 0.2 > 0.3 in floating point: the grown walls end one rounding apart.
    walls = np.array([[7.0, 0.0, 1.0, 0.3], [7.0, 0.1 + 0.2 + 2.0, 1.0, 12.0]])
    assert not reachable_region(walls, SIZE, (2.0, 2.0), 1.0).cells(SIZE, 4)[3].any()


def test_a_common_corner_is_no_way_through():
    # Grown by 1, the two blocks leave two free quarters that share the point (6, 6).
    walls = np.array([[0.0, 7.0, 5.0, 5.0], [7.0, 0.0, 9.0, 5.0]])
    region = reachable_region(walls, SIZE, (2.0, 2.0), 1.0)
    assert region.distance((2.0, 2.0)) == 0.0
    assert region.distance((10.0, 9.0)) == pytest.approx(np.hypot(4.0, 3.0))


def test_distance_is_to_the_nearest_reachable_point():
    region = reachable_region(np.empty((0, 4)), SIZE, (2.0, 2.0), 1.0)
    assert region.distance((16.0, 12.0)) == pytest.approx(np.sqrt(2.0))
    assert region.distance((8.0, 0.25)) == pytest.approx(0.75)
