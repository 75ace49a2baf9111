import matplotlib

matplotlib.use("Agg")

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.collections import PatchCollection, QuadMesh
from matplotlib.colors import LogNorm, to_rgba
from ribs.archives import GridArchive

from curiosity_algos.archives.plots import plot_archive
from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.maze.viewer import FLOOR

WIDE = MazeLayout("wide", 40, 20, (5, 5), (35, 5), [[18, 0, 4, 10]])

pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


def make_archive(behaviors, objective):
    fields = {"objective": objective, "measures": behaviors}
    fields = {name: np.asarray(values, dtype=np.float64) for name, values in fields.items()}
    return SimpleNamespace(field_list=[*fields], data=fields.get)


def random_archive(n=400, low=-10.0, high=60.0):
    """Behaviors of three entries, some of them outside of `WIDE`."""
    rng = np.random.default_rng(0)
    return make_archive(rng.uniform(low, high, (n, 3)), rng.normal(size=n))


def mesh_of(ax):
    (mesh,) = (item for item in ax.collections if isinstance(item, QuadMesh))
    return mesh


def edges_of(ax):
    corners = mesh_of(ax).get_coordinates()  # (n_cells + 1, n_cells + 1, 2), indexed [iy, ix]
    return corners[0, :, 0], corners[:, 0, 1]


def shown(ax):
    """What the cells [ix, iy] show, NaN where they are transparent."""
    return np.ma.filled(mesh_of(ax).get_array(), np.nan).T


def pixel(ax, x, y):
    """The color drawn at x, y."""
    ax.figure.canvas.draw()
    picture = np.asarray(ax.figure.canvas.buffer_rgba())
    column, row = ax.transData.transform((x, y))
    return picture[len(picture) - 1 - int(row), int(column)] / 255


def looks(color, expected):
    return np.allclose(color, to_rgba(expected), atol=0.01)


@pytest.mark.parametrize(("layout", "dimensions"), [(None, (2, 0)), (WIDE, (0, 1))])
def test_cells_show_how_many_elites_they_hold(layout, dimensions):
    archive = random_archive()
    x, y = archive.data("measures")[:, dimensions].T
    spans = [[x.min(), x.max()], [y.min(), y.max()]] if layout is None else [[0, 40], [0, 20]]
    ax = plot_archive(archive, layout, by="elites", dimensions=dimensions, n_cells=7)
    counts, *edges = np.histogram2d(x, y, bins=7, range=spans)
    np.testing.assert_array_equal(shown(ax), np.where(counts == 0, np.nan, counts))
    np.testing.assert_allclose(edges_of(ax), edges)
    assert isinstance(mesh_of(ax).norm, LogNorm)


@pytest.mark.parametrize("layout", [None, WIDE])
def test_cells_show_their_best_objective(layout):
    archive = random_archive(n=100)
    ax = plot_archive(archive, layout, n_cells=6)
    x_edges, y_edges = edges_of(ax)
    expected = np.full((6, 6), np.nan)
    elites = zip(archive.data("measures"), archive.data("objective"), strict=True)
    for (x, y, _), objective in elites:
        if x_edges[0] <= x <= x_edges[-1] and y_edges[0] <= y <= y_edges[-1]:
            # The last cell holds its upper edge too.
            ix = min(np.searchsorted(x_edges, x, side="right") - 1, 5)
            iy = min(np.searchsorted(y_edges, y, side="right") - 1, 5)
            expected[ix, iy] = np.fmax(expected[ix, iy], objective)
    assert np.isnan(expected).any()
    np.testing.assert_array_equal(shown(ax), expected)


GRID = {"dims": [5, 3, 4, 7], "ranges": [(0, 40), (0, 20), (-1.0, 1.0), (2.0, 3.0)]}


def make_grid(n=300, kind=SparseGridArchive):
    """Elites in four dimensions, some of them beyond the bounds."""
    archive = kind(solution_dim=1, **GRID)
    rng, (low, high) = np.random.default_rng(0), np.transpose(GRID["ranges"])
    measures = rng.uniform(1.1 * low - 0.1 * high, 1.1 * high - 0.1 * low, (n, 4))
    archive.add(np.zeros((n, 1)), rng.normal(size=n), measures)
    return archive


