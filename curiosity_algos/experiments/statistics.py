"""Statistics over few runs with heavy tails: aggregates with intervals, and times to first reward.

Agarwal et al. 2021, "Deep Reinforcement Learning at the Edge of the Statistical Precipice"
(https://arxiv.org/abs/2108.13264; rliable is their library), for all but the times to first reward:
Kaplan & Meier 1958, "Nonparametric Estimation from Incomplete Observations"
(https://doi.org/10.1080/01621459.1958.10501452).

Scores of several tasks are a matrix (runs, tasks), or a list with the runs (1-D) of each task.
Scores of one task are 1-D. Intervals are of 95 %. Bounds of the bootstrap are percentiles of
`N_RESAMPLES` resamples, which draw the runs of every task with replacement. They depend on scores
and `seed` alone. If a task has fewer than `LEAST_RUNS`, the bounds are NaN.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import stats

from curiosity_algos.common.arrays import Float64Array

Seed: TypeAlias = int | np.random.Generator
Statistic: TypeAlias = Callable[[list[Float64Array]], Any]

N_RESAMPLES = 5000
LEAST_RUNS = 3
"""Fewer runs have no interval, as a bootstrap of two gives just the two."""
N_POINTS = 200
"""Points of the mean of curves without a `grid`."""
BATCH = 100  # resamples in memory at once; another number would change the draws


@dataclass(frozen=True)
class Interval:
    """A number and its 95 % interval.

    Attributes:
        estimate: The number.
        low: The lower bound; NaN where a task has fewer than three runs.
        high: The upper bound, likewise.
    """

    estimate: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve and its 95 % intervals, one at each point.

    Attributes:
        x: (n,) timesteps or seconds.
        estimate: (n,) heights.
        low: (n,) lower bounds; NaN where there are fewer than three runs.
        high: (n,) upper bounds, likewise.
    """

    x: Float64Array
    estimate: Float64Array
    low: Float64Array
    high: Float64Array


@dataclass(frozen=True, eq=False)
class Survival:
    """The share of runs without reward over time, and its median.

    Attributes:
        curve: Share of runs still without reward, from time 0 on, until the next point of `x`:
            the times of first rewards and the budgets of other runs.
        median: Time at which at most half of the runs are still without reward, or None.
    """

    curve: Curve
    median: float | None


def interquartile_mean(scores: npt.ArrayLike) -> Any:
    """Mean of the middle half of all runs of all tasks.

    A quarter of the runs, rounded down, is left out at either end. A task with more runs than
    others weighs more.

    Args:
        scores: (runs, tasks), (runs,), or a list with an array (..., runs) for each task.

    Returns:
        The mean; an array (...) of means where the list's arrays have more than one dimension.

    Raises:
        ValueError: A task has no runs, or a score is not finite.
    """
    runs = np.concatenate(_tasks("scores", scores), axis=-1)
    # As scipy's `trim_mean`, whose checks take far longer than the mean of a few runs.
    begin = runs.shape[-1] // 4
    end = runs.shape[-1] - begin
    return np.partition(runs, (begin, end - 1), axis=-1)[..., begin:end].mean(axis=-1)


def stratified_bootstrap(
    scores: npt.ArrayLike, aggregate: Statistic, *, seed: Seed = 0
) -> Interval:
    """Interval of any aggregate of scores.

    Args:
        scores: (runs, tasks), (runs,), or a list of (runs,).
        aggregate: A function such as `interquartile_mean`: takes a list with an array (..., runs)
            for each task, whose leading dimensions are resamples, and returns an array (...).
        seed: Seed of the resamples, or the generator that draws them.

    Raises:
        ValueError: A task has no runs, or a score is not finite.
    """
    return Interval(*_bootstrap(aggregate, _tasks("scores", scores), seed).tolist())


def probability_of_improvement(
    scores_x: npt.ArrayLike, scores_y: npt.ArrayLike, *, seed: Seed = 0
) -> Interval:
    """Probability that a run of X scores higher than a run of Y, averaged over tasks.

    In a task it is the share of pairs that X wins, ties counting one half: the statistic of Mann
    and Whitney over the number of pairs.

    Args:
        scores_x: (runs, tasks), (runs,), or a list of (runs,).
        scores_y: The same tasks in the same order; of any number of runs.
        seed: Seed of the resamples, or the generator that draws them.

    Raises:
        ValueError: X and Y differ in their number of tasks, or a score is missing or not finite.
    """
    x, y = _tasks("scores_x", scores_x), _tasks("scores_y", scores_y)
    if len(x) != len(y):
        raise ValueError(f"`scores_y` must have the {len(x)} tasks of `scores_x`, got {len(y)}.")

    def share_of_wins(tasks: list[Float64Array]) -> Any:
        pairs = zip(tasks[: len(x)], tasks[len(x) :], strict=True)
        return np.mean([_share_of_wins(*pair) for pair in pairs], axis=0)

    return Interval(*_bootstrap(share_of_wins, [*x, *y], seed).tolist())


def _share_of_wins(x: Float64Array, y: Float64Array) -> Any:
    """Share of the pairs of x (..., n) and y (..., m) that x wins, (...)."""
    first, second = x[..., :, None], y[..., None, :]
    return ((first > second) + 0.5 * (first == second)).mean(axis=(-2, -1))


