"""Numbers of each run that claims are judged by."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import TypeAlias

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.ndimage import label
from scipy.spatial.distance import cdist
from scipy.stats import entropy

from benchmarks.paper import COLUMNS, SIZE, Tables
from benchmarks.paper_figures import SIDE
from benchmarks.plan import CONTROL, MAZES
from curiosity_gym.layouts import reachable_cells

Float64 = npt.NDArray[np.float64]
Runs: TypeAlias = pd.Series
"""A number of each run, by algorithm, environment, variant and seed."""

SPENT = "share of the steps"
RUN = ["algorithm", "env", "variant", "seed"]
US = MAZES[1]
N_POLICIES = 50
"""Rewarding policies of a run that are compared where their number would matter."""
N_REGIONS = 20
"""Regions along each side of the projection, between its 1 % and 99 % quantiles."""
DRAWN = ("CMAME", "MAPElites")
"""Whose rewarding policies figure 8 shows beside those of Curiosity-ES."""
RADIUS = 20.0
"""Maze units that are near a goal."""


def _column(name: str, tables: Tables) -> Runs:
    return tables.table("runs").set_index(RUN)[name]


def budget_share(tables: Tables) -> Runs:
    """The share of a run's timesteps by which it had its first reward."""
    return _column("first_success_timesteps", tables) / _column("timesteps", tables)


def spent_share(tables: Tables) -> Runs:
    """A run's timesteps over those that the settings' budget has for a population's."""
    steps = {env: tables.budget.timesteps("NSES", env) for env in (*MAZES, *CONTROL)}
    timesteps = _column("timesteps", tables)
    return timesteps / timesteps.index.get_level_values("env").map(steps)


def _of_curves(measure: Callable[[pd.DataFrame], float], tables: Tables) -> Runs:
    """Of each run's curve a number, NaN where it has none."""
    curves = tables.table("curves")
    return pd.Series({key: measure(curve) for key, curve in curves.groupby(RUN)})


def late_gain(curve: pd.DataFrame) -> float:
    """What the best return rose by in the second half of the time since a first reward."""
    rewarded = curve[curve["best_return"] > 0.0]
    if rewarded.empty:
        return float("nan")
    middle = rewarded["timesteps"].iloc[[0, -1]].mean()
    early = rewarded.loc[rewarded["timesteps"] <= middle, "best_return"]
    return rewarded["best_return"].iloc[-1] - early.iloc[-1]


