"""The paper's figures as wholes."""

import json
import pathlib

import numpy as np
import pytest

from curiosity_algos.experiments.figures import paper
from curiosity_algos.experiments.figures.paper import TrainedRuns
from curiosity_algos.experiments.figures.plan import BUDGETS, COMPARED, MAZES, Plan
from curiosity_algos.experiments.measures import best_return
from curiosity_algos.experiments.run import Run
from curiosity_algos.experiments.run_folder import RunFolder

RESULT = {"total_timesteps": 0, "n_episodes": 0, "best_return": None, "coverage": {}}
RESULT |= {"first_success_timesteps": None, "seconds": 0.0, "pending_log": {}, "ended": True}


@pytest.fixture
def plan(tmp_path):
    return Plan(tmp_path, BUDGETS["smoke"], "paper", (0, 1))


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


def lines_of(ax, width):
    return [line for line in ax.get_lines() if line.get_linewidth() == width]


def test_lines_are_those_of_the_runs(finished, has_ink):
    figure = paper.draw(2, TrainedRuns(finished))
    assert len(figure.axes) == len(MAZES)
    for ax in figure.axes:
        assert ax.get_xlabel() == "timesteps (millions)\nno reward: CMAME"
        assert has_ink(figure, ax)
    shown = [text.get_text() for text in figure.legends[0].get_texts()]
    assert shown == [name for name in COMPARED if name != "CMAME"]
    assert "interquartile mean of 2 runs" in figure._supxlabel.get_text()
    ax = figure.axes[1]  # US; its runs are numbered from 10 on, two of each algorithm
    ends = [line.get_ydata()[-1] for line in lines_of(ax, 2.0)]
    np.testing.assert_allclose(ends, [0.605, 0.625, 0.645, 0.685])
    runs = [run for run in finished.runs(2) if (run.algorithm, run.env) == ("NSES", MAZES[1])]
    curves = [best_return(Run(run.folder(finished.folder))) for run in runs]
    for line, (timesteps, values) in zip(lines_of(ax, 0.6)[2:4], curves, strict=True):
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
        ends = [line.get_ydata()[-1] for line in lines_of(ax, 2.0)]
        assert ends == pytest.approx([3.0] * len(COMPARED))


def test_a_run_that_is_missing_is_named(finished):
    run = finished.runs(2)[3]
    checkpoint = RunFolder(run.folder(finished.folder)).checkpoint
    (checkpoint / "result.json").write_text(json.dumps(RESULT | {"timesteps": 5}))
    missing = str(pathlib.Path(run.algorithm, run.env, str(run.seed)))
    with pytest.raises(FileNotFoundError, match=rf"^`log_folder` must hold .*{missing}.*$"):
        paper.draw(3, TrainedRuns(finished))


def test_what_was_not_trained_is_named():
    class Untrained:
        def curves(self, series, env, measure):
            curve = (np.array([0.0, 10.0]), np.array([0.0, 0.5]))
            return [] if series.algorithm == "TD3ICM" else [curve] * 3

    for ax in paper.draw(2, Untrained()).axes:
        assert ax.get_xlabel() == "timesteps (millions)\nnot trained: TD3ICM"


def test_final_states_are_those_of_all_seeds(finished):
    rng = np.random.default_rng(0)
    for i, run in enumerate(finished.runs(4)):
        n = 1 + i // 2  # of both seeds
        columns = {"generation": np.arange(n), "timesteps": np.arange(n), "return": np.zeros(n)}
        ends = {"behavior": rng.uniform(0.0, 200.0, (n, 2))}
        RunFolder(run.folder(finished.folder)).add_final_states(1, columns | ends)
    figure = paper.draw(4, TrainedRuns(finished))
    titles = [ax.get_title() for ax in figure.axes[:9]]
    # Three of `finished`, and as many as were added; rows are algorithms.
    numbers = [6 + 2 * (1 + 3 * maze + row) for row in range(3) for maze in range(3)]
    assert titles[0] == "CMAME on Snake, 8 episodes"
    assert [int(title.split(", ")[1].split()[0]) for title in titles] == numbers


def test_there_are_eight(plan):
    with pytest.raises(ValueError, match=r"`figure` must be one of 1, 2, .*7, 8"):
        paper.draw(9, TrainedRuns(plan))
