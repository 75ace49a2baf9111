"""Tables of runs: what each algorithm came to in each environment."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from benchmarks.measure import markdown
from benchmarks.plan import MAZES
from benchmarks.results import ENVIRONMENTS, in_order, rank, read_runs
from curiosity_algos.experiments.canvas import short_name
from curiosity_algos.experiments.statistics import (
    Interval,
    interquartile_mean,
    probability_of_improvement,
    stratified_bootstrap,
    survival,
)

MOST_COLUMNS = 6
"""Of a table, so that it fits on a page."""


def summary(runs: pd.DataFrame) -> str:
    """A row for each algorithm: how many found the goal, when, and what they covered.

    The time is Kaplan and Meier's median, which counts runs that found none; the share is the
    interquartile mean over seeds of the reachable cells, with its 95 % interval.
    """
    return by_environment(runs, _cell)


def by_environment(
    runs: pd.DataFrame, cell: Callable[[pd.DataFrame], str], head: str = "Algorithm"
) -> str:
    """A row for each algorithm, with a cell of its runs in each environment that it has.

    Where a table would have more columns than a page is wide, mazes have one of their own.
    """
    envs = sorted(set(runs["env"]), key=rank)
    cells = {key: cell(group) for key, group in runs.groupby(["algorithm", "env"], sort=False)}
    mazes = [env for env in envs if env in MAZES]
    parts = [envs] if len(envs) < MOST_COLUMNS else [mazes, envs[len(mazes) :]]
    tables = []
    for part in filter(None, parts):
        rows = [
            [algorithm, *(cells.get((algorithm, env), "") for env in part)]
            for algorithm in dict.fromkeys(runs["algorithm"])
        ]
        filled = [row for row in rows if any(row[1:])]
        tables.append(markdown([head, *map(short_name, part)], filled))
    return "\n\n".join(tables)


def visits(runs: pd.DataFrame) -> str:
    """As `summary`, of the cells that any step has ended in, not episodes alone."""
    return summary(_by_visits(runs))


def _by_visits(runs: pd.DataFrame) -> pd.DataFrame:
    """The runs in order, with what any step has ended in as what they cover."""
    return in_order(runs.assign(**{"coverage.reachable": runs["coverage.visited"]}))


def with_and_without(runs: pd.DataFrame) -> str:
    """As `visits`, of PPO with APT and alone."""
    return visits(runs[runs["algorithm"].isin(["PPO + APT", "PPO"])])


def parts() -> str:
    """As `visits`, of PPO with APT, and with one of the recipe's settings at another value."""
    runs, tried = read_runs("ppo"), read_runs("ppo_parts")
    recipe = runs[(runs["algorithm"] == "PPO + APT") & runs["env"].isin(tried["env"])]
    return visits(pd.concat([recipe, tried], ignore_index=True))


def returns(runs: pd.DataFrame) -> str:
    """Interquartile mean of the best returns of runs, with its 95 % interval."""
    return by_environment(runs, _return)


def _return(group: pd.DataFrame) -> str:
    return of_runs(group["best_return"].to_numpy(), "{:.0f}".format)


def visits_or_returns(runs: pd.DataFrame) -> str:
    """As `visits`, and as `returns` in environments without cells."""

    def cell(group: pd.DataFrame) -> str:
        return _cell(group) if group["coverage.visited"].notna().any() else _return(group)

    return by_environment(_by_visits(runs), cell)


def _cell(group: pd.DataFrame) -> str:
    firsts = group["first_success_timesteps"]
    budget = group["timesteps"]
    median = survival(firsts, budget).median
    when = f"> {short(budget.min() / 1e6)} M" if median is None else f"{short(median / 1e6, 1)} M"
    share = of_runs(group["coverage.reachable"].to_numpy(), lambda x: short(100 * x))
    return f"{firsts.notna().sum()} of {len(group)}, {when}, {share} %"


LEAST_RUNS = 5
"""Of three normal scores a bootstrap's interval holds the truth in 73 % of cases, of five in 90."""


def of_runs(values: npt.NDArray[np.float64], said: Callable[[float], str]) -> str:
    """The interquartile mean of runs with its 95 % interval; the range of few, in brackets."""
    mean = stratified_bootstrap(values, interquartile_mean)
    if len(values) == 1:
        return said(mean.estimate)
    if len(values) < LEAST_RUNS:
        return f"{said(mean.estimate)} [{said(values.min())} to {said(values.max())}]"
    return f"{said(mean.estimate)} ({said(mean.low)} to {said(mean.high)})"


def _percent(share: Interval) -> str:
    """A share in percent, with its 95 % interval if it has one."""
    estimate, low, high = (short(100 * each) for each in (share.estimate, share.low, share.high))
    return estimate if np.isnan(share.low) else f"{estimate} ({low} to {high})"


