from collections import Counter

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.collections import PatchCollection, QuadMesh
from matplotlib.colors import LogNorm, to_rgba

from curiosity_gym.built_in import BUILT_IN
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.maze.plots import count, draw_counts, draw_layout, plot_density


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


def counted(ax):
    return [item for item in ax.collections if isinstance(item, QuadMesh)]


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


def test_density_counts_every_position_in_its_square():
    layout = BUILT_IN["hard"]
    rng = np.random.default_rng(0)
    positions = np.concatenate([rng.uniform(0, 200, (200, 2)), rng.normal(100, 8, (300, 2))])
    ax = plot_density(positions, layout, bins=20)
    (squares,) = counted(ax)
    # Counted one by one: how many positions are in each square of side 10.
    expected = Counter((int(y // 10), int(x // 10)) for x, y in positions)
    shown = squares.get_array()
    assert {at: n for at, n in np.ndenumerate(shown.filled(0)) if n} == expected
    corners = squares.get_coordinates()
    np.testing.assert_array_equal(corners[3, 5], [50.0, 30.0])  # x, y
    assert isinstance(squares.norm, LogNorm)
    assert squares.get_zorder() < 1.0  # which is that of walls
    assert squares.get_rasterized()
    assert "10 x 10" in ax.figure.axes[1].get_ylabel()


def test_squares_reach_to_the_edges_of_any_maze():
    layout = MazeLayout("flat", 45, 20, (5, 5), (40, 15), [])
    corners = np.array([[0.0, 0.0], [45.0, 20.0]])
    counts = count(corners, layout, 4.5)
    assert counts.shape == (5, 10)
    assert counts[0, 0] == counts[-1, -1] == 1
    assert counts.sum() == 2


def test_density_of_no_positions_is_the_layout():
    ax = plot_density(np.empty((0, 2)), BUILT_IN["us"])
    assert not counted(ax)
    assert len(ax.figure.axes) == 1


def test_counts_of_several_mazes_share_their_colors():
    axes = list(plt.figure().subplots(1, 3))
    for ax in axes:
        draw_layout(ax, BUILT_IN["us"])
    many, one, none = np.full((10, 10), 40), np.eye(10, dtype=int), np.zeros((10, 10), dtype=int)
    draw_counts(axes, [many, one, none], 20.0)
    squares = [counted(ax)[0] for ax in axes]
    assert [each.get_array().count() for each in squares] == [100, 10, 0]
    assert {(each.norm.vmin, each.norm.vmax) for each in squares} == {(1, 40)}
    assert len(axes[0].figure.axes) == 4
    axes[0].figure.canvas.draw()


def test_bad_positions_are_named():
    for positions in [[1.0, 2.0], [[1.0, 2.0, 3.0]], [[1.0, np.nan]], []]:
        with pytest.raises(ValueError, match=r"^positions must be"):
            plot_density(np.array(positions), BUILT_IN["us"])
        assert not plt.get_fignums()
