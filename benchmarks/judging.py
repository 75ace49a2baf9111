"""Whether what is said of algorithms holds of the runs that there are.

That one algorithm is ahead of another holds in an environment if the ranks of their runs would come
to that by chance in at most `LEVEL` of all cases (Mann and Whitney's test, over all permutations;
three runs against three come to no less), and does not hold if the opposite would. That one is as
good as another holds if the 95 % interval of the difference of their means is above minus the
margin. A reward is found if every run finds one, not found if less than half of them do, unless
they had less than `LEAST_SHARE` of the paper's steps. Fewer than three runs say nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.stats import PermutationMethod, mannwhitneyu

from benchmarks.paper import Tables
from benchmarks.plan import Series
from benchmarks.record import read_sections
from benchmarks.run_numbers import Float64, measured
from benchmarks.speed_tables import SPEED_FILE
from curiosity_algos.experiments.canvas import short_name
from curiosity_algos.experiments.statistics import LEAST_RUNS, Interval, stratified_bootstrap

LEVEL = 0.05
"""Chance at which one is ahead of another."""
LEAST_SHARE = 0.01
"""Of the paper's steps: what runs with fewer do not find may come later."""
REPRODUCED, NOT_REPRODUCED, UNKNOWN = "reproduced", "not reproduced", "undecided"


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
    """The number of each of the runs, NaN where it has none; at least `LEAST_RUNS`, or none."""
    values = measured(measure, tables)
    series = Series(algorithm) if isinstance(algorithm, str) else algorithm
    key = (series.algorithm, env, series.variant)
    found = values[[tuple(each[:3]) == key for each in values.index]].to_numpy(dtype=float)
    return found if len(found) >= LEAST_RUNS else np.empty(0)


def _short_of(env: str, *numbers: Float64) -> Verdict | None:
    """The verdict where there are too few runs, or too few of them have a number."""
    if min(map(len, numbers)) < LEAST_RUNS:
        return _not_trained(env)
    n = min(np.isfinite(each).sum() for each in numbers)
    if n < LEAST_RUNS:
        return Verdict(UNKNOWN, f"{short_name(env)}: only {n} run{'' if n == 1 else 's'} with it")
    return None


def _not_trained(env: str) -> Verdict:
    return Verdict(UNKNOWN, f"{short_name(env)} -")


def finds(algorithm: str, *envs: str) -> Judge:
    """That every run finds a reward; not so if less than half of them do."""

    def word(share: float) -> str:
        return REPRODUCED if share == 1.0 else UNKNOWN if share >= 0.5 else NOT_REPRODUCED

    return all_of(*(partial(_found, word, algorithm, env) for env in envs))


def finds_none(algorithm: str, *envs: str) -> Judge:
    """That no run finds a reward; not so if half of them or more do."""

    def word(share: float) -> str:
        return REPRODUCED if share == 0.0 else UNKNOWN if share < 0.5 else NOT_REPRODUCED

    return all_of(*(partial(_found, word, algorithm, env) for env in envs))


def _found(word: Callable[[float], str], algorithm: str, env: str, tables: Tables) -> Verdict:
    """The word for the share of the runs that found a reward."""
    is_found = np.isfinite(_numbers(tables, "first reward", algorithm, env))
    if not len(is_found):
        return _not_trained(env)
    numbers = f"{short_name(env)} {is_found.sum()} of {len(is_found)}"
    spent = _numbers(tables, "share of the paper's steps", algorithm, env).max()
    if is_found.mean() < 0.5 and spent < LEAST_SHARE:
        return Verdict(UNKNOWN, f"{numbers} in {100 * spent:.2g} % of the paper's steps")
    return Verdict(word(float(is_found.mean())), numbers)


def ahead(measure: str, x: str | Series, y: str | Series, *envs: str) -> Judge:
    """That `x` has more than `y` in each environment."""

    def word(first: Float64, second: Float64, difference: Interval) -> str:
        for alternative, found in {"greater": REPRODUCED, "less": NOT_REPRODUCED}.items():
            exact = PermutationMethod(20_000, rng=np.random.default_rng(0))
            if mannwhitneyu(first, second, alternative=alternative, method=exact).pvalue <= LEVEL:
                return found
        return UNKNOWN

    return _in_each(word, measure, x, y, *envs)