def brute_force(archive, x, y, by):
    """What a walk over all elites finds in each cell of two dimensions of their grid."""
    found = np.full((archive.dims[x], archive.dims[y]), np.nan)
    for elite in archive:
        cell = [int(i) for i in np.unravel_index(elite["index"], tuple(archive.dims))]
        value = elite["objective"] if by == "objective" else 1.0
        before = found[cell[x], cell[y]]
        together = max(before, value) if by == "objective" else before + value
        found[cell[x], cell[y]] = value if np.isnan(before) else together
    return found


@pytest.mark.parametrize(
    ("dimensions", "by", "layout"),
    [
        ((0, 1), "objective", None),
        ((0, 1), "elites", WIDE),
        ((3, 1), "objective", WIDE),
        ((3, 1), "elites", None),
    ],
)
def test_a_grid_is_shown_in_its_own_cells(dimensions, by, layout):
    archive = make_grid()
    ax = plot_archive(archive, layout, dimensions=dimensions, by=by)
    expected = brute_force(archive, *dimensions, by)
    assert np.nanmax(expected) > np.nanmin(expected)
    np.testing.assert_array_equal(shown(ax), expected)
    for edges, dimension in zip(edges_of(ax), dimensions, strict=True):
        np.testing.assert_allclose(edges, archive.boundaries[dimension])


@pytest.mark.parametrize("kind", [SparseGridArchive, GridArchive])
def test_elites_at_borders_are_shown_in_their_cells(kind):
    archive = kind(solution_dim=1, dims=[10, 10], ranges=[(0, 1)] * 2)
    tenths = np.indices((10, 10)).reshape(2, 100).T / 10
    archive.add(np.zeros((100, 1)), np.arange(100.0), tenths)
    np.testing.assert_array_equal(shown(plot_archive(archive)), np.arange(100.0).reshape(10, 10))


def test_cells_of_something_else_are_not_shown():
    archive = SparseGridArchive(
        solution_dim=1, extra_fields={"behavior": ((2,), np.float64)}, **GRID
    )
    archive.add([[0.0]], [3.0], [[1, 1, 0, 2]], behavior=[[7.0, 8.0]])
    x_edges, y_edges = edges_of(plot_archive(archive))
    assert len(x_edges) == len(y_edges) == 51
    assert x_edges[0] <= 7.0 <= x_edges[-1]


@pytest.mark.parametrize("by", ["objective", "elites"])
def test_an_elite_colors_the_place_where_it_is(by):
    ax = plot_archive(make_archive([[35.0, 4.0]] * 2, [0.0, -3.0]), WIDE, by=by, n_cells=4)
    assert np.argwhere(~np.isnan(shown(ax))).tolist() == [[3, 0]]
    ax.lines[1].remove()  # the goal would be over it
    assert not looks(pixel(ax, 33.0, 3.0), FLOOR)
    for x, y in [(33.0, 17.0), (25.0, 3.0), (7.0, 17.0), (33.0, 8.0)]:
        assert looks(pixel(ax, x, y), FLOOR)


def test_without_a_maze_the_dimensions_are_named():
    ax = plot_archive(random_archive(), dimensions=(2, 1))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("behavior 3", "behavior 2")
    assert not any(isinstance(item, PatchCollection) for item in ax.collections)


@pytest.mark.parametrize("layout", [None, WIDE])
def test_axes_have_the_names_of_the_behavior(layout):
    names = ("x (m)", "y (m)", "z (m)")
    ax = plot_archive(random_archive(), layout, dimensions=(2, 1), behavior_names=names)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("z (m)", "y (m)")
    with pytest.raises(ValueError, match="`behavior_names` must be a tuple of 3 strings"):
        plot_archive(random_archive(), layout, behavior_names=names[:2])


@pytest.mark.parametrize(("by", "layout"), [("objective", None), ("elites", WIDE)])
def test_an_empty_archive_is_an_empty_map(by, layout):
    ax = plot_archive(make_archive(np.empty((0, 2)), []), layout, by=by)
    ax.figure.canvas.draw()
    assert not any(isinstance(item, QuadMesh) for item in ax.collections)
    assert len(ax.figure.axes) == 1


@pytest.mark.parametrize(
    ("name", "wrong", "message"),
    [
        ("dimensions", [(0, 0), (0, 3), (-1, 0), (0,), (0, 1, 2), (0, 1.5)], "two .* 0 to 2, got"),
        ("by", ["novelty"], ""),
        ("n_cells", [0], ""),
    ],
)
def test_bad_arguments_are_named(name, wrong, message):
    for value in wrong:
        with pytest.raises(ValueError, match=f"^`{name}` must be {message}"):
            plot_archive(random_archive(), **{name: value})
        assert not plt.get_fignums()
