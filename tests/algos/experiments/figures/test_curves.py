"""Curves on axes."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

from curiosity_algos.experiments.figures.canvas import make_panels
from curiosity_algos.experiments.figures.curves import Line, draw_lines, legend_handles


def curve(x, y):
    return np.array(x, dtype=float), np.array(y, dtype=float)


@pytest.fixture
def ax():
    return make_panels(1, 1)[1][0, 0]


def drawn(ax, color, width):
    """Points of the lines of a color and width."""
    return [
        line.get_xydata()
        for line in ax.get_lines()
        if to_hex(line.get_color()) == color and line.get_linewidth() == width
    ]


def dotted(ax):
    (rest,) = [each for each in ax.collections if each.get_linestyle()[0][1]]
    return rest.get_segments()[0]


def test_the_thick_line_is_the_interquartile_mean(has_ink, ax):
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.integers(1, 9, (5, 30)), axis=1)
    curves = [curve([0, *steps], [0, *rng.random(30)]) for steps in times]
    draw_lines(ax, [Line("NSES", "#0077bb", curves)], x_unit=10.0, y_unit=0.01)
    (points,) = drawn(ax, "#0077bb", 2.0)
    for x, y in points[::17]:
        values = sorted(v[t <= x * 10.0 * (1 + 1e-12)][-1] for t, v in curves)
        assert y == pytest.approx(100.0 * np.mean(values[1:4]))  # a fifth is left out at each end
    thin = drawn(ax, "#0077bb", 0.6)
    for points, (timesteps, values) in zip(thin, curves, strict=True):
        np.testing.assert_allclose(points, np.column_stack([timesteps / 10.0, values * 100.0]))
    assert ax.collections[0].get_paths()[0].get_extents().height > 0.0
    assert has_ink(ax.figure, ax)


def test_a_line_that_ends_early_goes_on_dotted(ax):
    short = Line("TD3ICM", "#aa3377", [curve([0, 5], [0, 0.5])])
    draw_lines(ax, [short, Line("NSES", "#0077bb", [curve([0, 50], [0, 1])])])
    assert dotted(ax).tolist() == [[5.0, 0.5], [50.0, 0.5]]
    assert ax.get_xlim() == (0.0, 50.0)


def test_the_mean_ends_with_the_shortest_run_and_its_runs_go_on(ax):
    runs = [curve([0, 2], [0, 0.1]), curve([0, 2, 10], [0, 0.3, 0.9])]
    draw_lines(ax, [Line("NSES", "#0077bb", runs)])
    (points,) = drawn(ax, "#0077bb", 2.0)
    assert points[-1].tolist() == [2.0, pytest.approx(0.2)]
    ends = [each[-1].tolist() for each in drawn(ax, "#0077bb", 0.6)]
    assert ends == [[2.0, 0.1], [10.0, 0.9]]
    np.testing.assert_allclose(dotted(ax), [[2.0, 0.2], [10.0, 0.2]])


def test_a_mean_begins_where_all_runs_have_begun(ax):
    runs = [curve([1, 9], [-5, -3]), curve([2, 9], [-1, -1])]
    apart = [curve([each], [-4]) for each in (3, 5)]
    draw_lines(ax, [Line("NSES", "#0077bb", runs), Line("NSLC", "#33bbee", apart)])
    (points,) = drawn(ax, "#0077bb", 2.0)
    assert points[0].tolist() == [2.0, -3.0]
    (points,) = drawn(ax, "#33bbee", 2.0)
    assert len(points) == 0


def test_each_label_is_once_in_the_legend():
    lines = [Line("NSES", "red", []), Line("NSLC", "blue", [], "--"), Line("NSES", "red", [])]
    handles = [(each.get_label(), each.get_linestyle()) for each in legend_handles(lines)]
    assert handles == [("NSES", "-"), ("NSLC", "--")]


def test_axes_without_lines_say_so(has_ink, ax):
    draw_lines(ax, [])
    assert not ax.get_lines()
    assert has_ink(ax.figure, ax)
