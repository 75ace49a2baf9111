"""Speed beside peers in the same run: `python -m benchmarks.run` prints Markdown tables."""

from __future__ import annotations

import platform
from importlib import import_module
from typing import Annotated

import typer

from benchmarks.measure import Plan

SECTIONS = {
    "population": "benchmarks.population",
    "python_loop": "benchmarks.python_loop",
    "vector": "benchmarks.vector",
    "control": "benchmarks.control",
    "learn": "benchmarks.training",
    "td3": "benchmarks.off_policy",
    "novelty": "benchmarks.novelty",
    "diversity": "benchmarks.diversity",
    "cold_start": "benchmarks.cold_start",
}
"""The module of each section, imported late: spawned workers import this file again."""
PACKAGES = ("numpy", "numba", "torch", "gymnasium", "stable-baselines3")
PEERS = ("gymnasium-robotics", "mujoco", "dm-control", "shimmy", "kheperax", "jax")


def main(
    only: Annotated[str, typer.Option(help=f"Sections, of {', '.join(SECTIONS)}.")] = "",
    repeats: Annotated[int, typer.Option(min=1, help="Times that each figure is taken.")] = 7,
    quick: Annotated[bool, typer.Option("--quick", help="Tiny workloads, once.")] = False,
) -> None:
    """Measure speed, and print medians with their spread beside the targets."""
    names = only.split(",") if only else list(SECTIONS)
    if unknown := sorted(set(names) - set(SECTIONS)):
        raise typer.BadParameter(f"--only knows {', '.join(SECTIONS)}, not {', '.join(unknown)}.")
    plan = Plan(repeats=1 if quick else repeats, quick=quick)
    print(header(plan), flush=True)
    for name in names:
        for table in import_module(SECTIONS[name]).run(plan):
            print(table.markdown(), flush=True)


def header(plan: Plan) -> str:
    """What the figures were measured on."""
    from curiosity_algos.experiments.description import cpu_model, version
    from curiosity_gym.processors import available_cpus

    python = f"Python {platform.python_version()}"
    found = ((name, version(name)) for name in (*PACKAGES, *PEERS))
    versions = [python, *(f"{name} {number}" for name, number in found if number)]
    lines = [
        "# Speed\n",
        f"- CPU: {cpu_model()}, {available_cpus()} cores",
        f"- Versions: {', '.join(versions)}",
        f"- Median of {plan.repeats} interleaved repeats; the spread is the smallest to the "
        "largest; ratios are taken within a repeat\n",
    ]
    if plan.quick:
        lines.insert(1, "**--quick: too short to mean anything.**\n")
    return "\n".join(lines)


if __name__ == "__main__":
    typer.run(main)
