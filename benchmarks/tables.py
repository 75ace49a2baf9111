"""`python -m benchmarks.tables` writes the tables of the README and the docs from the CSV files.

A table stands in a page between `<!-- table NAME -->` and `<!-- end of table -->`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import typer

from benchmarks import hold, lasting, paper_tables, restored
from benchmarks.measure import markdown
from benchmarks.paper import SETTINGS
from benchmarks.record import read_sections
from benchmarks.results import ENVIRONMENTS, in_order, rank, read_rows, read_runs
from benchmarks.speed_tables import HEADLINES, SPEED_FILE, filled, section, summary_of
from curiosity_algos.experiments.canvas import short_name
from curiosity_algos.experiments.statistics import (
    Interval,
    interquartile_mean,
    probability_of_improvement,
    stratified_bootstrap,
    survival,
)

ROOT = Path(__file__).parents[1]
RESULTS = (
    *("mazes", "variants", "labyrinth", "settings"),
    *("control", "robots", "bonuses", "speed", "speed_of_learning"),
)
PAGES = (
    "README.md",
    "docs/index.md",
    *(f"docs/results/{name}.md" for name in RESULTS),
    *("docs/clusters.md", "docs/robustify.md", "docs/where_it_fails.md"),
    "docs/algorithms/go_explore.md",
    *("docs/paper.md", "docs/paper_claims.md", "docs/paper_today.md"),
)
UNSEEN = "locomotion_long_unseen"
MARKED = re.compile(r"(<!-- table (\S+) -->\n).*?(<!-- end of table -->)", flags=re.DOTALL)


def headline() -> str:
    """Goals found by evolution and by gradients, with curiosity and without, and steps a second."""
    mazes, ppo = read_runs("mazes"), read_runs("ppo")
    (speed,) = filled(HEADLINES[:1])
    rows = [
        [
            "Goals of three mazes found, without knowing positions",
            f"CuriosityES: {_found(mazes, 'CuriosityES')}",
            f"MAP-Elites, which knows position and velocity: {_found(mazes, 'MAPElites')}",
        ],
        [
            "The same by Stable-Baselines3's PPO, with a bonus around its environment",
            f"PPO + APT: {_found(ppo, 'PPO + APT')}",
            f"PPO: {_found(ppo, 'PPO')}",
        ],
        speed[:3],
    ]
    return markdown(["", "Here", "Beside it"], rows)


def _found(runs: pd.DataFrame, algorithm: str) -> str:
    """How many runs found the goal, and the median time of first reward."""
    own = runs[runs["algorithm"] == algorithm]
    firsts, budget = own["first_success_timesteps"], own["timesteps"]
    median = survival(firsts, budget).median
    n_found = f"{firsts.notna().sum()} of {len(own)} runs"
    if median is None:
        return f"{n_found} within {budget.min() / 1e6:.0f} M steps"
    return f"{n_found}, within {median / 1e6:.1f} M steps (median)"


def robots() -> str:
    """In how many runs CuriosityES found a goal among walls, and from how many starts it holds."""
    found = partial(_found_and_held, read_runs("locomotion_long"), read_rows(UNSEEN))
    return (
        "With ten million steps, and without knowing positions, CuriosityES finds a way around the "
        f"U in AntTrap in single episodes of {found('AntTrap')}; for a humanoid it finds one in "
        f"those of {found('HumanoidTrap')}. By the ant's best episode `robustify` trains policies "
        f"that reach the goal from {hold.in_words(read_rows('hold'), 'AntTrap')}, and by the "
        f"humanoid's best one from {hold.in_words(read_rows('hold'), 'HumanoidTrap')}."
    )


def _found_and_held(runs: pd.DataFrame, starts: pd.DataFrame, name: str) -> str:
    """Runs of CuriosityES that found the goal, and the starts that its best policies solve."""
    runs, starts = (
        rows[(rows["algorithm"] == "CuriosityES") & (rows["env"].map(short_name) == name)]
        for rows in (runs, starts)
    )
    (n_starts,) = starts["starts"].unique()
    found = f"{runs['first_success_timesteps'].notna().sum()} of {len(runs)} runs"
    *solved, last = starts["solved"]
    solved = f"{', '.join(map(str, solved))} and {last} of {n_starts} other starts"
    return f"{found}, and the best policies of the {len(starts)} reach it from {solved}"


def summary(runs: pd.DataFrame) -> str:
    """A row for each algorithm: how many found the goal, when, and what they covered.

    The time is Kaplan and Meier's median, which counts runs that found none; the share is the
    interquartile mean over seeds of the reachable cells, with its 95 % interval.
    """
    return _by_environment(runs, _cell)


def _by_environment(
    runs: pd.DataFrame, cell: Callable[[pd.DataFrame], str], head: str = "Algorithm"
) -> str:
    """A row for each algorithm, with a cell of its runs in each environment that it has."""
    envs = sorted(set(runs["env"]), key=rank)
    cells = {key: cell(group) for key, group in runs.groupby(["algorithm", "env"], sort=False)}
    rows = [
        [algorithm, *(cells.get((algorithm, env), "") for env in envs)]
        for algorithm in dict.fromkeys(runs["algorithm"])
    ]
    return markdown([head, *map(short_name, envs)], rows)


def visits(runs: pd.DataFrame) -> str:
    """As `summary`, of the cells that any step has ended in, not episodes alone."""
    return summary(_by_visits(runs))


def _by_visits(runs: pd.DataFrame) -> pd.DataFrame:
    """The runs in order, with what any step has ended in as what they cover."""
    return in_order(runs.assign(**{"coverage.reachable": runs["coverage.visited"]}))


def with_and_without(runs: pd.DataFrame) -> str:
    """As `visits`, of PPO with APT and alone."""
    return visits(runs[runs["algorithm"].isin(["PPO + APT", "PPO"])])


def recipe() -> str:
    """When runs of the recipe found the goal, and how often their last policies come back to it."""
    kept = read_rows("recipe_kept")
    runs = read_runs("recipe").merge(kept, on=["algorithm", "env", "seed"])
    (n_episodes,) = runs["episodes"].unique()
    mazes = runs.sort_values("env", key=lambda envs: envs.map(rank), kind="stable")
    rows = [
        # A maze that was drawn has its name behind the algorithm's.
        [algorithm.partition(", ")[2] or short_name(env), *map(" / ".join, _kept(group))]
        for (algorithm, env), group in mazes.groupby(["algorithm", "env"], sort=False)
    ]
    times = ["First reward (M steps)", "90 of the last 100"]
    heads = [*times, f"Of {n_episodes} episodes, drawn actions", "best actions"]
    return markdown(["Maze", *heads], rows)


def _kept(group: pd.DataFrame) -> list[Iterable[str]]:
    """Of each seed when it found and came back, and how often its last policy comes to the goal."""
    times = [
        ["never" if pd.isna(x) else _short(x / 1e6, 1) for x in group[f"{what}_timesteps"]]
        for what in ("first_success", "reliable")
    ]
    return [*times, group["drawn"].map(str), group["best"].map(str)]


def parts() -> str:
    """As `visits`, of PPO with APT, and with one of the recipe's settings at another value."""
    runs, tried = read_runs("ppo"), read_runs("ppo_parts")
    recipe = runs[(runs["algorithm"] == "PPO + APT") & runs["env"].isin(tried["env"])]
    return visits(pd.concat([recipe, tried], ignore_index=True))


