"""Who finds the goal: `python -m benchmarks.learning` prints the table of the README and the docs.

Every run is one process on one thread; results do not depend on how many run at once.
"""

from __future__ import annotations

import json
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import typer

import curiosity_algos

ALGORITHMS = ("CuriosityES", "CanonicalES")
MAZES = ("Snake", "US", "Hard")


@dataclass(frozen=True)
class Result:
    """What one run came to."""

    algorithm: str
    maze: str
    seed: int
    first_success: int | None
    best_return: float
    reachable: float
    all_cells: float
    seconds: float


def run(algorithm: str, maze: str, seed: int, timesteps: float, settings: dict[str, Any]) -> Result:
    """Train one algorithm, with its defaults where `settings` says nothing else."""
    began = time.perf_counter()
    env = gym.make(f"CuriosityMaze-{maze}-v0")
    make = getattr(curiosity_algos, algorithm)
    model = make(env, seed=seed, n_threads=1, device="cpu", **settings)
    model.learn(timesteps)
    visited_share = float(env.unwrapped.coverage_grid.reachable.mean() * model.coverage)
    seconds = time.perf_counter() - began
    return Result(
        algorithm,
        maze,
        seed,
        model.first_success_timesteps,
        model.best_return,
        model.coverage,
        visited_share,
        seconds,
    )


def table(results: list[Result]) -> str:
    """Markdown: a row for each algorithm and maze, a value for each seed."""
    lines = [
        "| Algorithm | Maze | Found | First reward (M steps) | Best return "
        "| Coverage of reachable cells (%) | of all cells (%) | Seconds a run |",
        "|---|---|---|---|---|---|---|---|",
    ]
    keys = list(dict.fromkeys((r.algorithm, r.maze) for r in results))
    for algorithm, maze in keys:
        rows = [r for r in results if (r.algorithm, r.maze) == (algorithm, maze)]
        found = [r.first_success for r in rows if r.first_success is not None]
        cells = [
            f"{len(found)} of {len(rows)}",
            " / ".join(
                "never" if (t := r.first_success) is None else f"{t / 1e6:.1f}" for r in rows
            ),
            " / ".join(f"{r.best_return:.2f}" for r in rows),
            " / ".join(f"{100 * r.reachable:.0f}" for r in rows),
            " / ".join(f"{100 * r.all_cells:.0f}" for r in rows),
            f"{sum(r.seconds for r in rows) / len(rows):.0f}",
        ]
        lines.append(f"| {algorithm} | {maze} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main(
    timesteps: float = 3e7,
    first_seed: int = 0,
    n_seeds: int = 5,
    algorithms: str = ",".join(ALGORITHMS),
    mazes: str = ",".join(MAZES),
    settings: Annotated[str, typer.Option(help="Keywords of the algorithms, as JSON.")] = "{}",
    jobs: int = 2,
    out: Path | None = None,
) -> None:
    """Train every algorithm on every maze with every seed, and print the table."""
    seeds = range(first_seed, first_seed + n_seeds)
    tasks = list(product(algorithms.split(","), mazes.split(","), seeds))
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        futures = {pool.submit(run, *task, timesteps, json.loads(settings)): task for task in tasks}
        for done, future in enumerate(as_completed(futures), start=1):
            typer.echo(f"{done} of {len(tasks)}: {future.result()}", err=True)
        results = [future.result() for future in futures]
    if out is not None:
        out.write_text("\n".join(str(asdict(result)) for result in results) + "\n")
    print(table(results))


if __name__ == "__main__":
    typer.run(main)
