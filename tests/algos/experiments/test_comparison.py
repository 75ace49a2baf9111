"""Curves of any runs."""

import shutil

import gymnasium as gym
import numpy as np
import pytest
from matplotlib.colors import to_hex

from curiosity_algos import NSES, NSLC, CanonicalES, MAPElites
from curiosity_algos.experiments import SaveRun, load_progress, load_runs
from curiosity_algos.experiments.comparison import compare
from curiosity_algos.experiments.labels import COLORS, FURTHER
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.measures import best_return
from curiosity_algos.experiments.run_folder import RunFolder


@pytest.fixture(scope="module")
def runs(make_runs):
    return make_runs(MAPElites, seeds=(0, 1, 2))


@pytest.fixture(scope="module")
def lost(make_runs):
    """Runs whose goal is out of reach."""
    return make_runs(NSLC, seeds=(0, 1), goal_radius=2.0, n_parents=2, k=3)


def thick(ax):
    return [line for line in ax.get_lines() if line.get_linewidth() == 2.0]


def labels(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_coverage_of_each_environment(runs, lost, has_ink):
    figure = compare([*runs, *lost])
    ax, other = figure.axes
    assert (ax.get_title(), ax.get_xlabel()) == ("US, goal_radius 91.5", "timesteps (millions)")
    assert (other.get_title(), ax.get_ylabel()) == ("US, goal_radius 2", "coverage (%)")
    assert labels(figure) == ["MAPElites (3 runs)", "NSLC (2 runs)"]
    colors = [to_hex(line.get_color()).upper() for line in [*thick(ax), *thick(other)]]
    assert colors == [COLORS["MAPElites"], COLORS["NSLC"]]
    end = thick(ax)[0].get_xdata()[-1] * 1e6
    logs = [load_progress(run) for run in runs]
    assert end == pytest.approx(min(log["time/total_timesteps"].iloc[-1] for log in logs))
    at_end = [log[log["time/total_timesteps"] <= end + 0.5]["coverage/reachable"] for log in logs]
    expected = np.mean([100.0 * shares.iloc[-1] for shares in at_end])  # of 3 none is left out
    assert thick(ax)[0].get_ydata()[-1] == pytest.approx(expected)
    assert has_ink(figure, ax)


def test_settings_that_differ_are_lines_of_their_own(runs, make_runs):
    other = make_runs(MAPElites, seeds=(0,), sigma=0.9)
    figure = compare([*runs, *other], y="best-return")
    assert labels(figure) == ["MAPElites, sigma 0.3 (3 runs)", "MAPElites, sigma 0.9 (1 run)"]
    lines = thick(figure.axes[0])
    assert [to_hex(line.get_color()).upper() for line in lines] == list(FURTHER[:2])
    assert lines[1].get_ydata()[-1] == best_return(Run(other[0]))[1][-1]


@pytest.mark.parametrize("y", ["coverage", "survival"])
def test_a_seed_counts_once_and_two_runs_have_no_interval(runs, y, tmp_path):
    shutil.copytree(runs[0], tmp_path / "again")
    figure = compare([*runs, tmp_path], y=y)
    assert labels(figure) == ["MAPElites (3 runs)"]
    assert f"that of another run: {tmp_path / 'again'}." in figure.get_supxlabel()
    few = compare(runs[:2], y=y)
    assert "seed" not in few.get_supxlabel()
    for drawn, has_band in ((figure, True), (few, False)):
        band, *_ = drawn.axes[0].collections
        assert bool(band.get_paths()) == has_band


def test_survival_keeps_the_runs_that_found_nothing(runs, lost):
    figure = compare([*runs, *lost], y="survival")
    (found,), (never,) = map(thick, figure.axes)
    firsts = sorted(load_runs(run)["first_success_timesteps"].item() for run in runs)
    assert found.get_xdata().tolist() == [0.0, *np.unique(firsts) / 1e6]
    assert found.get_ydata()[0] == 100.0
    assert found.get_ydata()[-1] == pytest.approx(0.0)
    assert set(never.get_ydata()) == {100.0}
    ends = [load_runs(run)["timesteps"].item() for run in lost]
    assert never.get_xdata()[-1] == max(ends) / 1e6
    assert figure.axes[0].get_ylabel() == "runs without success (%)"


def test_qd_scores_of_each_archive(runs, lost, make_runs):
    without = make_runs(NSES, seeds=(0,), n_parents=2, k=3)
    figure = compare([*runs, *lost, *without], y="qd-score")
    titles = [ax.get_title().replace("\n", " ") for ax in figure.axes]
    grid, unstructured = "SparseGridArchive", "UnstructuredArchive of NSLC"
    assert titles == [f"US, goal_radius 91.5, {grid}", f"US, goal_radius 2, {unstructured}"]
    assert labels(figure) == ["MAPElites (3 runs)", "NSLC (2 runs)"]
    thin = [line for line in figure.axes[0].get_lines() if line.get_linewidth() == 0.6]
    ends = [load_progress(run)["archive/qd_score"].iloc[-1] for run in runs]
    assert [line.get_ydata()[-1] for line in thin] == ends
    assert "have no QD score: NSES." in figure.get_supxlabel()
    with pytest.raises(ValueError, match="`runs` must have a QD score"):
        compare(without, y="qd-score")


def train_on(env_id, folder):
    settings = {"population_size": 4, "n_parents": 2, "policy_kwargs": {"net_arch": [2]}}
    env = gym.make(env_id, max_episode_steps=20)
    CanonicalES(env, seed=0, **settings).learn(100, SaveRun(folder))


def test_survival_is_of_rewards_where_there_is_no_success_and_of_costs_there_is_none(
    runs, tmp_path
):
    for env_id in ("CartPole-v1", "Pendulum-v1"):
        train_on(env_id, tmp_path / env_id)
    figure = compare([tmp_path, *runs], y="survival")
    of_rewards, of_costs, _ = figure.axes
    assert of_rewards.get_ylabel() == "runs without success or reward (%)"
    assert thick(of_rewards)[0].get_ydata()[-1] == 0.0
    assert not thick(of_costs)
    assert [text.get_text() for text in of_costs.texts] == ["none"]


def test_curves_over_seconds(runs):
    figure = compare(runs[:1], x="seconds")
    assert figure.axes[0].get_xlabel() == "seconds"
    progress = load_progress(runs[0])
    (thin,) = [line for line in figure.axes[0].get_lines() if line.get_linewidth() == 0.6]
    assert thin.get_xdata().tolist() == [0.0, *progress["time/seconds"]]
    figure = compare(runs[:1], y="survival", x="seconds")
    first = thick(figure.axes[0])[0].get_xdata()[-1]
    assert 0.0 < first <= progress["time/seconds"].max()


def test_wrong_arguments(tmp_path, runs):
    for axis in ({"y": "cov"}, {"x": "steps"}):
        with pytest.raises(ValueError, match=r"`[xy]` must be one of"):
            compare(runs, **axis)
    with pytest.raises(FileNotFoundError, match="`folders` must hold runs"):
        compare([tmp_path])


def test_runs_that_have_not_begun_are_named(tmp_path, runs):
    RunFolder(tmp_path / "new").begin(
        {"algorithm": "NSES", "env": "CuriosityMaze-US-v0", "seed": 0, "settings": {}}
    )
    with pytest.raises(ValueError, match="`runs` must have a checkpoint with an episode"):
        compare([tmp_path])
    figure = compare([runs[0], tmp_path])
    assert labels(figure) == ["MAPElites (1 run)"]
    assert f"no episode has ended: {tmp_path / 'new'}." in figure.get_supxlabel()