def late_coverage(curve: pd.DataFrame) -> float:
    """What the coverage rose by in the second half of the steps."""
    coverage = curve["coverage"]
    return coverage.iloc[-1] - coverage.iloc[len(coverage) // 2 - 1]


def decline(curve: pd.DataFrame) -> float:
    """How far the best of the last generations, a tenth of all, are below a best return."""
    best = curve["best_return"].iloc[-1]
    if best <= 0.0:
        return float("nan")
    return best - curve["generation_return"].tail(len(curve) // 10).mean()


def bonus_left(curve: pd.DataFrame) -> float:
    """Mean of the bonus in the second half over that of the first twentieth, if it was logged."""
    bonus = curve["bonus"]
    first = bonus.head(len(curve) // 20).mean()
    return bonus.tail(len(curve) // 2).mean() / first if first else float("nan")


def coverage_lost(tables: Tables) -> Runs:
    """What a run covers more than that of the same seed whose behavior is the whole last state."""
    covered = _column("coverage.reachable", tables)
    whole = {"": "behavior=state", "phi=0.0": "behavior=state,phi=0.0"}
    own = covered[covered.index.get_level_values("variant").isin(whole)]
    with_states = [(a, env, whole[variant], seed) for a, env, variant, seed in own.index]
    return own - covered.reindex(with_states).to_numpy()


def _of_squares(measure: Callable[[str, Float64], float], tables: Tables) -> Runs:
    """Of the counts in the squares of a maze, (y, x)."""
    states = tables.table("final_states")
    return pd.Series(
        {key: measure(key[1], rows[COLUMNS].to_numpy(float)) for key, rows in states.groupby(RUN)}
    )


def evenness(env: str, counts: Float64) -> float:
    """Entropy of the final states over that of equally many in each square one can be in."""
    return entropy(counts.ravel()) / np.log(_is_reachable(env).sum())


def share_near_goal(env: str, counts: Float64) -> float:
    """Share of the final states within `RADIUS` of the goal, and not behind a wall."""
    return counts[_near_goal(env)].sum() / counts.sum()


def middle_of_snake(env: str, counts: Float64) -> float:
    """Density of final states in the middle third of Snake's corridors, over that of all."""
    is_middle = abs(_centers() - SIZE / 2) < SIZE / 6
    places = _is_reachable(env)
    share = places[is_middle].sum() / places.sum()
    return counts[is_middle].sum() / counts.sum() / share


@cache
def _near_goal(env: str) -> npt.NDArray[np.bool_]:
    x, y = gym.make(env).unwrapped.layout.goal
    is_near = np.hypot(_centers()[None] - x, _centers()[:, None] - y) <= RADIUS
    parts, _ = label(is_near & _is_reachable(env))
    return parts == parts[int(y / SIDE), int(x / SIDE)]


@cache
def _is_reachable(env: str) -> npt.NDArray[np.bool_]:
    """Whether a robot can be in each square, (y, x)."""
    return reachable_cells(gym.make(env).unwrapped.layout, len(COLUMNS)).T


def _centers() -> Float64:
    return SIDE * (np.arange(len(COLUMNS)) + 0.5)


def _of_policies(
    measure: Callable[[pd.DataFrame], float], tables: Tables, of_none: float = 0.0
) -> Runs:
    """Of the rewarding policies of runs on US; of runs without one `of_none`."""
    policies = with_regions(tables.table("projection"))
    groups = policies.groupby(["algorithm", "variant", "seed"])
    values = {(name, US, *others): measure(rows) for (name, *others), rows in groups}
    n_policies = _column("n_rewarding", tables)
    return pd.Series(values).reindex(n_policies.index).where(n_policies > 0, of_none)


def with_regions(policies: pd.DataFrame) -> pd.DataFrame:
    """The projected policies, and in which of `N_REGIONS` x `N_REGIONS` regions each is."""
    scores = policies[["x", "y"]]
    low, high = scores.quantile(0.01), scores.quantile(0.99)
    regions = ((scores - low) / (high - low) * N_REGIONS).clip(0, N_REGIONS - 1).astype(int)
    return policies.assign(region=regions["x"] * N_REGIONS + regions["y"])


def share_of_regions(tables: Tables, other: str) -> Runs:
    """The share of another algorithm's regions, of all its runs, that hold a policy of a run."""
    policies = with_regions(tables.table("projection"))
    theirs = set(policies.loc[policies["algorithm"] == other, "region"])
    if not theirs:
        return _column("n_rewarding", tables) * np.nan
    return _of_policies(lambda rows: len(theirs & set(rows["region"])) / len(theirs), tables)


def nearest(rows: pd.DataFrame) -> float:
    """Median distance from a policy of a run to the nearest other one, of `N_POLICIES`."""
    if len(rows) < N_POLICIES:
        return float("nan")
    scores = rows[["x", "y"]].sample(N_POLICIES, random_state=0)
    distances = cdist(scores, scores)
    np.fill_diagonal(distances, np.inf)
    return float(np.median(distances.min(axis=1)))


def routes(rows: pd.DataFrame) -> float:
    """Distinct routes that `N_POLICIES` of a run are expected to take; of fewer, all."""
    return expected_kinds(rows["route"])


def expected_kinds(kinds: pd.Series) -> float:
    """Distinct values that `N_POLICIES` of these are expected to have; of fewer, all."""
    n, drawn = len(kinds), min(N_POLICIES, len(kinds))
    # A kind of k policies is missed if all that are drawn are of the n - k others.
    missed = [
        np.prod([max(0, n - k - i) / (n - i) for i in range(drawn)]) for k in kinds.value_counts()
    ]
    return len(missed) - sum(missed)


def regions(rows: pd.DataFrame) -> float:
    """Regions of the projection that hold a policy of a run."""
    return float(rows["region"].nunique())


def rewarding_regions(rows: pd.DataFrame) -> float:
    """Regions of the projection that hold a policy of a run whose return is .5 or more."""
    return float(rows.loc[rows["return"] >= 0.5, "region"].nunique())


MEASURES: dict[str, Callable[[Tables], Runs]] = {
    "best return": partial(_column, "best_return"),
    "coverage": partial(_column, "coverage.reachable"),
    "rewarding policies": partial(_column, "n_rewarding"),
    "seconds": partial(_column, "seconds"),
    "first reward": partial(_column, "first_success_timesteps"),
    "share of the budget": budget_share,
    SPENT: spent_share,
    "late gain": partial(_of_curves, late_gain),
    "late coverage": partial(_of_curves, late_coverage),
    "coverage lost": coverage_lost,
    "decline": partial(_of_curves, decline),
    "bonus left": partial(_of_curves, bonus_left),
    "evenness": partial(_of_squares, evenness),
    "share near the goal": partial(_of_squares, share_near_goal),
    "density in the middle": partial(_of_squares, middle_of_snake),
    "nearest distance": partial(_of_policies, nearest, of_none=float("nan")),
    f"routes of {N_POLICIES}": partial(_of_policies, routes),
    "regions": partial(_of_policies, regions),
    **{f"share of {name}'s regions": partial(share_of_regions, other=name) for name in DRAWN},
    "regions of .5 or more": partial(_of_policies, rewarding_regions),
}
"""Numbers of each run, by their name in the page."""


@cache
def measured(measure: str, tables: Tables) -> Runs:
    """One of `MEASURES` of all runs."""
    return MEASURES[measure](tables)


def numbers_of(
    tables: Tables, measure: str, algorithm: str, env: str, variant: str = ""
) -> Float64:
    """One of `MEASURES` of each of an algorithm's runs, NaN where a run has none."""
    values, key = measured(measure, tables), (algorithm, env, variant)
    return values[[tuple(each[:3]) == key for each in values.index]].to_numpy(dtype=float)
