"""Statistics over few runs with heavy tails: aggregates with intervals, and times to first reward.

Agarwal et al. 2021, "Deep Reinforcement Learning at the Edge of the Statistical Precipice"
(https://arxiv.org/abs/2108.13264; rliable is their library), for all but the times to first reward:
Kaplan & Meier 1958, "Nonparametric Estimation from Incomplete Observations"
(https://doi.org/10.1080/01621459.1958.10501452).

Scores of several tasks are a matrix (runs, tasks), or a list with the runs (1-D) of each task, of
different lengths if need be. Scores of one task are 1-D. Intervals are of 95 %. Bounds of the
bootstrap are the percentiles of `N_RESAMPLES` resamples, which draw as many runs of every task as
there are, with replacement. They depend on nothing but scores and `seed`. If a task has fewer than
`LEAST_RUNS`, too little is known of how much runs differ: the bounds are NaN.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import stats

from curiosity_algos.common.arrays import Float64Array
from curiosity_gym.validation import check_positive, check_seed

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
        low: Lower bound; NaN where a task has fewer than three runs.
        high: Upper bound, likewise.
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
        low: (n,) lower bounds, NaN where there are fewer than three runs.
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
        curve: Share of runs still without reward, from time 0 on; each height holds until the next
            point of `x`, which are the times of first rewards and the budgets of other runs.
        median: Time at which at most half of the runs are still without reward; None where more
            than half are to the end.
    """

    curve: Curve
    median: float | None


# -- aggregates of scores -------------------------------------------------------------------------


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
            for each task, whose leading dimensions are resamples, and gives an array (...).
        seed: Seed of the resamples, or the generator that draws them.

    Raises:
        ValueError: A task has no runs, a score is not finite, `aggregate` gives another shape, or
            `seed` is not valid.
    """
    tasks = _runs("scores", scores)
    for scored in (tasks, [np.stack([runs, runs]) for runs in tasks]):
        shape = np.shape(aggregate(scored))
        if shape != scored[0].shape[:-1]:
            raise ValueError(f"`aggregate` must reduce the last axis alone, got shape {shape}.")
    return Interval(*_bootstrap(aggregate, tasks, seed).tolist())


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
        ValueError: X and Y have different numbers of tasks, a task has no runs, a score is not
            finite, or `seed` is not valid.
    """
    x, y = _runs("scores_x", scores_x), _runs("scores_y", scores_y)
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


# -- times to first reward ------------------------------------------------------------------------


def survival(
    first_rewards: Iterable[float | None], budgets: float | Sequence[float] | Float64Array
) -> Survival:
    """Kaplan-Meier estimate of how long runs go without reward.

    A run without reward is censored: all that is known is that it had none by its budget. Bounds
    are those of the exponential Greenwood formula, which stay within 0 and 1 and need fewer runs
    than the simple formula. Two cases are beyond the formula. As long as no run has had a reward,
    both bounds are 1, by convention: nothing is known of the spread. Once all have, the lower bound
    is 0 and the upper one that of the point before. Bounds of fewer than three runs are NaN.

    Args:
        first_rewards: (runs,) timesteps or seconds of first rewards, above 0; None, NaN or
            infinity where there was none. One later than the run's budget does not count.
        budgets: Timesteps or seconds that runs had, above 0: one number, or one for each run.

    Raises:
        ValueError: There are no runs, or a number is NaN or not above 0.
    """
    times, has_reward = _censored(first_rewards, budgets)
    share = stats.ecdf(stats.CensoredData.right_censored(times, ~has_reward)).sf
    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):
        bounds = share.confidence_interval(method="log-log")  # NaN where the share is 0 or 1
    heights = [curve.probabilities for curve in (share, bounds.low, bounds.high)]
    estimate, low, high = np.insert(heights, 0, 1.0, axis=1)
    low[estimate == 1.0] = high[estimate == 1.0] = 1.0
    if estimate[-1] == 0.0:
        low[-1], high[-1] = 0.0, high[-2]
    if len(times) < LEAST_RUNS:
        low[:] = high[:] = np.nan
    curve = Curve(np.insert(share.quantiles, 0, 0.0), estimate, low, high)
    is_past = estimate <= 0.5 + 1e-9  # the heights are products, with errors of rounding
    return Survival(curve, float(curve.x[is_past.argmax()]) if is_past.any() else None)


def _censored(first_rewards: Iterable[float | None], budgets: Any) -> tuple[Float64Array, Any]:
    """Time of each run's first reward or else of its end, and whether it had a reward."""
    first = _array("first_rewards", list(first_rewards))  # None becomes NaN
    first = np.where(np.isnan(first), np.inf, first)
    if first.ndim != 1 or not len(first) or not (first > 0.0).all():
        raise ValueError(
            "`first_rewards` must hold a number above 0 for each run, or None without reward."
        )
    ends = _array("budgets", budgets)
    if ends.shape not in {(), first.shape} or not ((ends > 0.0) & np.isfinite(ends)).all():
        raise ValueError("`budgets` must be a finite number above 0, or one for each run.")
    return np.minimum(first, ends), first <= ends


