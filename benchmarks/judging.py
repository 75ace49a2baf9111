"""Whether what is said of algorithms holds of the runs that there are.

A verdict needs `LEAST_RUNS` of each algorithm, and whole budgets. That one algorithm is ahead of
another holds in an environment if the ranks of their runs would come to that by chance in at most
`LEVEL` of all cases (Mann and Whitney's test, two-sided, over all permutations), and does not hold
if they would to the opposite. That one is as good as another holds if the 95 % interval of the
difference of their means is above minus the margin. A reward is found if every run finds one,
whatever its budget, and not found if less than half of them do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.stats import PermutationMethod, mannwhitneyu

from benchmarks.paper import Tables
from benchmarks.plan import Series
from benchmarks.run_numbers import SPENT, Float64, numbers_of
from benchmarks.run_tables import LEAST_RUNS
from curiosity_algos.experiments.canvas import short_name
from curiosity_algos.experiments.statistics import Interval, stratified_bootstrap

LEVEL = 0.05
"""Chance at which one is ahead of another."""
WHOLE = 0.99
"""The share of the steps from which on they count as all: what is not found may come later."""
REPRODUCED, NOT_REPRODUCED, UNKNOWN = "reproduced", "not reproduced", "cannot be told"


class Verdict(NamedTuple):
    """Whether a claim holds.

    Attributes:
        word: `REPRODUCED`, `NOT_REPRODUCED` or `UNKNOWN`.
        numbers: The numbers that decide it.
    """

    word: str
    numbers: str


Judge: TypeAlias = Callable[[Tables], Verdict]


def _numbers(tables: Tables, measure: str, algorithm: str | Series, env: str) -> Float64:
    """The number of each of the runs, NaN where it has none."""
    series = Series(algorithm) if isinstance(algorithm, str) else algorithm
    return numbers_of(tables, measure, series.algorithm, env, series.variant)


def _told(
    tables: Tables,
    measure: str,
    env: str,
    algorithms: Sequence[str | Series],
    word: Callable[..., tuple[str, str]],
) -> Verdict:
    """The word for the numbers of algorithms, unless they have too few runs, or too few steps."""
    runs = [_numbers(tables, measure, each, env) for each in algorithms]
    if not all(map(len, runs)):
        return _not_trained(env)
    spent = min(_numbers(tables, SPENT, each, env).min() for each in algorithms)
    known = [each[np.isfinite(each)] for each in runs]
    n = min(map(len, known))
    means = " against ".join(f"{each.mean():.3g}" for each in known if len(each))
    numbers = f"{short_name(env)}: {measure} {means}" if n else f"{short_name(env)}: {measure} -"
    if n < LEAST_RUNS:
        return Verdict(UNKNOWN, f"{numbers}, {n} run{'' if n == 1 else 's'}")
    if spent < WHOLE:
        return Verdict(UNKNOWN, f"{numbers}, in {100 * spent:.2g} % of the steps")
    if measure == "best return" and not np.concatenate(known).any():
        return Verdict(UNKNOWN, f"{numbers}: no reward")
    found, bounds = word(*known)
    return Verdict(found, f"{numbers}{bounds}")


def _not_trained(env: str) -> Verdict:
    return Verdict(UNKNOWN, f"{short_name(env)} -")


def finds(algorithm: str, *envs: str) -> Judge:
    """That every run finds a reward; not so if less than half of them do."""
    return all_of(*(partial(_found, False, algorithm, env) for env in envs))


def finds_none(algorithm: str, *envs: str) -> Judge:
    """That no run finds a reward; not so if half of them or more do."""
    return all_of(*(partial(_found, True, algorithm, env) for env in envs))


def _found(is_denied: bool, algorithm: str, env: str, tables: Tables) -> Verdict:
    """Whether the runs found a reward, or whether that is rightly denied."""
    is_found = np.isfinite(_numbers(tables, "first reward", algorithm, env))
    if not len(is_found):
        return _not_trained(env)
    share, numbers = is_found.mean(), f"{short_name(env)} {is_found.sum()} of {len(is_found)}"
    spent = _numbers(tables, SPENT, algorithm, env).min()
    if is_denied:
        word = REPRODUCED if share == 0.0 else NOT_REPRODUCED if share >= 0.5 else UNKNOWN
    else:
        word = REPRODUCED if share == 1.0 else NOT_REPRODUCED if share < 0.5 else UNKNOWN
    if len(is_found) < LEAST_RUNS:
        word = UNKNOWN
    elif share < 0.5 and spent < WHOLE:
        return Verdict(UNKNOWN, f"{numbers} in {100 * spent:.2g} % of the steps")
    return Verdict(word, numbers)


def ahead(measure: str, x: str | Series, y: str | Series, *envs: str) -> Judge:
    """That `x` has more than `y` in each environment."""

    def word(first: Float64, second: Float64) -> tuple[str, str]:
        exact = PermutationMethod(20_000, rng=np.random.default_rng(0))
        test = mannwhitneyu(first, second, alternative="two-sided", method=exact)
        is_ahead = test.statistic > len(first) * len(second) / 2
        found = UNKNOWN if test.pvalue > LEVEL else REPRODUCED if is_ahead else NOT_REPRODUCED
        return found, f", p {test.pvalue:.2g}"

    return _in_each(word, measure, [x, y], envs)


def as_good(measure: str, x: str | Series, y: str | Series, margin: float, *envs: str) -> Judge:
    """That `x` has as much as `y` in each environment, or more: up to a margin."""

    def word(first: Float64, second: Float64) -> tuple[str, str]:
        difference = _difference(first, second)
        return _reaches(difference, -margin), _bounds(difference)

    return _in_each(word, measure, [x, y], envs)


def nearly_as_good(measure: str, x: str | Series, y: str | Series, *envs: str) -> Judge:
    """The same up to a tenth of what `y` has, where a margin might be more than all of it."""

    def word(first: Float64, second: Float64) -> tuple[str, str]:
        difference = _difference(first, second)
        return _reaches(difference, -0.1 * float(second.mean())), _bounds(difference)

    return _in_each(word, measure, [x, y], envs)


def at_least(measure: str, algorithm: str, least: float, *envs: str) -> Judge:
    """That the mean over the runs in each environment is so much or more."""

    def word(values: Float64) -> tuple[str, str]:
        mean = stratified_bootstrap(values, lambda runs: runs[0].mean(axis=-1))
        return _reaches(mean, least), f" ({mean.low:.3g} to {mean.high:.3g})"

    return _in_each(word, measure, [algorithm], envs)


def _in_each(
    word: Callable[..., tuple[str, str]],
    measure: str,
    algorithms: Sequence[str | Series],
    envs: Sequence[str],
) -> Judge:
    def judged(env: str) -> Judge:
        return lambda tables: _told(tables, measure, env, algorithms, word)

    return all_of(*map(judged, envs))


def _difference(first: Float64, second: Float64) -> Interval:
    """The difference of means."""
    return stratified_bootstrap(
        [first, second], lambda runs: runs[0].mean(axis=-1) - runs[1].mean(axis=-1)
    )


def _bounds(difference: Interval) -> str:
    return f", {difference.low:+.3g} to {difference.high:+.3g}"


def _reaches(interval: Interval, limit: float) -> str:
    """Whether a number is at least the limit."""
    if interval.low >= limit:
        return REPRODUCED
    return NOT_REPRODUCED if interval.high < limit else UNKNOWN


def opposite(judge: Judge) -> Judge:
    """That something is not so."""
    words = {REPRODUCED: NOT_REPRODUCED, NOT_REPRODUCED: REPRODUCED, UNKNOWN: UNKNOWN}

    def judged(tables: Tables) -> Verdict:
        verdict = judge(tables)
        return Verdict(words[verdict.word], verdict.numbers)

    return judged


def below(measure: str, algorithm: str, limit: float, *envs: str) -> Judge:
    """That the mean over the runs in each environment is less than that."""
    return all_of(*(opposite(at_least(measure, algorithm, limit, env)) for env in envs))


def all_of(*judges: Judge) -> Judge:
    """That several things are so: a claim does not hold if one of them is not.

    Where they differ, each has its own word.
    """

    def judged(tables: Tables) -> Verdict:
        verdicts = list(dict.fromkeys(judge(tables) for judge in judges))
        words = {verdict.word for verdict in verdicts}
        word = next(each for each in (NOT_REPRODUCED, UNKNOWN, REPRODUCED) if each in words)
        said = [
            f"{each.numbers}: {each.word}" if len(words) > 1 else each.numbers for each in verdicts
        ]
        return Verdict(word, "; ".join(said))

    return judged


def not_measured(reason: str) -> Judge:
    """That is not judged, and why."""
    return lambda tables: Verdict(UNKNOWN, reason)
