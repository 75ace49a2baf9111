"""Speed beside peers in the same run: `python -m benchmarks.run` prints Markdown tables."""

from __future__ import annotations

import platform
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.measure import Plan
from benchmarks.record import write_section

SECTIONS = {
    "roofline": "benchmarks.roofline",
    "population": "benchmarks.population",
    "scaling": "benchmarks.scaling",
    "python_loop": "benchmarks.python_loop",
    "vector": "benchmarks.vector",
    "control": "benchmarks.control",
    "locomotion": "benchmarks.locomotion",
    "envpool": "benchmarks.beside_envpool",
    "learn": "benchmarks.training",
    "td3": "benchmarks.off_policy",
    "novelty": "benchmarks.novelty",
    "diversity": "benchmarks.diversity",
    "cluster": "benchmarks.cluster",
    "cold_start": "benchmarks.cold_start",
    "whole_run": "benchmarks.whole_run",
    "gpu": "benchmarks.gpu",
}
"""The module of each section, imported late: spawned workers import this file again."""
PACKAGES = ("numpy", "numba", "torch", "gymnasium", "stable-baselines3")
PEERS = (
    *("gymnasium-robotics", "mujoco", "dm-control", "shimmy", "envpool", "kheperax", "jax"),
    "sbx-rl",
)


def main(
    only: Annotated[str, typer.Option(help=f"Sections, of {', '.join(SECTIONS)}.")] = "",
    repeats: Annotated[int, typer.Option(min=1, help="Times that each figure is taken.")] = 7,
    quick: Annotated[bool, typer.Option("--quick", help="Tiny workloads, once.")] = False,
    out: Annotated[Path | None, typer.Option(help="A JSON file to put the sections into.")] = None,
) -> None:
    """Measure speed, and print medians with their spread beside the targets."""
    names = only.split(",") if only else list(SECTIONS)
    if unknown := sorted(set(names) - set(SECTIONS)):
        raise typer.BadParameter(f"--only knows {', '.join(SECTIONS)}, not {', '.join(unknown)}.")
    plan = Plan(repeats=1 if quick else repeats, quick=quick)
    lines = measured_on(plan)
    print("\n".join(["# Speed\n", *lines, ""]), flush=True)
    for name in names:
        tables = import_module(SECTIONS[name]).run(plan)
        for table in tables:
            print(table.markdown(), flush=True)
        if out is not None:
            write_section(out, name, lines, tables)


def measured_on(plan: Plan) -> list[str]:
    """What the figures were measured on, and how: lines of Markdown."""
    from curiosity_algos.experiments.description import cpu_model, version
    from curiosity_gym.processors import available_cpus

    python = f"Python {platform.python_version()}"
    found = ((name, version(name)) for name in (*PACKAGES, *PEERS))
    versions = [python, *(f"{name} {number}" for name, number in found if number)]
    lines = [
        f"- CPU: {cpu_model()}, {available_cpus()} cores",
        f"- Versions: {', '.join(versions)}",
        f"- Median of {plan.repeats} interleaved repeats; the spread is the smallest to the "
        "largest; ratios are taken within a repeat",
    ]
    return ["**--quick: too short to mean anything.**\n", *lines] if plan.quick else lines


if __name__ == "__main__":
    typer.run(main)
