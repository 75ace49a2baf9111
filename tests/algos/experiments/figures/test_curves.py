"""Curves of runs: what is read of them, and what is drawn."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

from curiosity_algos import MAPElites
from curiosity_algos.experiments import load_final_states, load_progress
from curiosity_algos.experiments.figures.canvas import make_panels
from curiosity_algos.experiments.figures.curves import (
    EPISODES,
    Line,
    best_return,
    coverage,
    draw_lines,
    generation_return,
    in_seconds,
    legend_handles,
)
from curiosity_algos.experiments.run_folder import RunFolder


@pytest.fixture(scope="module")
def runs(make_runs):
    return make_runs(MAPElites)


def test_returns_are_those_of_the_generations(runs):
    states = load_final_states(runs[0])
    assert states["return"].max() > 0.0
    timesteps, best = generation_return(runs[0])
    generations = np.unique(states["generation"])
    assert len(timesteps) == len(best) == len(generations) + 1
    assert (timesteps[0], best[0]) == (0.0, 0.0)
    for i, generation in enumerate(generations, start=1):
        members = states["generation"] == generation
        assert timesteps[i] == states["timesteps"][members][0]
        assert best[i] == states["return"][members].max()
    so_far = best_return(runs[0])
    np.testing.assert_array_equal(so_far[0], timesteps)
    assert so_far[1].tolist() == [max(best[: i + 1]) for i in range(len(best))]
    assert (np.diff(best) < 0.0).any()  # else the two could not be told apart


def test_coverage_is_the_logs(runs):
    timesteps, shares = coverage(runs[0])
    progress = load_progress(runs[0])
    assert timesteps.tolist() == [0.0, *progress["time/total_timesteps"]]
    assert shares.tolist() == [0.0, *progress["coverage/reachable"]]
    seconds = in_seconds(runs[0], timesteps)
    assert seconds.tolist() == [0.0, *progress["time/seconds"]]


def write_run(folder, **columns):
    run = RunFolder(folder)
    run.begin({"algorithm": "TD3ICM", "env": "CuriosityMaze-US-v0", "seed": 0})
    if columns:
        behavior = np.zeros((len(columns["return"]), 2))
        run.add_final_states(0, columns | {"behavior": behavior})
    return folder


def test_an_algorithm_without_generations_counts_56_episodes_as_one(tmp_path):
    n = 2 * EPISODES + 3
    returns = np.random.default_rng(0).random(n)
    run = write_run(
        tmp_path,
        generation=np.zeros(n, dtype=int),
        timesteps=10 * np.arange(1, n + 1),
        **{"return": returns},
    )
    timesteps, best = generation_return(run)
    assert timesteps.tolist() == [0, 560, 1120, 1150]
    assert best.tolist() == [0.0, *(max(returns[i : i + 56]) for i in (0, 56, 112))]
    timesteps, best = best_return(run)  # of every episode
    assert timesteps.tolist() == list(range(0, 1151, 10))
    assert best[7] == returns[:7].max()


def test_returns_below_0_have_never_been_0(tmp_path):
    ones = np.ones(3, dtype=int)
    returns = np.array([-7.0, -9.0, -2.0])
    run = write_run(
        tmp_path, generation=np.cumsum(ones), timesteps=10 * np.cumsum(ones), **{"return": returns}
    )
    assert best_return(run)[1].tolist() == [-7.0, -7.0, -7.0, -2.0]
    assert generation_return(run)[1].tolist() == [-7.0, -7.0, -9.0, -2.0]


def test_a_run_that_has_just_begun_is_at_0(tmp_path):
    run = write_run(tmp_path)
    for measure in (best_return, generation_return, coverage):
        assert [values.tolist() for values in measure(run)] == [[0.0], [0.0]]
    assert in_seconds(run, [0.0]).tolist() == [0.0]


def test_an_environment_without_cells_has_no_coverage(tmp_path):
    run = write_run(tmp_path)
    (run / "progress.csv").write_text("time/total_timesteps,rollout/ep_rew_mean\n10,0.0\n")
    with pytest.raises(ValueError, match="`runs` must be of environments with a coverage"):
        coverage(run)


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
    (band,) = axes[0, 0].collections
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
