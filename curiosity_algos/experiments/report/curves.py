"""Curves of an environment's runs: coverage, best return, and survival of the first reward."""

from __future__ import annotations

from typing import Any

import numpy as np

from curiosity_algos.experiments.report.arrays import Packed, evenly, pack
from curiosity_algos.experiments.report.collect import Environment, Run
from curiosity_algos.experiments.statistics import Curve, curve_interval, survival

AXES = ("timesteps", "seconds")
METRICS = ("coverage", "best_return")
N_POINTS = 101
"""Of an interquartile mean, from 0 to the end of the longest run."""
MOST_ROWS = 200
"""Of a single run, evenly spaced over its log."""


def curves(environment: Environment) -> list[dict[str, Any]]:
    """Of each label the curves of its runs, and those of all of them together."""
    longest = {axis: max(run.result[axis] for run in environment.runs) for axis in AXES}
    return [_curves(environment.of(label), longest) for label in environment.labels]


def _curves(runs: list[Run], longest: dict[str, float]) -> dict[str, Any]:
    means = {
        metric: {axis: _mean(runs, axis, metric, longest[axis]) for axis in AXES}
        for metric in METRICS
    }
    return {
        "seeds": [_seed(run) for run in runs if len(run.log["timesteps"])],
        "survival": {axis: _survival(runs, axis) for axis in AXES},
        **means,
    }


def _seed(run: Run) -> dict[str, Packed]:
    rows = evenly(len(run.log["timesteps"]), MOST_ROWS)
    return {name: pack(values[rows], "f4") for name, values in run.log.items()}


def _mean(runs: list[Run], axis: str, metric: str, longest: float) -> dict[str, Packed] | None:
    """Interquartile mean while all of the runs have values; None where one has none."""
    points = [(run.log[axis], run.log[metric]) for run in runs]
    if not all(len(values) and np.isfinite(values).all() for _, values in points):
        return None
    begin, end = max(x[0] for x, _ in points), min(x[-1] for x, _ in points)
    grid = np.linspace(0.0, longest, N_POINTS)
    inner = grid[(begin < grid) & (grid < end)]
    return _packed(curve_interval(points, np.unique([begin, *inner, max(begin, end)])))


def _survival(runs: list[Run], axis: str) -> dict[str, Packed]:
    budgets = [float(run.result[axis]) for run in runs]
    curve = survival([_first_reward(run, axis) for run in runs], budgets).curve
    if len(runs) == 1:  # whose interval would be everything
        curve = Curve(curve.x, curve.estimate, curve.low * np.nan, curve.high * np.nan)
    return _packed(_extended(curve, max(budgets)))


def _first_reward(run: Run, axis: str) -> float | None:
    timesteps: float | None = run.result["first_success_timesteps"]
    if timesteps is None or axis == "timesteps":
        return timesteps
    return run.seconds_at(timesteps)


def _extended(curve: Curve, end: float) -> Curve:
    """The curve to the end of the longest run: its last heights hold."""
    heights = (np.append(each, each[-1]) for each in (curve.estimate, curve.low, curve.high))
    return Curve(np.append(curve.x, end), *heights)


def _packed(curve: Curve) -> dict[str, Packed]:
    parts = {"x": curve.x, "y": curve.estimate, "low": curve.low, "high": curve.high}
    return {name: pack(values, "f4") for name, values in parts.items()}
