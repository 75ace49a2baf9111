"""Panels, titles and files."""

import pytest
from matplotlib import pyplot as plt
from matplotlib.lines import Line2D
from PIL import Image

from curiosity_algos.experiments.figures.canvas import (
    add_note,
    add_title,
    check_out,
    count_of_runs,
    make_panels,
    save_figure,
    short_name,
)


def test_a_figure_is_nobodys_but_the_callers():
    before = plt.get_fignums()
    figure, axes = make_panels(2, 3, width=1.0, height=2.0)
    assert axes.shape == (2, 3)
    assert tuple(figure.get_size_inches()) == (3.0, 4.8)
    assert plt.get_fignums() == before


def test_title_legend_and_note_are_all_seen():
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


@pytest.mark.parametrize("n", [1, 4, 12])
def test_a_legend_is_no_wider_than_its_figure(n):
    figure, _ = make_panels(1, 1)
    handles = [Line2D([], [], label=f"PPO + apt, n_envs 16, n_steps {i}") for i in range(n)]
    add_title(figure, "Highest", handles)
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert legend.get_window_extent().width <= figure.bbox.width
    assert len(legend.get_texts()) == n


def test_a_file_is_of_the_kind_that_its_name_says(tmp_path):
    figure, _ = make_panels(1, 1)
    for kind, begins in {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}.items():
        save_figure(figure, tmp_path / kind / f"a.{kind}")
        (written,) = (tmp_path / kind).iterdir()
        assert written.read_bytes().startswith(begins)
    assert Image.open(tmp_path / "png" / "a.png").size[0] > 400


def test_other_files_are_refused(tmp_path):
    figure, _ = make_panels(1, 1)
    for refuse in (check_out, lambda path: save_figure(figure, path)):
        with pytest.raises(ValueError, match=r"`out` must be one of \.png, \.pdf, \.svg"):
            refuse(tmp_path / "a.jpg")
    assert not any(tmp_path.iterdir())


def test_titles_are_short():
    names = ["CuriosityMaze-US-v0, layout a/b", "CuriosityControl-BallInCup-v0", "x/Pendulum-v1"]
    assert [short_name(name) for name in names] == ["US, layout a/b", "BallInCup", "Pendulum-v1"]


def test_runs_are_counted_in_words():
    for numbers, words in ([5, 3, 4], "3 to 5 runs"), ([2, 2], "2 runs"), ([1], "1 run"):
        assert count_of_runs(numbers) == words
    assert count_of_runs([]) == "0 runs"
