"""`python -m benchmarks.tables` writes the tables of the README and the docs from the CSV files.

A table stands in a page between `<!-- table NAME -->` and `<!-- end of table -->`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pandas as pd
import typer

from benchmarks import (
    dynamics,
    hold,
    kept,
    kheperax,
    lasting,
    minigrid,
    paper_tables,
    restored,
    roaming,
    run_tables,
    unseen,
)
from benchmarks.learning import MAZES
from benchmarks.measure import markdown
from benchmarks.paper import SETTINGS
from benchmarks.record import read_sections
from benchmarks.results import KEYS, read_rows, read_runs
from benchmarks.speed_tables import HEADLINES, SPEED_FILE, filled, section, summary_of
from curiosity_algos.experiments.canvas import short_name
from curiosity_algos.experiments.statistics import survival

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
    "docs/weight.md",
    *("docs/paper.md", "docs/paper_choices.md", "docs/paper_claims.md", "docs/paper_today.md"),
)
UNSEEN = "locomotion_long_unseen"
MARKED = re.compile(r"(<!-- table (\S+) -->\n).*?(<!-- end of table -->)", flags=re.DOTALL)


def headline() -> str:
    """Goals found by evolution and by gradients, with curiosity and without, and steps a second."""
    mazes, ppo = read_runs("mazes"), read_runs("ppo")
    (speed,) = filled(HEADLINES[:1])
    rows = [
        [
            "Goals of three mazes found by evolution",
            f"CuriosityES, without a behavior: {_found(mazes, 'CuriosityES')}",
            f"with positions as behavior: NSES {_found(mazes, 'NSES')}; "
            f"MAPElites {_found(mazes, 'MAPElites')}",
        ],
        [
            "Goals of these mazes found by Stable-Baselines3's PPO",
            f"with APT, at a weight of 1: {_found(ppo, 'PPO + APT')}",
            f"without a bonus: {_found(ppo, 'PPO')}",
        ],
        [
            "Last policies of PPO that reach these goals in 95 of 100 episodes, after 3 M steps",
            f"with APT at the default weight, and `SettleCallback`: {_kept('recipe')}",
            f"without `SettleCallback`: {_kept('constant')}, too few to tell them apart",
        ],
        speed[:3],
    ]
    return markdown(["", "Here", "Compared with"], rows)


def _found(runs: pd.DataFrame, algorithm: str) -> str:
    """How many runs found the goal, and the median time of first reward."""
    own = runs[runs["algorithm"] == algorithm]
    firsts, budget = own["first_success_timesteps"], own["timesteps"]
    median = survival(firsts, budget).median
    n_found = f"{firsts.notna().sum()} of {len(own)} runs"
    if median is None:
        return f"{n_found} within {budget.min() / 1e6:.0f} M steps"
    return f"{n_found}; median {median / 1e6:.1f} M steps"


def _kept(name: str) -> str:
    """How many last policies reach the goals of the three mazes, with the seeds of both tables."""
    both = read_rows("recipe_kept").merge(read_rows("constant_kept"), on=KEYS)[KEYS]
    rows = read_rows(f"{name}_kept").merge(both[both["env"].isin(MAZES)], on=KEYS)
    return f"{(rows['drawn'] >= 0.95 * rows['episodes']).sum()} of {len(rows)} runs"


def robots() -> str:
    """In how many runs CuriosityES found a goal among walls, and from how many starts it holds."""
    heads = ["Task", "Runs that found the goal", "Best policies of all runs, from unseen starts"]
    heads += ["Policies of `robustify`", "Steps of `robustify` (M)"]
    return markdown(heads, map(_found_and_held, ("AntTrap", "HumanoidTrap")))


def _found_and_held(name: str) -> list[str]:
    runs, starts = (
        rows[(rows["algorithm"] == "CuriosityES") & (rows["env"].map(short_name) == name)]
        for rows in (read_runs("locomotion_long"), read_rows(UNSEEN))
    )
    robust = read_rows("hold").query("task == @name")
    found = f"{runs['first_success_timesteps'].notna().sum()} of {len(runs)}"
    solved = [f"{_each(rows['solved'])} of {rows['starts'].max()}" for rows in (starts, robust)]
    return [name, found, *solved, _each((robust["timesteps"] / 1e6).round(1))]


def _each(values: pd.Series) -> str:
    return " / ".join(map(str, values))


def make_table(
    read: Callable[[str], pd.DataFrame], source: str, table: Callable[[pd.DataFrame], str]
) -> str:
    """A table of what is read from a CSV file."""
    return table(read(source))


OF_RUNS: dict[str, tuple[str, Callable[[pd.DataFrame], str]]] = {
    "mazes-summary": ("mazes", run_tables.summary),
    "mazes-comparison": ("mazes", run_tables.comparison),
    "mazes-seeds": ("mazes", run_tables.every_seed),
    "mazes-processors": ("mazes", run_tables.processors),
    "mazes-step-summary": ("mazes_step", run_tables.summary),
    "mazes-step-seeds": ("mazes_step", run_tables.every_seed),
    "rounding-summary": ("rounding", run_tables.summary),
    "rounding-seeds": ("rounding", run_tables.every_seed),
    "labyrinth-summary": ("labyrinth", run_tables.summary),
    "labyrinth-seeds": ("labyrinth", run_tables.every_seed),
    "mazes-icm-summary": ("mazes_icm", run_tables.summary),
    "mazes-icm-seeds": ("mazes_icm", run_tables.every_seed),
    "control-summary": ("control", run_tables.summary),
    "control-seeds": ("control", run_tables.every_seed),
    "control-random-summary": ("control_random", run_tables.summary),
    "control-strict-summary": ("control_strict", run_tables.summary),
    "control-strict-seeds": ("control_strict", run_tables.every_seed),
    "locomotion-summary": ("locomotion", run_tables.summary),
    "locomotion-seeds": ("locomotion", run_tables.every_seed),
    "locomotion-long-summary": ("locomotion_long", run_tables.summary),
    "locomotion-long-seeds": ("locomotion_long", run_tables.every_seed),
    "locomotion-tries": ("locomotion_tries", run_tables.every_seed),
    "normalized": ("normalized", run_tables.returns),
    "ppo-summary": ("ppo", run_tables.visits),
    "ppo-with-and-without": ("ppo", run_tables.with_and_without),
    "buffer": ("buffer", run_tables.every_seed),
    "ppo-seeds": ("ppo", run_tables.every_seed),
    "sparse-summary": ("sparse", run_tables.visits_or_returns),
    "off-policy-summary": ("off_policy", run_tables.visits),
    "off-policy-seeds": ("off_policy", run_tables.every_seed),
    "td3-summary": ("td3", run_tables.summary),
    "td3-seeds": ("td3", run_tables.every_seed),
}
"""Tables of runs: the CSV file, and what is made of it."""
TABLES: dict[str, Callable[[], str]] = {
    **{name: partial(make_table, read_runs, *each) for name, each in OF_RUNS.items()},
    "headline": headline,
    "robots": robots,
    "tries": partial(make_table, read_rows, "tries", run_tables.tries),
    "off-policy-tries": partial(
        make_table, read_rows, "off_policy_tries", run_tables.tries_off_policy
    ),
    "control-baselines": partial(make_table, read_rows, "control_baselines", run_tables.counts),
    "locomotion-baselines": partial(
        make_table, read_rows, "locomotion_baselines", run_tables.counts
    ),
    "ppo-parts": run_tables.parts,
    "recipe": partial(kept.table, "recipe"),
    "constant": partial(kept.table, "constant"),
    "own-size": partial(kept.table, "own_size"),
    "weights": partial(kept.table, "weights"),
    "minigrid": partial(make_table, read_rows, "minigrid", minigrid.table),
    "parity": partial(make_table, read_rows, "parity", run_tables.counts),
    "roaming": partial(
        make_table, read_rows, "roaming", partial(roaming.table, timesteps=1_000_000)
    ),
    "roaming-long": partial(
        make_table, read_rows, "roaming", partial(roaming.table, timesteps=8_000_000)
    ),
    "ramp": partial(make_table, read_rows, "ramp", roaming.published),
    "control-random-unseen": partial(make_table, read_rows, "control_random_unseen", unseen.table),
    "locomotion-long-unseen": partial(make_table, read_rows, UNSEEN, unseen.table),
    "hold": partial(make_table, read_rows, "hold", hold.table),
    "kheperax": kheperax.table,
    "lasting": partial(make_table, read_rows, "lasting", lasting.table),
    "dynamics": partial(make_table, read_rows, "dynamics", dynamics.table),
    "dynamics-random": partial(make_table, read_rows, "dynamics_random", dynamics.random_table),
    "restored-words": partial(make_table, read_rows, "restored", restored.in_words),
    "restored": partial(make_table, read_rows, "restored", restored.table),
    "restored-robots": partial(make_table, read_rows, "restored", restored.robots_in_words),
    "restored-rooms": partial(make_table, read_rows, "restored", restored.rooms_in_words),
    "summary-of-speed": partial(summary_of, HEADLINES),
    "paper-claims": partial(paper_tables.claims, "paper"),
    "public-claims": partial(paper_tables.claims, "public", "paper"),
    "tuned-claims": partial(paper_tables.claims, "tuned", "public"),
    **{f"{name}-verdicts": partial(paper_tables.verdicts, name) for name in SETTINGS},
    **{f"{name}-diversity": partial(paper_tables.diversity, name) for name in SETTINGS},
    **{
        f"{name}-summary": partial(
            make_table, paper_tables.of_the_figures, name, run_tables.summary
        )
        for name in SETTINGS
    },
    "paper-hours": partial(paper_tables.hours, "paper"),
    "tuned-hours": partial(paper_tables.hours, "tuned"),
    "paper-reasons": partial(make_table, paper_tables.of_reasons, "public", run_tables.summary),
    **{f"speed-{name}": partial(section, name) for name in read_sections(SPEED_FILE)},
}
"""What makes the table that stands under each name in a page."""


def write_tables(text: str) -> str:
    """A page with every table in it made anew."""

    def make(match: re.Match[str]) -> str:
        return f"{match[1]}\n{TABLES[match[2]]()}\n\n{match[3]}"

    return MARKED.sub(make, text)


def main() -> None:
    """Write the tables of every page anew."""
    for name in PAGES:
        page = ROOT / name
        page.write_text(write_tables(page.read_text()))


if __name__ == "__main__":
    typer.run(main)
