"""`learn` from start to end: where its time goes, what its arithmetic needs, and PPO for scale."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import partial
from itertools import count
from typing import Any

from stable_baselines3 import PPO

import curiosity_algos
from benchmarks.measure import (
    Figures,
    Plan,
    Row,
    Stopwatch,
    Table,
    Task,
    interleave,
    ratios,
    seconds,
)
from benchmarks.products import products, products_of_updates
from benchmarks.roofline import products_task
from curiosity_algos import CuriosityES
from curiosity_algos.common.networks import single_torch_thread
from curiosity_gym.compiled import ThreadPool

MAZE = "CuriosityMaze-Hard-v0"
DEFAULT, PAPER = "CuriosityES", "CuriosityES, paper"
TARGETS = {DEFAULT: "<= 1.5", PAPER: "", "NSES": "", "NSLC": "", "MAPElites": ""}
"""Seconds of `learn(1e6)`, by algorithm and preset."""
LOOP, BONUS = ("ask", "evaluate", "tell"), ("score", "remember", "bonus updates")
"""Stages of every algorithm, and of those that train a bonus."""


def run(plan: Plan) -> list[Table]:
    """Seconds of each algorithm, PPO's rate, and the stages of the same runs."""
    timesteps, ppo_timesteps = plan.size(1e6, 1.0), plan.size(4096, 64)
    stages: dict[str, list[dict[str, float]]] = {name: [] for name in TARGETS}
    steps: list[int] = []
    done: dict[str, list[float]] = {name: [] for name in TARGETS}
    updates: dict[str, list[float]] = {DEFAULT: [], PAPER: []}
    seeds = {name: count() for name in TARGETS}

    def learn(name: str) -> float:
        model, by_stage = timed_run(name, timesteps, next(seeds[name]))
        stages[name].append(by_stage)
        if name == DEFAULT:
            steps.append(model.num_timesteps)
        done[name].append(products(model))
        if name in updates:
            updates[name].append(products_of_updates(model))
        return sum(by_stage.values())

    for name in TARGETS:
        timed_run(name, 1.0, 0)  # compiles the kernels
    pool = ThreadPool()
    tasks = {
        **{name: lambda name=name: learn(name) for name in TARGETS},
        "PPO": _ppo_task(ppo_timesteps),
        "products": products_task(plan, pool, pool.n_threads),
    }
    figures = interleave(tasks, plan.repeats)
    rates = ratios(steps, figures[DEFAULT])
    rows = [
        *_times(figures, done, timesteps),
        Row(DEFAULT, rates, "steps/s"),
        Row("Stable-Baselines3's PPO", figures["PPO"], "steps/s"),
        Row("CuriosityES over PPO", ratios(rates, figures["PPO"]), "x"),
        Row(f"matrix products, {pool.n_threads} threads", figures["products"], "GFLOP/s"),
        *_gradient_steps(figures, updates, stages),
    ]
    notes = [
        "Another seed each repeat; machine code loaded before. PPO is another kind of algorithm, "
        "here only for scale; it trains on one torch thread. The roof, and what gradient steps are "
        "held to, is the time that the matrix products of policies, scores and training would take "
        "at the rate of large ones, on all threads."
    ]
    return [Table(f"learn: {MAZE}", rows, notes), _shares(stages)]


def _ppo_task(timesteps: int) -> Task:
    """Timesteps a second of PPO, after a first training."""
    ppo = PPO("MlpPolicy", MAZE, n_steps=min(2048, timesteps), seed=0, device="cpu")

    def learn() -> None:
        # As CuriosityES does: on busy cores torch's default makes PPO tens of times slower.
        with single_torch_thread():
            ppo.learn(timesteps)

    learn()
    return lambda: timesteps / seconds(learn)


def _times(
    figures: Mapping[str, Figures], done: Mapping[str, Figures], timesteps: float
) -> list[Row]:
    """Seconds of each algorithm, and the share that its matrix products would take."""
    return [
        Row(
            f"{name}, learn({timesteps:,.0f})",
            figures[name],
            "s",
            target,
            ratios(ratios(done[name], figures["products"]), figures[name]),
        )
        for name, target in TARGETS.items()
    ]


def _gradient_steps(
    figures: Mapping[str, Figures],
    updates: Mapping[str, Figures],
    stages: Mapping[str, list[dict[str, float]]],
) -> list[Row]:
    """Time of the bonus' training over that of its matrix products."""
    rows = []
    for name, target in {DEFAULT: "", PAPER: "<= 2.5"}.items():
        floors = ratios(updates[name], figures["products"])
        spent = [by_stage["bonus updates"] for by_stage in stages[name]]
        rows.append(
            Row(f"{name}, gradient steps over their products", ratios(spent, floors), "x", target)
        )
    return rows


def _shares(stages: dict[str, list[dict[str, float]]]) -> Table:
    """Of each algorithm's time, by stage."""
    rows = [
        Row(f"{name}, {stage}", [100.0 * run[stage] / sum(run.values()) for run in runs], "%")
        for name, runs in stages.items()
        for stage in (*LOOP, *(BONUS if name in (DEFAULT, PAPER) else ()), "rest")
    ]
    return Table(
        "learn: where the time goes",
        rows,
        ["`rest` is construction, logging, coverage and the loop itself."],
    )


def timed_run(name: str, timesteps: float, seed: int) -> tuple[Any, dict[str, float]]:
    """A trained model, and its seconds by stage; they add up to the whole, construction too."""
    algorithm, _, preset = name.partition(", ")
    cls = getattr(curiosity_algos, algorithm)
    make = partial(cls.from_preset, preset) if preset else cls
    watch = Stopwatch()
    began = time.perf_counter()
    model = make(MAZE, seed=seed)
    watch.wrap(model, "_ask", "ask")
    watch.wrap(model.evaluator, "evaluate", "evaluate")
    watch.wrap(model, "_tell", "tell")
    if isinstance(model, CuriosityES):
        watch.wrap(model._motivation, "score", "score")
        watch.wrap(model._motivation, "_remember", "remember")
        watch.wrap(model._motivation, "update", "bonus updates")
    model.learn(timesteps)
    elapsed = time.perf_counter() - began
    spent = {stage: watch.seconds[stage] for stage in (*LOOP, *BONUS)}
    return model, {**spent, "rest": elapsed - sum(spent.values())}