def survival(first_rewards: Iterable[float | None], budgets: npt.ArrayLike) -> Survival:
    """Kaplan-Meier estimate of how long runs go without reward.

    A run without reward is censored: it had none by its budget. Bounds are those of the
    exponential Greenwood formula, which stay within 0 and 1. As long as no run has had a reward,
    both are 1, by convention. Once all have, the lower one is 0 and the upper one that of the point
    before. Bounds of fewer than three runs are NaN.

    Args:
        first_rewards: (runs,) timesteps or seconds of first rewards, above 0; None, NaN or
            infinity where there was none. One later than the run's budget does not count.
        budgets: Timesteps or seconds that runs had, above 0: one number, or one for each run.

    Raises:
        ValueError: There are no runs, or a number is not above 0.
    """
    first = np.array([*first_rewards], dtype=np.float64)  # None becomes NaN
    first[np.isnan(first)] = np.inf
    ends = np.broadcast_to(np.asarray(budgets, dtype=np.float64), first.shape)
    if not len(first) or not (first > 0.0).all():
        raise ValueError("`first_rewards` must hold numbers above 0, or None without reward.")
    if not ((ends > 0.0) & np.isfinite(ends)).all():
        raise ValueError("`budgets` must be finite and above 0.")
    censored = stats.CensoredData.right_censored(np.minimum(first, ends), first > ends)
    share = stats.ecdf(censored).sf
    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):
        bounds = share.confidence_interval(method="log-log")  # NaN where the share is 0 or 1
    heights = [curve.probabilities for curve in (share, bounds.low, bounds.high)]
    estimate, low, high = np.insert(heights, 0, 1.0, axis=1)
    low[estimate == 1.0] = high[estimate == 1.0] = 1.0
    if estimate[-1] == 0.0:
        low[-1], high[-1] = 0.0, high[-2]
    if len(first) < LEAST_RUNS:
        low[:] = high[:] = np.nan
    curve = Curve(np.insert(share.quantiles, 0, 0.0), estimate, low, high)
    is_past = estimate <= 0.5 + 1e-9  # the heights are products, with errors of rounding
    return Survival(curve, float(curve.x[is_past.argmax()]) if is_past.any() else None)


def curve_interval(
    curves: Iterable[tuple[npt.ArrayLike, npt.ArrayLike]],
    grid: npt.ArrayLike | None = None,
    *,
    seed: Seed = 0,
) -> Curve:
    """Interquartile mean over runs of curves whose points differ, at each point of one grid.

    It ends with the shortest run, so that the mean is over the same runs at every point. The
    bootstrap draws whole runs.

    Args:
        curves: For each run `x`, (n,) ends of its generations in timesteps or seconds, ascending,
            at least 0, and `values`, (n,) the value from then on; before the first it is 0.
        grid: (m,) timesteps or seconds, those after the end of the shortest run are left out;
            None: `N_POINTS` from where all runs have begun to that end, if there are any.
        seed: Seed of the resamples, or the generator that draws them.

    Raises:
        ValueError: There are no curves, no point of the grid is before the end of the shortest run,
            or an array is not as described.
    """
    runs = [_points(x, values) for x, values in curves]
    if not runs:
        raise ValueError("`curves` must hold at least one run.")
    begin, end = max(x[0] for x, _ in runs), min(x[-1] for x, _ in runs)
    if grid is None and begin > end:
        return Curve(*np.empty((4, 0)))
    points = np.linspace(begin, end, N_POINTS) if grid is None else _finite("grid", grid)
    points = points[points <= end]
    if not len(points):
        raise ValueError(f"`grid` must begin before the shortest run ends, at {end:g}.")
    # The value of the last generation that ended, 0 before any.
    heights = [np.r_[0.0, values][np.searchsorted(x, points, "right")] for x, values in runs]
    return Curve(points, *_bootstrap(interquartile_mean, [np.stack(heights, axis=-1)], seed))


def _bootstrap(statistic: Statistic, samples: list[Float64Array], seed: Seed) -> Float64Array:
    """Estimate and bounds (3, ...) of a statistic; each sample (..., runs) is resampled alone."""
    estimate = np.asarray(statistic(samples), dtype=np.float64)
    if min(sample.shape[-1] for sample in samples) < LEAST_RUNS:
        nothing = np.full_like(estimate, np.nan)
        return np.stack([estimate, nothing, nothing])
    resampled = stats.bootstrap(
        samples,
        lambda *resamples, axis: statistic(list(resamples)),
        n_resamples=N_RESAMPLES,
        batch=BATCH,
        vectorized=True,
        axis=-1,
        method="percentile",
        random_state=np.random.default_rng(seed),  # `rng` from scipy 1.15 on
    )
    return np.stack([estimate, *resampled.confidence_interval])


def _tasks(name: str, scores: Any) -> list[Float64Array]:
    """The runs (..., runs) of each task."""
    if isinstance(scores, list | tuple) and not all(map(np.isscalar, scores)):
        return [_finite(name, runs) for runs in scores]
    return list(np.atleast_2d(_finite(name, scores).T))


def _points(x: npt.ArrayLike, values: npt.ArrayLike) -> tuple[Float64Array, Float64Array]:
    ends, heights = _finite("x", x), _finite("values", values)
    if ends[0] < 0.0 or (np.diff(ends) < 0.0).any():
        raise ValueError("`x` must ascend from at least 0.")
    if len(ends) != len(heights):
        raise ValueError(f"`values` must be as many as `x`, {len(ends)}, got {len(heights)}.")
    return ends, heights


def _finite(name: str, values: Any) -> Float64Array:
    """An array of at least one dimension and one number."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 0 or array.size == 0 or not np.isfinite(array).all():
        raise ValueError(f"`{name}` must hold finite numbers, at least one.")
    return array
