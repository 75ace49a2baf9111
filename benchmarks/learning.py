"""Who finds the goal: `python -m benchmarks.learning` prints the tables of the README and the docs.

Every run is one process on one thread; results do not depend on how many run at once.
"""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from statistics import median
from typing import Annotated, Any

import typer

import curiosity_algos
from benchmarks.runs import markdown, run_all
from curiosity_gym.registration import SPECS

ALGORITHMS = (
    "CuriosityES",
    "NSES",
    "NSLC",
    "MAPElites",
    "CMAME",
    "AURORA",
    "CuriosityMAPElites",
    "CanonicalES",
)
ENVS = ("Snake", "US", "Hard")


@dataclass(frozen=True)
class Result:
    """What one run came to."""

    algorithm: str
    env: str
    seed: int
    first_success: int | None
    best_return: float
    coverage: dict[str, float]
    seconds: float


def run(algorithm: str, name: str, seed: int, timesteps: float, settings: dict[str, Any]) -> Result:
    """Train one algorithm, with its defaults where `settings` says nothing else."""
    began = time.process_time()
    make = getattr(curiosity_algos, algorithm)
    model = make(full_id(name), seed=seed, n_threads=1, device="cpu", **settings)
    model.learn(timesteps)
    return Result(
        algorithm,
        name,
        seed,
        model.first_success_timesteps,
        model.best_return,
        model.coverage_shares,
        time.process_time() - began,
    )


def full_id(name: str) -> str:
    """The environment id of a short name such as "Snake" or "Finger"."""
    (env_id,) = (i for i in SPECS if i.startswith("Curiosity") and i.split("-")[1] == name)
    return env_id


def table(results: list[Result]) -> str:
    """Markdown: a row for each algorithm and environment, a value for each seed."""
    keys = list(dict.fromkeys((r.algorithm, r.env) for r in results))
    groups = [[r for r in results if (r.algorithm, r.env) == key] for key in keys]
    shares = list(dict.fromkeys(name for r in results for name in r.coverage))
    columns = [
        "Algorithm",
        "Environment",
        "Found",
        "First reward (M steps)",
        "Best return",
        *(f"Coverage, {name} (%)" for name in shares),
        "CPU seconds a run",
    ]
    return markdown(columns, [_row(group, shares) for group in groups])


def _row(group: list[Result], shares: list[str]) -> list[str]:
    firsts = [r.first_success for r in group]
    columns = [
        ["never" if first is None else _short(first / 1e6, 1) for first in firsts],
        [f"{r.best_return:.2f}" for r in group],
        *([_short(100 * r.coverage[key]) for r in group if key in r.coverage] for key in shares),
    ]
    return [
        group[0].algorithm,
        group[0].env,
        f"{sum(first is not None for first in firsts)} of {len(group)}",
        *(" / ".join(column) for column in columns),
        f"{sum(r.seconds for r in group) / len(group):.0f}",
    ]


def summary(results: list[Result]) -> str:
    """Markdown: a row for each algorithm; how many found the goal, when, and what they covered.

    Timesteps are the median of those that found it, coverage (of reachable cells) that of all.
    """
    envs = list(dict.fromkeys(r.env for r in results))
    rows = []
    for algorithm in dict.fromkeys(r.algorithm for r in results):
        groups = [[r for r in results if (r.algorithm, r.env) == (algorithm, env)] for env in envs]
        rows.append([algorithm, *(_cell(group) for group in groups)])
    return markdown(["Algorithm", *envs], rows)


def _cell(group: list[Result]) -> str:
    firsts = [r.first_success / 1e6 for r in group if r.first_success is not None]
    when = f", {_short(median(firsts), 1)} M" if firsts else ""
    covered = 100 * median(r.coverage.get("reachable", 0.0) for r in group)
    return f"{len(firsts)} of {len(group)}{when}, {_short(covered)} %"


def _short(value: float, digits: int = 0) -> str:
    """With `digits` after the point, or two that count where it is small."""
    return f"{value:.{digits}f}" if value >= 5 / 10**digits else f"{value:.2g}"


def main(
    timesteps: float = 3e7,
    first_seed: int = 0,
    n_seeds: int = 5,
    algorithms: str = ",".join(ALGORITHMS),
    envs: str = ",".join(ENVS),
    settings: Annotated[str, typer.Option(help="Keywords of the algorithms, as JSON.")] = "{}",
    jobs: int = 2,
    out: Path | None = None,
) -> None:
    """Train every algorithm on every environment with every seed, and print the table."""
    seeds = range(first_seed, first_seed + n_seeds)
    same = [timesteps], [json.loads(settings)]
    tasks = list(product(algorithms.split(","), envs.split(","), seeds, *same))
    results = run_all(run, tasks, jobs=jobs, out=out)
    print(table(results))
    print()
    print(summary(results))


if __name__ == "__main__":
    typer.run(main)
