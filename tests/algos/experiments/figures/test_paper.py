"""The paper's figures as wholes."""

import json
import pathlib

import numpy as np
import pytest

from curiosity_algos.experiments.figures import paper
from curiosity_algos.experiments.figures.evidence import TrainedRuns
from curiosity_algos.experiments.figures.plan import BUDGETS, COMPARED, MAZES, Plan
from curiosity_algos.experiments.measures import best_return
from curiosity_algos.experiments.run import Run
from curiosity_algos.experiments.run_folder import RunFolder


@pytest.fixture
def plan(tmp_path):
    return Plan(tmp_path, BUDGETS["smoke"], "paper", (0, 1))


RESULT = {"total_timesteps": 0, "n_episodes": 0, "best_return": None, "coverage": {}}
RESULT |= {"first_success_timesteps": None, "seconds": 0.0, "pending_log": {}, "ended": True}


def write(folder, returns, timesteps):
    """A finished run whose generations, of 100 timesteps, had these returns."""
    run = RunFolder(folder)
    run.begin({"algorithm": folder.parts[-3], "env": folder.parts[-2], "seed": 0})
    returns = np.array(returns)
    steps = 100 * np.arange(1, len(returns) + 1)
    columns = {"generation": steps // 100, "timesteps": steps, "return": returns.astype(float)}
    run.add_final_states(0, columns | {"behavior": np.zeros((len(steps), 2))})
    rows = [f"{step},{min(1.0, step / 1e4)}" for step in steps]
    run.progress.write_text("\n".join(["time/total_timesteps,coverage/reachable", *rows, ""]))
    result = json.dumps(RESULT | {"timesteps": timesteps})
    run.commit(timesteps, lambda to: (to / "result.json").write_text(result))


@pytest.fixture
def finished(plan):
    """All the runs on mazes; of CMAME none has found reward."""
    for i, run in enumerate(plan.runs(2)):
        returns = [0.0, 0.0, 0.0] if run.algorithm == "CMAME" else [0.0, 0.5 + i / 100, 0.3]
        write(run.folder(plan.folder), returns, int(run.timesteps))
    return plan


def test_an_algorithm_that_found_nothing_is_named(finished, has_ink):
    figure = paper.draw(2, TrainedRuns(finished))
    assert len(figure.axes) == len(MAZES)
    for ax in figure.axes:
        assert ax.get_xlabel() == "timesteps (millions)\nno reward: CMAME"
        assert has_ink(figure, ax)
    (legend,) = figure.legends
    shown = [text.get_text() for text in legend.get_texts()]
    assert shown == [name for name in COMPARED if name != "CMAME"]
    assert "interquartile mean of 2 runs" in figure._supxlabel.get_text()


def test_the_line_is_that_of_the_runs(finished):
    figure = paper.draw(2, TrainedRuns(finished))
    ax = figure.axes[1]  # US; its runs are numbered from 10 on, two of each algorithm
    thick = [line for line in ax.get_lines() if line.get_linewidth() == 2.0]
    ends = [line.get_ydata()[-1] for line in thick]
    np.testing.assert_allclose(ends, [0.605, 0.625, 0.645, 0.685])
    runs = [run for run in finished.runs(2) if (run.algorithm, run.env) == ("NSES", MAZES[1])]
    curves = [best_return(Run(run.folder(finished.folder))) for run in runs]
    thin = [line for line in ax.get_lines() if line.get_linewidth() == 0.6][2:4]
    for line, (timesteps, values) in zip(thin, curves, strict=True):
        np.testing.assert_allclose(line.get_xdata(), timesteps / 1e6)
        np.testing.assert_array_equal(line.get_ydata(), values)


def test_a_panel_without_reward_says_so(finished, has_ink):
    for run in finished.runs(5):
        write(run.folder(finished.folder), [0.0], int(run.timesteps))
    figure = paper.draw(5, TrainedRuns(finished))
    for ax in figure.axes:
        assert has_ink(figure, ax)
        assert " ".join(ax.get_xlabel().split()).endswith(f"no reward: {', '.join(COMPARED)}")


def test_coverage_is_drawn_of_all(finished):
    figure = paper.draw(3, TrainedRuns(finished))
    assert figure.axes[0].get_ylabel() == "coverage (%)"
    for ax in figure.axes:
        assert ax.get_xlabel() == "timesteps (millions)"
        thick = [line for line in ax.get_lines() if line.get_linewidth() == 2.0]
        assert [line.get_ydata()[-1] for line in thick] == pytest.approx([3.0] * len(COMPARED))


def test_a_run_that_is_missing_is_named(finished):
    run = finished.runs(2)[3]
    checkpoint = RunFolder(run.folder(finished.folder)).checkpoint
    (checkpoint / "result.json").write_text(json.dumps(RESULT | {"timesteps": 5}))
    with pytest.raises(FileNotFoundError) as error:
        paper.draw(3, TrainedRuns(finished))
    (sentence,) = str(error.value).splitlines()
    assert sentence.startswith("`log_folder` must hold the runs of the figure, ")
    assert str(pathlib.Path(run.algorithm, run.env, str(run.seed))) in sentence
    with pytest.raises(FileNotFoundError, match="is not finished"):
        paper.draw(5, TrainedRuns(finished))  # of which there is nothing at all


class Untrained:
    """Evidence without a run of TD3ICM; others stay at nothing for ten steps, then come to .5."""

    seeds = (0, 1, 2)

    def curves(self, series, env, measure):
        curve = (np.array([0.0, 10.0]), np.array([0.0, 0.5]))
        return [] if series.algorithm == "TD3ICM" else [curve] * 3


def test_what_was_not_trained_is_named():
    for ax in paper.draw(2, Untrained()).axes:
        assert ax.get_xlabel() == "timesteps (millions)\nnot trained: TD3ICM"


def test_final_states_are_those_of_all_seeds(finished):
    rng = np.random.default_rng(0)
    for run in finished.runs(4):
        ends = rng.uniform(0.0, 200.0, (4, 2))
        columns = {"generation": np.arange(4), "timesteps": np.arange(4), "return": np.zeros(4)}
        RunFolder(run.folder(finished.folder)).add_final_states(1, columns | {"behavior": ends})
    figure = paper.draw(4, TrainedRuns(finished))
    titles = [ax.get_title() for ax in figure.axes[:9]]
    # Three of `finished` and four new ones, of each of two seeds.
    assert titles[0] == "CMAME on Snake, 14 episodes"
    assert len(set(titles)) == 9
    assert all(title.endswith(", 14 episodes") for title in titles)


def test_there_are_eight(plan):
    assert list(paper.FIGURES) == [1, 2, 3, 4, 5, 6, 7, 8]
    with pytest.raises(ValueError, match="`figure` must be one of 1, 2"):
        paper.draw(9, TrainedRuns(plan))
