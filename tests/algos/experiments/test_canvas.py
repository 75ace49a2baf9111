"""Panels, curves, titles and files."""

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D

from curiosity_algos.experiments.canvas import (
    Line,
    add_note,
    add_title,
    count_of_runs,
    draw_lines,
    legend_handles,
    make_panels,
    save_figure,
    short_name,
)


def test_pyplot_does_not_know_a_figure():
    before = plt.get_fignums()
    figure, axes = make_panels(2, 3, width=1.0, height=2.0)
    assert axes.shape == (2, 3)
    assert tuple(figure.get_size_inches()) == (3.0, 4.8)
    assert plt.get_fignums() == before


def test_title_legend_and_note_do_not_overlap():
    figure, axes = make_panels(1, 2)
    add_title(figure, "Highest", [Line2D([], [], label="NSES"), Line2D([], [], label="NSLC")])
    add_note(figure, "of two seeds")
    (legend,) = figure.legends
    assert legend.get_title().get_text() == "Highest"
    assert [text.get_text() for text in legend.get_texts()] == ["NSES", "NSLC"]
    figure.draw_without_rendering()
    boxes = [legend.get_window_extent(), *(ax.get_tightbbox() for ax in axes.flat)]
    boxes.append(figure._supxlabel.get_window_extent())
    assert not any(one.overlaps(other) for i, one in enumerate(boxes) for other in boxes[i + 1 :])


def test_a_legend_is_no_wider_than_its_figure():
    figure, _ = make_panels(1, 1)
    handles = [Line2D([], [], label=f"PPO + apt, n_envs 16, n_steps {i}") for i in range(12)]
    add_title(figure, "Highest", handles)
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert legend.get_window_extent().width <= figure.bbox.width
    assert len(legend.get_texts()) == 12


def test_a_file_has_the_format_of_its_name(tmp_path):
    figure, _ = make_panels(1, 1)
    for kind, begins in {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}.items():
        save_figure(figure, tmp_path / kind / f"a.{kind}")
        (written,) = (tmp_path / kind).iterdir()
        assert written.read_bytes().startswith(begins)
    with pytest.raises(ValueError, match=r"`out` must be one of \.png, \.pdf, \.svg"):
        save_figure(figure, tmp_path / "a.jpg")
    assert not any(tmp_path.glob("a*"))


def test_texts():
    names = ["CuriosityMaze-US-v0, layout a/b", "CuriosityControl-BallInCup-v0", "x/Pendulum-v1"]
    assert [short_name(name) for name in names] == ["US, layout a/b", "BallInCup", "Pendulum-v1"]
    numbers = {(5, 3, 4): "3 to 5 runs", (2, 2): "2 runs", (1,): "1 run", (): "0 runs"}
    assert {each: count_of_runs(each) for each in numbers} == numbers


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