def returns(runs: pd.DataFrame) -> str:
    """Interquartile mean of the best returns of runs, with its 95 % interval."""
    return _by_environment(runs, _return)


def _return(group: pd.DataFrame) -> str:
    found = stratified_bootstrap(group["best_return"].to_numpy(), interquartile_mean)
    return f"{found.estimate:.0f} ({found.low:.0f} to {found.high:.0f})"


def visits_or_returns(runs: pd.DataFrame) -> str:
    """As `visits`, and as `returns` in environments without cells."""

    def cell(group: pd.DataFrame) -> str:
        return _cell(group) if group["coverage.visited"].notna().any() else _return(group)

    return _by_environment(_by_visits(runs), cell)


def _cell(group: pd.DataFrame) -> str:
    firsts = group["first_success_timesteps"]
    budget = group["timesteps"]
    median = survival(firsts, budget).median
    when = f"> {_short(budget.min() / 1e6)} M" if median is None else f"{_short(median / 1e6, 1)} M"
    share = stratified_bootstrap(group["coverage.reachable"].to_numpy(), interquartile_mean)
    return f"{firsts.notna().sum()} of {len(group)}, {when}, {_percent(share)} %"


def _percent(share: Interval) -> str:
    """A share in percent, with its 95 % interval if it has one."""
    estimate, low, high = (_short(100 * each) for each in (share.estimate, share.low, share.high))
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
    shares = [name for name in runs if name.startswith("coverage.")]
    columns = [
        "Algorithm",
        "Environment",
        "First reward (M steps)",
        "Best return",
        *(f"Coverage, {name.removeprefix('coverage.')} (%)" for name in shares),
        "Seconds a run, median",
    ]
    groups = runs.groupby(["algorithm", "env"], sort=False)
    return markdown(columns, [_row(*key, group, shares) for key, group in groups])


