"""Curves on axes."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

from curiosity_algos.experiments.figures.canvas import make_panels
from curiosity_algos.experiments.figures.curves import Line, draw_lines, legend_handles


def drawn(ax, color, width):
    """Points of the lines of a color and width."""
    return [
        line.get_xydata()
        for line in ax.get_lines()
        if to_hex(line.get_color()) == color and line.get_linewidth() == width
    ]


def test_the_thick_line_is_the_interquartile_mean(has_ink):
    rng = np.random.default_rng(1)
    curves = []
    for _ in range(5):
        timesteps = np.cumsum(rng.integers(1, 9, 30)).astype(float)
        curves.append((np.r_[0.0, timesteps], np.r_[0.0, rng.random(30)]))
    figure, axes = make_panels(1, 1)
    line = Line("NSES", "#0077bb", curves)
    draw_lines(axes[0, 0], [line], x_unit=10.0, y_unit=0.01)
    ((points,),) = [drawn(axes[0, 0], "#0077bb", 2.0)]
    for x, y in points[::17]:
        values = sorted(v[t <= x * 10.0 * (1 + 1e-12)][-1] for t, v in curves)
        assert y == pytest.approx(100.0 * np.mean(values[1:4]))  # a fifth is left out at each end
    thin = drawn(axes[0, 0], "#0077bb", 0.6)
    assert len(thin) == 5
    for points, (timesteps, values) in zip(thin, curves, strict=True):
        np.testing.assert_allclose(points, np.column_stack([timesteps / 10.0, values * 100.0]))
    band = axes[0, 0].collections[0]
    assert band.get_paths()[0].get_extents().height > 0.0
    assert has_ink(figure, axes[0, 0])


def test_a_line_that_ends_early_goes_on_dotted():
    _, axes = make_panels(1, 1)
    short = Line("TD3ICM", "#aa3377", [(np.array([0.0, 5.0]), np.array([0.0, 0.5]))])
    long = Line("NSES", "#0077bb", [(np.array([0.0, 50.0]), np.array([0.0, 1.0]))])
    draw_lines(axes[0, 0], [short, long])
    (rest,) = [each for each in axes[0, 0].collections if each.get_linestyle()[0][1]]
    assert rest.get_segments()[0].tolist() == [[5.0, 0.5], [50.0, 0.5]]
    assert axes[0, 0].get_xlim() == (0.0, 50.0)


def test_the_mean_ends_with_the_shortest_run_and_its_runs_go_on():
    """Unequal budgets: a run that ended at 2 is not known at 10."""
    _, axes = make_panels(1, 1)
    short, long = (
        (np.array([0.0, 2.0]), np.array([0.0, 0.1])),
        (
            np.array([0.0, 2.0, 10.0]),
            np.array([0.0, 0.3, 0.9]),
        ),
    )
    draw_lines(axes[0, 0], [Line("NSES", "#0077bb", [short, long])])
    ((points,),) = [drawn(axes[0, 0], "#0077bb", 2.0)]
    assert points[-1].tolist() == [2.0, pytest.approx(0.2)]
    assert [each[-1].tolist() for each in drawn(axes[0, 0], "#0077bb", 0.6)] == [
        [2.0, 0.1],
        [10.0, 0.9],
    ]
    (rest,) = [each for each in axes[0, 0].collections if each.get_linestyle()[0][1]]
    np.testing.assert_allclose(rest.get_segments()[0], [[2.0, 0.2], [10.0, 0.2]])
    assert axes[0, 0].get_xlim() == (0.0, 10.0)


def test_a_mean_begins_where_all_runs_have_begun():
    _, axes = make_panels(1, 1)
    runs = [(np.array([1.0, 9.0]), np.array([-5.0, -3.0])), (np.array([2.0, 9.0]), -np.ones(2))]
    apart = [(np.array([each]), np.array([-4.0])) for each in (3.0, 5.0)]
    draw_lines(axes[0, 0], [Line("NSES", "#0077bb", runs), Line("NSLC", "#33bbee", apart)])
    ((points,),) = [drawn(axes[0, 0], "#0077bb", 2.0)]
    assert points[0].tolist() == [2.0, -3.0]
    ((points,),) = [drawn(axes[0, 0], "#33bbee", 2.0)]
    assert len(points) == 0


def test_each_label_is_once_in_the_legend():
    lines = [Line("NSES", "red", []), Line("NSLC", "blue", [], "--"), Line("NSES", "red", [])]
    handles = legend_handles(lines)
    assert [handle.get_label() for handle in handles] == ["NSES", "NSLC"]
    assert [handle.get_linestyle() for handle in handles] == ["-", "--"]


def test_where_nothing_is_to_be_drawn_the_axes_say_so(has_ink):
    figure, axes = make_panels(1, 1)
    draw_lines(axes[0, 0], [])
    assert not axes[0, 0].get_lines()
    assert has_ink(figure, axes[0, 0])
