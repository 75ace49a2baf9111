"""Environments that this package does not know, on one process and on one a processor."""

from __future__ import annotations

import time
from functools import partial

import gymnasium as gym

from benchmarks.measure import Plan, Row, Table, interleave, ratios
from benchmarks.population import POPULATION_SIZE, random_policies
from curiosity_algos import make_evaluator
from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.evaluation.base import Evaluator
from curiosity_gym.processors import available_cpus

ENVIRONMENTS = ("Pendulum-v1", "Pusher-v5")
"""One whose steps take microseconds, and one with physics."""
UNIT = "steps/s"
ONE, ALL = "one process", "one process a processor"


def run(plan: Plan) -> list[Table]:
    """A table for each environment."""
    return [_table(env_id, plan) for env_id in ENVIRONMENTS[: plan.size(len(ENVIRONMENTS), 1)]]


def _table(env_id: str, plan: Plan) -> Table:
    make = partial(gym.make, env_id, max_episode_steps=plan.size(200, 5))
    n = available_cpus()
    evaluators = {ONE: make_evaluator(make), ALL: make_evaluator(make, n_threads=n)}
    parameters = random_policies(evaluators[ONE])
    for evaluator in evaluators.values():
        evaluator.evaluate(parameters, seed=0)  # the first starts processes and makes environments
    tasks = {name: partial(_rate, each, parameters) for name, each in evaluators.items()}
    figures = interleave(tasks, plan.repeats)
    rows = [Row(what, values, UNIT) for what, values in figures.items()]
    rows.append(Row("the latter over the former", ratios(figures[ALL], figures[ONE]), "x"))
    notes = [f"{POPULATION_SIZE} policies with hidden layers (32, 16) in closed loop."]
    return Table(f"processes: {env_id}", rows, notes)


def _rate(evaluator: Evaluator, parameters: Float32Array) -> float:
    began = time.perf_counter()
    timesteps = evaluator.evaluate(parameters, seed=0).timesteps
    return timesteps / (time.perf_counter() - began)