def _row(algorithm: str, env: str, group: pd.DataFrame, shares: list[str]) -> list[str]:
    firsts = group["first_success_timesteps"]
    columns = [
        ["never" if pd.isna(first) else _short(first / 1e6, 1) for first in firsts],
        [f"{best:.2f}" for best in group["best_return"]],
        *([_short(100 * share) for share in group[name].dropna()] for name in shares),
    ]
    seconds = f"{group['seconds'].median():.0f}"
    return [algorithm, short_name(env), *(" / ".join(column) for column in columns), seconds]


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
    share = "" if pd.isna(run.coverage) else f" ({_short(100 * run.coverage)})"
    return f"{'never' if pd.isna(first) else _short(first / 1e6, 1)}{share}"


def tries_off_policy(values: pd.DataFrame) -> str:
    """A row for each setting: of each seed what it visited, and where it found the goal, when."""
    settings = ["algorithm", "gradient_steps", "ent_coef", "target_entropy", "other"]
    rows = []
    for names, group in values.fillna({"other": ""}).groupby(settings, sort=False, dropna=False):
        shares = [_short(100 * share) for share in group["visited"]]
        firsts = [_short(first / 1e6, 1) for first in group["first_success_timesteps"].dropna()]
        cells = ["" if pd.isna(name) else str(name) for name in names]
        rows.append([*cells, " / ".join(shares), " / ".join(firsts)])
    head = ["Algorithm", *(f"`{name}`" for name in settings[1:-1]), "Other"]
    return markdown([*head, "Visited (%)", "First reward (M steps)"], rows)


def unseen(values: pd.DataFrame) -> str:
    """A row for each algorithm: of so many starts those that the policy of each seed solves."""
    (n_starts,) = values["starts"].unique()
    head = f"Of {n_starts} starts"
    return _by_environment(values, lambda group: " / ".join(map(str, group["solved"])), head)


def roaming(values: pd.DataFrame, timesteps: int) -> str:
    """A row for each way to move: means over seeds and standard errors after so many steps.

    Shares are of the run that came to most cells, as RAMP's paper has them.
    """
    values = values[values["timesteps"] == timesteps]
    values = values.assign(share=100 * values["xyz"] / values["xyz"].max())
    groups = values.groupby("algorithm")[["xyz", "share", "xy"]].agg(["mean", "sem"])
    digits = {"xyz": 0, "share": 1, "xy": 0}
    rows = [
        [name, *(_with_error(*row[key], digits[key]) for key in digits)]
        for name, row in groups.sort_values(("xyz", "mean"), ascending=False).iterrows()
    ]
    return markdown(["", "Cells of x, y, z", "Share of the best run (%)", "Cells of x, y"], rows)


def _with_error(mean: float, error: float, digits: int) -> str:
    """A mean and its standard error; of one run alone there is none."""
    return f"{mean:,.{digits}f}" + ("" if np.isnan(error) else f" ± {error:,.{digits}f}")


def ramp(values: pd.DataFrame) -> str:
    """The shares that RAMP's paper published, with their standard errors, the highest first."""
    ordered = values.sort_values("mean", ascending=False).itertuples()
    rows = [[each.algorithm, f"{each.mean:g} ± {each.error:g}"] for each in ordered]
    return markdown(["Published", "Share of the best run (%)"], rows)


def doors(values: pd.DataFrame) -> str:
    """A row for each algorithm: when the mean return of each seed is .9, and what it ends at."""
    rows = []
    for (env, algorithm), runs in values.groupby(["env", "algorithm"], sort=False):
        last = runs.groupby("seed")["return"].last()
        solved = runs[runs["return"] >= 0.9].groupby("seed")["frames"].min().reindex(last.index)
        frames = " / ".join("never" if pd.isna(each) else f"{each:,.0f}" for each in solved)
        returns = " / ".join(f"{each:.2f}" for each in last)
        rows.append([env, -last.mean(), [short_name(env), algorithm, frames, returns]])
    head = ["Task", "Algorithm", "Frames to a mean return of .9", "Mean return at the end"]
    return markdown(head, [cells for *_, cells in sorted(rows, key=lambda row: row[:2])])


def counts(values: pd.DataFrame) -> str:
    """The rows as they are."""
    return markdown(list(values), values.astype(str).to_numpy().tolist())


def processors(runs: pd.DataFrame) -> str:
    """What the runs were trained on, in a line."""
    return f"Trained on {', '.join(sorted(set(runs['machine.processor'])))}."


def make_table(
    read: Callable[[str], pd.DataFrame], source: str, table: Callable[[pd.DataFrame], str]
) -> str:
    """A table of what is read from a CSV file."""
    return table(read(source))