def comparison(runs: pd.DataFrame) -> str:
    """How likely a run of CuriosityES is ahead of one of a search that knows what matters.

    Probabilities of improvement in percent with their 95 % intervals, in each maze and over all.
    """
    envs = sorted(set(runs["env"]), key=ENVIRONMENTS.index)
    # Who finds nothing is as late as the budget.
    sooner = -runs["first_success_timesteps"].fillna(runs["timesteps"])
    scores = {"finds the goal sooner": sooner, "covers more": runs["coverage.reachable"]}
    rows = []
    for (words, score), other in product(scores.items(), ("NSES", "NSLC")):
        of_runs = score.groupby([runs["algorithm"], runs["env"]])
        ours, theirs = (
            [of_runs.get_group((algorithm, env)).to_numpy() for env in envs]
            for algorithm in ("CuriosityES", other)
        )
        each = [probability_of_improvement(*pair) for pair in zip(ours, theirs, strict=True)]
        shares = [*each, probability_of_improvement(ours, theirs)]
        rows.append([words, other, *map(_percent, shares)])
    return markdown(["CuriosityES", "than", *map(short_name, envs), "All"], rows)


def every_seed(runs: pd.DataFrame) -> str:
    """A row for each algorithm and environment, whose values are those of the seeds, in order."""
    # Where the reachable cells are known, the share of all cells says nothing more.
    known = "coverage.reachable" in runs and runs["coverage.reachable"].notna().all()
    left_out = {"coverage.all"} if known else set()
    shares = [name for name in runs if name.startswith("coverage.") and name not in left_out]
    columns = [
        "Environment: algorithm",
        "First reward (M steps)",
        "Best return",
        *(f"Coverage, {name.removeprefix('coverage.')} (%)" for name in shares),
        "Seconds a run, median",
    ]
    rows = [
        _row(*key, group, shares) for key, group in runs.groupby(["algorithm", "env"], sort=False)
    ]
    if len(columns) > MOST_COLUMNS:  # of many shares
        columns, rows = columns[:-1], [row[:-1] for row in rows]
    return markdown(columns, rows)


def _row(algorithm: str, env: str, group: pd.DataFrame, shares: list[str]) -> list[str]:
    firsts = group["first_success_timesteps"]
    columns = [
        ["never" if pd.isna(first) else short(first / 1e6, 1) for first in firsts],
        [f"{best:.2f}" for best in group["best_return"]],
        *([short(100 * share) for share in group[name].dropna()] for name in shares),
    ]
    seconds = f"{group['seconds'].median():.0f}"
    run = f"{short_name(env)}: {algorithm}"
    return [run, *(" / ".join(column) for column in columns), seconds]


def tries(values: pd.DataFrame) -> str:
    """A row for each setting: of each run its first reward in M steps, and its coverage in %."""
    envs = list(dict.fromkeys(values["env"]))
    keys = ["curiosity", "phi", "timesteps"]
    rows = []
    for (curiosity, phi, timesteps), group in values.groupby(keys, sort=False):
        cells = [", ".join(map(_try, group[group["env"] == env].itertuples())) for env in envs]
        rows.append([curiosity, phi, f"{timesteps / 1e6:.0f} M", *cells])
    return markdown(["Curiosity", "`phi`", "Steps", *map(short_name, envs)], rows)


def _try(run: Any) -> str:
    first = run.first_success_timesteps
    share = "" if pd.isna(run.coverage) else f" ({short(100 * run.coverage)})"
    return f"{'never' if pd.isna(first) else short(first / 1e6, 1)}{share}"


def tries_off_policy(values: pd.DataFrame) -> str:
    """A row for each setting: of each seed what it visited, and where it found the goal, when."""
    settings = ["algorithm", "gradient_steps", "ent_coef", "other"]
    values = values.assign(other=values.apply(_others, axis=1))
    rows = []
    for names, group in values.groupby(settings, sort=False, dropna=False):
        shares = [short(100 * share) for share in group["visited"]]
        firsts = [short(first / 1e6, 1) for first in group["first_success_timesteps"].dropna()]
        cells = ["" if pd.isna(name) else str(name) for name in names]
        rows.append([*cells, " / ".join(shares), " / ".join(firsts)])
    head = ["Algorithm", *(f"`{name}`" for name in settings[1:-1]), "Other"]
    return markdown([*head, "Visited (%)", "First reward (M steps)"], rows)


def _others(run: pd.Series) -> str:
    entropy = run["target_entropy"]
    given = "" if pd.isna(entropy) or entropy == "auto" else f"target_entropy={entropy}"
    return ", ".join(filter(None, [given, "" if pd.isna(run["other"]) else run["other"]]))


def counts(values: pd.DataFrame) -> str:
    """The rows as they are."""
    return markdown(list(values), values.astype(str).to_numpy().tolist())


def processors(runs: pd.DataFrame) -> str:
    """What the runs were trained on, in a line."""
    return f"Trained on {', '.join(sorted(set(runs['machine.processor'])))}."


def short(value: float, digits: int = 0) -> str:
    """With `digits` after the point from 10 on, one below, and two that count below 1."""
    if value >= 10:
        return f"{value:.{digits}f}"
    return f"{value:.1f}" if value >= 1 or value == 0 else f"{value:.2g}"