def as_good(measure: str, x: str | Series, y: str | Series, margin: float, *envs: str) -> Judge:
    """That `x` has as much as `y` in each environment, or more: up to a margin."""

    def word(first: Float64, second: Float64, difference: Interval) -> str:
        return _reaches(difference, -margin)

    return _in_each(word, measure, x, y, *envs)


def nearly_as_good(measure: str, x: str | Series, y: str | Series, *envs: str) -> Judge:
    """The same up to a tenth of what `y` has, where a margin might be more than all of it."""

    def word(first: Float64, second: Float64, difference: Interval) -> str:
        return _reaches(difference, -0.1 * float(second.mean()))

    return _in_each(word, measure, x, y, *envs)


def _in_each(
    word: Callable[[Float64, Float64, Interval], str],
    measure: str,
    x: str | Series,
    y: str | Series,
    *envs: str,
) -> Judge:
    return all_of(*(partial(_compared, word, measure, x, y, env) for env in envs))


def _compared(
    word: Callable[[Float64, Float64, Interval], str],
    measure: str,
    x: str | Series,
    y: str | Series,
    env: str,
    tables: Tables,
) -> Verdict:
    """The word for the numbers of two algorithms, and the difference of their means."""
    first, second = (_numbers(tables, measure, each, env) for each in (x, y))
    short = _short_of(env, first, second)
    if short is not None:
        return short
    first, second = first[np.isfinite(first)], second[np.isfinite(second)]
    difference = stratified_bootstrap(
        [first, second], lambda runs: runs[0].mean(axis=-1) - runs[1].mean(axis=-1)
    )
    means = f"{first.mean():.3g} against {second.mean():.3g}"
    bounds = f"{difference.low:+.3g} to {difference.high:+.3g}"
    return Verdict(
        word(first, second, difference), f"{short_name(env)}: {measure} {means}, {bounds}"
    )


def _reaches(interval: Interval, limit: float) -> str:
    """Whether a number is at least the limit."""
    if interval.low >= limit:
        return REPRODUCED
    return NOT_REPRODUCED if interval.high < limit else UNKNOWN


def at_least(measure: str, algorithm: str, least: float, *envs: str) -> Judge:
    """That the mean over the runs in each environment is so much or more."""
    return all_of(*(partial(_at_least, measure, algorithm, least, env) for env in envs))


def _at_least(measure: str, algorithm: str, least: float, env: str, tables: Tables) -> Verdict:
    values = _numbers(tables, measure, algorithm, env)
    short = _short_of(env, values)
    if short is not None:
        return short
    mean = stratified_bootstrap(values[np.isfinite(values)], lambda runs: runs[0].mean(axis=-1))
    numbers = f"{measure} {mean.estimate:.3g} ({mean.low:.3g} to {mean.high:.3g})"
    return Verdict(_reaches(mean, least), f"{short_name(env)}: {numbers}")


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
    """That several things are so: a claim does not hold if one of them is not."""

    def judged(tables: Tables) -> Verdict:
        verdicts = [judge(tables) for judge in judges]
        words = {verdict.word for verdict in verdicts}
        word = next(each for each in (NOT_REPRODUCED, UNKNOWN, REPRODUCED) if each in words)
        return Verdict(word, "; ".join(dict.fromkeys(each.numbers for each in verdicts)))

    return judged


def takes_longer(x: str, y: str) -> Judge:
    """That `x` takes longer than `y` for as many generations, each alone on a machine."""

    def judged(tables: Tables) -> Verdict:
        _, (times, _) = read_sections(SPEED_FILE)["whole_run"]
        seconds = {row.name: row.figures[0] for row in times.rows}
        word = REPRODUCED if seconds[x] > seconds[y] else NOT_REPRODUCED
        return Verdict(
            word, f"US: one run of 2.24e8 steps {seconds[x]:.0f} s against {seconds[y]:.0f} s"
        )

    return judged


def not_measured(reason: str) -> Judge:
    """That is not judged, and why."""
    return lambda tables: Verdict(UNKNOWN, reason)
