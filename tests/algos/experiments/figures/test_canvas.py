"""Panels, titles and files."""

import pytest
from matplotlib import pyplot as plt
from matplotlib.lines import Line2D

from curiosity_algos.experiments.figures.canvas import (
    add_note,
    add_title,
    count_of_runs,
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
