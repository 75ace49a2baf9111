import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.collections import PatchCollection, PathCollection
from matplotlib.colors import LogNorm, to_rgba

from curiosity_gym.built_in import BUILT_IN
from curiosity_gym.maze.plots import draw_densities, draw_layout, plot_density


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


def scattered(ax):
    return [item for item in ax.collections if isinstance(item, PathCollection)]


@pytest.mark.parametrize("name", BUILT_IN)
def test_layout_shows_walls_start_and_goal(name):
    layout = BUILT_IN[name]
    ax = plt.figure().add_subplot()
    draw_layout(ax, layout)
    (walls,) = (item for item in ax.collections if isinstance(item, PatchCollection))
    boxes = [path.get_extents().bounds for path in walls.get_paths()]
    np.testing.assert_allclose(boxes, layout.walls)
    start, goal = ax.get_lines()
    assert (start.get_xydata()[0] == layout.start).all()
    assert (goal.get_xydata()[0] == layout.goal).all()
    assert (start.get_marker(), to_rgba(start.get_color())) == ("o", to_rgba("red"))
    assert (goal.get_marker(), to_rgba(goal.get_color())) == ("x", to_rgba("black"))
    assert (ax.get_xlim(), ax.get_ylim()) == ((0.0, layout.width), (0.0, layout.height))


def test_density_shows_every_position_colored_by_its_neighbors():
    layout = BUILT_IN["hard"]
    rng = np.random.default_rng(0)
    positions = np.concatenate([rng.uniform(0, 200, (200, 2)), rng.normal(100, 8, (300, 2))])
    ax = plot_density(positions, layout, bins=20)
    (points,) = scattered(ax)
    shown = np.column_stack([points.get_offsets(), points.get_array()])
    # Counted pair by pair: how many positions are in the same square of side 10.
    cells = positions // 10.0
    counts = [(cells == cell).all(axis=1).sum() for cell in cells]
    expected = np.column_stack([positions, counts])
    np.testing.assert_array_equal(shown[np.lexsort(shown.T)], expected[np.lexsort(expected.T)])
    assert (np.diff(points.get_array()) >= 0).all()
    assert isinstance(points.norm, LogNorm)
    assert "10 x 10" in ax.figure.axes[1].get_ylabel()


def test_density_draws_on_given_axes():
    ax = plt.figure().add_subplot()
    assert plot_density(np.array([[5.0, 5.0]]), BUILT_IN["us"], ax=ax) is ax
    ax.figure.canvas.draw()


def test_density_of_no_positions_is_the_layout():
    ax = plot_density(np.empty((0, 2)), BUILT_IN["us"])
    assert not scattered(ax)
    assert len(ax.figure.axes) == 1


def test_densities_of_several_mazes_share_their_colors():
    axes = list(plt.figure().subplots(1, 3))
    for ax in axes:
        draw_layout(ax, BUILT_IN["us"])
    many, one = np.full((40, 2), 5.0), np.array([[150.0, 5.0]])
    draw_densities(axes, [many, one, np.empty((0, 2))], cell_size=2.0)
    dots = [scattered(ax)[0] for ax in axes]
    assert [len(each.get_offsets()) for each in dots] == [40, 1, 0]
    assert {(each.norm.vmin, each.norm.vmax) for each in dots} == {(1, 40)}
    assert len(axes[0].figure.axes) == 4


def test_bad_positions_are_named():
    for positions in [[1.0, 2.0], [[1.0, 2.0, 3.0]], [[1.0, np.nan]], []]:
        with pytest.raises(ValueError, match=r"^positions must be"):
            plot_density(np.array(positions), BUILT_IN["us"])
        assert not plt.get_fignums()