# -- curves over timesteps or seconds -------------------------------------------------------------


def curve_interval(
    curves: Iterable[tuple[npt.ArrayLike, npt.ArrayLike]],
    grid: npt.ArrayLike | None = None,
    *,
    seed: Seed = 0,
) -> Curve:
    """Interquartile mean over runs of curves whose points differ, at each point of one grid.

    It ends with the shortest run: beyond, the mean would be over other runs, those that are left,
    or over values that a run no longer had. The bootstrap draws whole runs.

    Args:
        curves: For each run `x`, (n,) ends of its generations in timesteps or seconds, ascending,
            at least 0, and `values`, (n,) the value from then on; before the first it is 0.
        grid: (m,) timesteps or seconds, of which those after the end of the shortest run are left
            out; None: `N_POINTS`, evenly from where all runs have begun to that end, and none where
            a run begins later.
        seed: Seed of the resamples, or the generator that draws them.

    Raises:
        ValueError: There are no curves, no point of the grid is before the end of the shortest run,
            `seed` is not valid, an array is empty or not finite, `x` does not ascend from at least
            0, or `values` are not as many.
    """
    runs = [_points(x, values) for x, values in curves]
    if not runs:
        raise ValueError("`curves` must hold at least one run.")
    begin, end = max(x[0] for x, _ in runs), min(x[-1] for x, _ in runs)
    if grid is None and begin > end:
        return Curve(*np.empty((4, 0)))
    points = np.linspace(begin, end, N_POINTS) if grid is None else _vector("grid", grid)
    points = points[points <= end]
    if not len(points):
        raise ValueError(f"`grid` must begin before the shortest run ends, at {end:g}.")
    # The value of the last generation that ended, 0 before any.
    heights = [np.r_[0.0, values][np.searchsorted(x, points, "right")] for x, values in runs]
    return Curve(points, *_bootstrap(interquartile_mean, [np.stack(heights, axis=-1)], seed))


def area_under_curve(x: npt.ArrayLike, values: npt.ArrayLike, budget: float) -> float:
    """Mean height of a run's coverage from 0 to its budget.

    The curve is 0 before its first point, and stays at its last value to the end.
    What comes after the budget does not count.

    Args:
        x: (n,) timesteps or seconds at which generations ended, ascending, at least 0.
        values: (n,) shares, 0 to 1.
        budget: Timesteps or seconds.

    Returns:
        A share, 0 to 1.

    Raises:
        ValueError: An array is empty or not finite, `x` does not ascend from at least 0, `values`
            are not as many or no shares, or `budget` is not above 0.
    """
    check_positive(budget=budget)
    ends, shares = _points(x, values)
    if shares.min() < 0.0 or shares.max() > 1.0:
        raise ValueError("`values` must be shares from 0 to 1.")
    widths = np.diff(np.minimum(ends, budget), append=budget)
    return min(1.0, float(shares @ widths) / budget)  # rounding alone would come to more


# -- what they share ------------------------------------------------------------------------------


def _bootstrap(statistic: Statistic, samples: list[Float64Array], seed: Seed) -> Float64Array:
    """Estimate and bounds (3, ...) of a statistic; each sample (..., runs) is resampled alone."""
    if not isinstance(seed, np.random.Generator):
        check_seed(seed)
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


def _runs(name: str, scores: Any) -> list[Float64Array]:
    """The runs (runs,) of each task."""
    return [_vector(name, runs) for runs in _tasks(name, scores)]


def _tasks(name: str, scores: Any) -> list[Float64Array]:
    """The runs (..., runs) of each task."""
    if isinstance(scores, list | tuple) and not all(map(np.isscalar, scores)):
        return [_finite(name, runs) for runs in scores]
    matrix = _finite(name, scores)
    if matrix.ndim > 2:
        raise ValueError(f"`{name}` must be (runs, tasks) or (runs,), got {matrix.shape}.")
    return list(np.atleast_2d(matrix.T))


def _points(x: npt.ArrayLike, values: npt.ArrayLike) -> tuple[Float64Array, Float64Array]:
    ends, heights = _vector("x", x), _vector("values", values)
    if ends[0] < 0.0 or (np.diff(ends) < 0.0).any():
        raise ValueError("`x` must ascend from at least 0.")
    if len(ends) != len(heights):
        raise ValueError(f"`values` must be as many as `x`, {len(ends)}, got {len(heights)}.")
    return ends, heights


def _vector(name: str, values: Any) -> Float64Array:
    array = _finite(name, values)
    if array.ndim > 1:
        raise ValueError(f"`{name}` must have one dimension, got shape {array.shape}.")
    return array


def _finite(name: str, values: Any) -> Float64Array:
    """An array of at least one dimension and one number."""
    array = _array(name, values)
    if array.ndim == 0 or array.size == 0 or not np.isfinite(array).all():
        raise ValueError(f"`{name}` must hold finite numbers, at least one.")
    return array


def _array(name: str, values: Any) -> Float64Array:
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"`{name}` must hold numbers alone ({error}).") from error
