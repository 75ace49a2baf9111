"""The path of the best policy of each label."""

from __future__ import annotations

from typing import Any

import numpy as np

from curiosity_algos.experiments.report.arrays import evenly, quantize
from curiosity_algos.experiments.report.collect import Environment, Run
from curiosity_algos.experiments.report.planes import Plane

MOST_POINTS = 2_000
"""Of a path, evenly spaced over its steps."""


def best_run(runs: list[Run]) -> Run | None:
    """The run with the highest return among those that have ended with a trajectory.

    The first of equals.
    """
    ended = [run for run in runs if "behaviors" in run.folder.trajectory()]
    return max(ended, key=lambda run: run.best_return, default=None)


def replays(environment: Environment, plane: Plane) -> list[dict[str, Any] | None]:
    """Of each label the path of its best run, or None where there is none."""
    best = [best_run(environment.of(label)) for label in environment.labels]
    return [None if run is None else _path(run, plane) for run in best]


def _path(run: Run, plane: Plane) -> dict[str, Any]:
    trajectory = run.folder.trajectory()
    points = trajectory["behaviors"]
    rows = evenly(len(points), MOST_POINTS)
    return {
        "seed": run.seed,
        "return": float(np.sum(trajectory["rewards"])),
        "steps": len(points) - 1,
        **{
            name: quantize(points[rows, axis], float(plane.low[axis]), float(plane.high[axis]))
            for axis, name in enumerate("xy")
        },
    }
