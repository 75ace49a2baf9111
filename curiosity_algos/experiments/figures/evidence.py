"""The data of figures, which come from the runs of a plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import gymnasium as gym
import numpy as np

from curiosity_algos.experiments.figures.mazes import SIDE, Counts
from curiosity_algos.experiments.figures.plan import Plan, Series
from curiosity_algos.experiments.figures.projection import (
    Projection,
    project_rewarding,
    replay_rewarding,
)
from curiosity_algos.experiments.measures import (
    Measure,
    Points,
    best_return,
    coverage,
    generation_return,
)
from curiosity_algos.experiments.run import Run
from curiosity_gym.maze.plots import count

MEASURES: Mapping[str, Measure] = {
    "best_return": best_return,
    "generation_return": generation_return,
    "coverage": coverage,
}
"""Measures of the paper's curves, by name."""


def count_final_states(run: Run, env: str) -> Counts:
    """Numbers of episodes of a run that ended in the squares of a maze, by y and x."""
    layout = gym.make(env).unwrapped.layout  # type: ignore[attr-defined]  # of a maze
    ends = run.final_states["behavior"].astype(np.float64)
    return count(ends, layout, SIDE)


class Evidence(Protocol):
    """The data of figures: results of several algorithms on several environments."""

    def curves(self, series: Series, env: str, measure: str) -> list[Points]:
        """The curves of all runs, of one of `MEASURES`; empty if none was trained."""

    def final_states(self, series: Series, env: str) -> Counts:
        """Numbers of episodes of all runs that ended in the squares of a maze, by y and x."""

    def projection(self, panel: Sequence[Series], env: str) -> Projection:
        """Rewarding policies of all runs."""


class TrainedRuns:
    """Evidence from the folders of a plan's runs.

    Every method raises FileNotFoundError if a run that it needs is missing, or not finished.

    Args:
        plan: Plan of the trained runs.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan

    def curves(self, series: Series, env: str, measure: str) -> list[Points]:
        """The curves of all runs, of one of `MEASURES`."""
        return [MEASURES[measure](run) for run in self._runs(series, env)]

    def final_states(self, series: Series, env: str) -> Counts:
        """Numbers of episodes of all runs that ended in the squares of a maze, by y and x."""
        counts = [count_final_states(run, env) for run in self._runs(series, env)]
        return np.asarray(np.sum(counts, axis=0))

    def projection(self, panel: Sequence[Series], env: str) -> Projection:
        """Rewarding policies of all runs."""
        return project_rewarding(
            {series.label: list(map(replay_rewarding, self._runs(series, env))) for series in panel}
        )

    def _runs(self, series: Series, env: str) -> list[Run]:
        specs = [self.plan.run(series, env, seed) for seed in self.plan.seeds]
        runs = [Run(spec.folder(self.plan.folder)) for spec in specs]
        for spec, run in zip(specs, runs, strict=True):
            if run.result.get("timesteps", 0) < spec.timesteps:
                raise FileNotFoundError(
                    f"`log_folder` must hold the runs of the figure, {run} is not finished."
                )
        return runs
