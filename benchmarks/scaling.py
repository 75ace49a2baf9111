"""How a population's evaluation scales: threads, individuals, beams and walls."""

from __future__ import annotations

import math
import time

import gymnasium as gym
import numpy as np

from benchmarks.measure import Plan, Row, Table, Task, interleave, ratios
from benchmarks.population import (
    DEVIATION,
    HIDDEN,
    N_BEAMS,
    POPULATION_SIZE,
    ROOF,
    UNIT,
    of_roof,
    roof_tasks,
)
from curiosity_algos import make_evaluator
from curiosity_gym import MazeLayout
from curiosity_gym.processors import available_cpus

MAZE = "CuriosityMaze-Hard-v0"
POPULATIONS = (7, 56, 560, 10_000)
BEAMS = (8, 32, 128)
WALLS = (10, 100, 1000)
MODELLED = (4, 8, 16, 32, 64)
STEPS = 1_000_000
"""Of a figure, at least: small populations are evaluated several times."""
PITCH = 20.0
"""Between the centers of two pillars, a fifth as wide."""


def run(plan: Plan) -> list[Table]:
    """Threads with a model of more of them; then what an evaluation is made of."""
    return [_threads(plan), _sizes(plan)]


def _threads(plan: Plan) -> Table:
    n_threads = max(2, available_cpus())
    one, all_ = "1 thread", f"{n_threads} threads"
    tasks = {one: _task(plan, n_threads=1), all_: _task(plan, n_threads=n_threads)}
    figures = interleave(tasks | roof_tasks(plan, 1, n_threads), plan.repeats)
    speedups = ratios(figures[all_], figures[one])
    # Amdahl 1967: s + (1 - s) / n of one thread's time, s being what threads do not share.
    serial = [max(0.0, (n_threads / speedup - 1.0) / (n_threads - 1)) for speedup in speedups]
    rows = [
        Row(one, figures[one], UNIT, of_roof=of_roof(figures, one, 1)),
        Row(all_, figures[all_], UNIT, of_roof=of_roof(figures, all_, n_threads)),
        Row(f"{all_} over one", speedups, "x"),
        Row("serial share", [100.0 * share for share in serial], "%"),
    ]
    for n in MODELLED:
        rates = [
            rate / (share + (1.0 - share) / n)
            for rate, share in zip(figures[one], serial, strict=True)
        ]
        rows.append(Row(f"model, {n} threads", rates, UNIT))
    n_bytes = 4 * (4 + N_BEAMS + 2)
    notes = [
        f"{MAZE}, {POPULATION_SIZE} policies. The model is Amdahl's, of the serial share measured, "
        f"on as many cores as threads; it knows no bound of the memory, into which each step "
        f"writes {n_bytes} bytes.",
        ROOF,
    ]
    return Table("scaling: threads", rows, notes)


def _sizes(plan: Plan) -> Table:
    tasks = {
        **{f"population {n:,}": _task(plan, population=plan.size(n, 7)) for n in POPULATIONS},
        **{f"{n} beams": _task(plan, n_beams=n) for n in BEAMS},
        **{f"{n:,} walls": _task(plan, layout=pillars(n)) for n in WALLS},
    }
    n_threads = available_cpus()
    figures = interleave(tasks | roof_tasks(plan, n_threads), plan.repeats)
    rows = []
    for name in tasks:
        n_beams = int(name.split()[0]) if name.endswith("beams") else N_BEAMS
        shares = of_roof(figures, name, n_threads, n_beams)
        rows.append(Row(name, figures[name], UNIT, of_roof=shares))
    notes = [f"All threads; {MAZE} with {N_BEAMS} beams, but for the pillars that are the walls."]
    notes.append(ROOF)
    return Table("scaling: sizes", rows, notes)


def pillars(n: int) -> MazeLayout:
    """A world of n square pillars, row by row, between which the robot can pass."""
    n_columns = math.ceil(math.sqrt(n))
    extent, width = PITCH * (n_columns + 1), PITCH / 5.0
    corners = [
        (PITCH * (1 + i % n_columns) - width / 2.0, PITCH * (1 + i // n_columns) - width / 2.0)
        for i in range(n)
    ]
    walls = np.array([(x, y, width, width) for x, y in corners])
    start, goal = (PITCH / 2.0,) * 2, (extent - PITCH / 2.0,) * 2
    return MazeLayout(f"{n} pillars", extent, extent, start, goal, walls)


def _task(
    plan: Plan,
    *,
    n_threads: int | None = None,
    population: int = POPULATION_SIZE,
    n_beams: int = N_BEAMS,
    layout: MazeLayout | None = None,
) -> Task:
    """Million environment steps a second of an evaluation, its kernels compiled."""
    settings = {"n_beams": n_beams, "horizon": plan.size(2000, 50)}
    if layout is None:
        env = gym.make(MAZE, **settings)
    else:
        env = gym.make("CuriosityMaze-v0", layout=layout, **settings)
    evaluator = make_evaluator(env, {"net_arch": list(HIDDEN)}, n_threads)
    rng = np.random.default_rng(0)
    parameters = rng.normal(0.0, DEVIATION, (population, evaluator.n_parameters))
    evaluator.evaluate(parameters[:1])
    n_evaluations = plan.size(max(1, STEPS // (population * 2000)), 1)

    def rate() -> float:
        began = time.perf_counter()
        steps = sum(evaluator.play(parameters, 0, {}).timesteps for _ in range(n_evaluations))
        return 1e-6 * steps / (time.perf_counter() - began)

    return rate