OF_RUNS: dict[str, tuple[str, Callable[[pd.DataFrame], str]]] = {
    "mazes-summary": ("mazes", summary),
    "mazes-comparison": ("mazes", comparison),
    "mazes-seeds": ("mazes", every_seed),
    "mazes-processors": ("mazes", processors),
    "mazes-step-summary": ("mazes_step", summary),
    "mazes-step-seeds": ("mazes_step", every_seed),
    "rounding-summary": ("rounding", summary),
    "rounding-seeds": ("rounding", every_seed),
    "labyrinth-summary": ("labyrinth", summary),
    "labyrinth-seeds": ("labyrinth", every_seed),
    "mazes-icm-summary": ("mazes_icm", summary),
    "mazes-icm-seeds": ("mazes_icm", every_seed),
    "control-summary": ("control", summary),
    "control-seeds": ("control", every_seed),
    "control-random-summary": ("control_random", summary),
    "control-strict-summary": ("control_strict", summary),
    "control-strict-seeds": ("control_strict", every_seed),
    "locomotion-summary": ("locomotion", summary),
    "locomotion-seeds": ("locomotion", every_seed),
    "locomotion-long-summary": ("locomotion_long", summary),
    "locomotion-long-seeds": ("locomotion_long", every_seed),
    "locomotion-tries": ("locomotion_tries", every_seed),
    "normalized": ("normalized", returns),
    "ppo-summary": ("ppo", visits),
    "ppo-with-and-without": ("ppo", with_and_without),
    "ppo-seeds": ("ppo", every_seed),
    "sparse-summary": ("sparse", visits_or_returns),
    "off-policy-summary": ("off_policy", visits),
    "off-policy-seeds": ("off_policy", every_seed),
    "td3-summary": ("td3", summary),
    "td3-seeds": ("td3", every_seed),
}
"""Tables of runs: the CSV file, and what is made of it."""
TABLES: dict[str, Callable[[], str]] = {
    **{name: partial(make_table, read_runs, *each) for name, each in OF_RUNS.items()},
    "headline": headline,
    "robots": robots,
    "tries": partial(make_table, read_rows, "tries", tries),
    "off-policy-tries": partial(make_table, read_rows, "off_policy_tries", tries_off_policy),
    "control-baselines": partial(make_table, read_rows, "control_baselines", counts),
    "locomotion-baselines": partial(make_table, read_rows, "locomotion_baselines", counts),
    "ppo-parts": parts,
    "recipe": recipe,
    "minigrid": partial(make_table, read_rows, "minigrid", doors),
    "parity": partial(make_table, read_rows, "parity", counts),
    "roaming": partial(make_table, read_rows, "roaming", partial(roaming, timesteps=1_000_000)),
    "roaming-long": partial(
        make_table, read_rows, "roaming", partial(roaming, timesteps=8_000_000)
    ),
    "ramp": partial(make_table, read_rows, "ramp", ramp),
    "control-random-unseen": partial(make_table, read_rows, "control_random_unseen", unseen),
    "locomotion-long-unseen": partial(make_table, read_rows, UNSEEN, unseen),
    "hold": partial(make_table, read_rows, "hold", hold.table),
    "lasting": partial(make_table, read_rows, "lasting", lasting.table),
    "restored-words": partial(make_table, read_rows, "restored", restored.in_words),
    "restored": partial(make_table, read_rows, "restored", restored.table),
    "summary-of-speed": partial(summary_of, HEADLINES),
    "paper-claims": partial(paper_tables.claims, "paper"),
    "public-claims": partial(paper_tables.claims, "public", "paper"),
    "tuned-claims": partial(paper_tables.claims, "tuned", "public"),
    **{f"{name}-verdicts": partial(paper_tables.verdicts, name) for name in SETTINGS},
    **{f"{name}-diversity": partial(paper_tables.diversity, name) for name in SETTINGS},
    **{
        f"{name}-summary": partial(make_table, paper_tables.of_the_figures, name, summary)
        for name in SETTINGS
    },
    "paper-hours": partial(paper_tables.hours, "paper"),
    "tuned-hours": partial(paper_tables.hours, "tuned"),
    "paper-reasons": partial(make_table, paper_tables.of_reasons, "public", summary),
    **{f"speed-{name}": partial(section, name) for name in read_sections(SPEED_FILE)},
}
"""What makes the table that stands under each name in a page."""


def write_tables(text: str) -> str:
    """A page with every table in it made anew."""

    def make(match: re.Match[str]) -> str:
        return f"{match[1]}\n{TABLES[match[2]]()}\n\n{match[3]}"

    return MARKED.sub(make, text)


def _short(value: float, digits: int = 0) -> str:
    """With `digits` after the point from 10 on, one below, and two that count below 1."""
    if value >= 10:
        return f"{value:.{digits}f}"
    return f"{value:.1f}" if value >= 1 or value == 0 else f"{value:.2g}"


def main() -> None:
    """Write the tables of every page anew."""
    for name in PAGES:
        page = ROOT / name
        page.write_text(write_tables(page.read_text()))


if __name__ == "__main__":
    typer.run(main)
