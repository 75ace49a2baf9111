"""What Ray costs: bytes and time of a generation beside the local evaluator, and a model."""

from __future__ import annotations

import math
import pickle
from collections.abc import Mapping
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

import gymnasium as gym
import numpy as np

from benchmarks.measure import Plan, Row, Table, Task, interleave, ratios, seconds
from benchmarks.population import POPULATION_SIZE, random_policies
from curiosity_algos import make_evaluator
from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.rollouts import Summarizer
from curiosity_algos.motivations.curiosity import CuriosityMotivation
from curiosity_gym.processors import available_cpus

MAZE, CONTROL = "CuriosityMaze-US-v0", "CuriosityControl-Finger-v0"
IN_PYTHON = "Pusher-v5"
MAZE_POPULATIONS = (56, 560, 5600)
NODES = (10, 100)
MODELLED = {MAZE: 10_000, CONTROL: 560}
"""Individuals of the model's populations."""
SHARDS = 200
"""Of which the time of one is measured, without anything to play."""


@dataclass(frozen=True)
class Workload:
    """A population of an environment, and the processors that it is compared on.

    Attributes:
        env_id: The environment.
        n: Individuals.
        n_workers: Workers of Ray, and threads of the local evaluator.
    """

    env_id: str
    n: int
    n_workers: int

    @property
    def name(self) -> str:
        """As in the tables."""
        return f"{self.env_id}, {self.n:,} on {self.n_workers}"


def run(plan: Plan) -> list[Table]:
    """Bytes, times, and a model fitted to them."""
    import ray

    try:
        return _run(plan)
    finally:
        ray.shutdown()  # other sections' times are without its processes


def _run(plan: Plan) -> list[Table]:
    from curiosity_algos.evaluation.ray import RayEvaluator

    n_cores = plan.size(available_cpus(), 1)
    maze_sizes = [
        plan.size(n, 4) for n in (MAZE_POPULATIONS[:1] if plan.quick else MAZE_POPULATIONS)
    ]
    n = plan.size(POPULATION_SIZE, 4)
    workloads = [Workload(MAZE, size, n_cores) for size in maze_sizes]
    workloads += [Workload(CONTROL, n, n_cores), Workload(IN_PYTHON, n, 1)]
    tasks: dict[str, Task] = {}
    for each in workloads:
        local = make_evaluator(each.env_id, n_threads=each.n_workers)
        there = RayEvaluator(each.env_id, n_workers=each.n_workers, num_cpus=n_cores / 64)
        tasks[f"{each.name}, local"] = _task(local, each)
        tasks[f"{each.name}, Ray"] = _task(there, each)
    figures = interleave(tasks, plan.repeats)
    rows = []
    for each in workloads:
        here, there_too = figures[f"{each.name}, local"], figures[f"{each.name}, Ray"]
        overhead = [100.0 * (ratio - 1.0) for ratio in ratios(there_too, here)]
        rows += [
            Row(f"{each.name}, local", here, "s"),
            Row(f"{each.name}, Ray", there_too, "s"),
            Row("overhead", overhead, "%", "" if each.env_id == MAZE else "<= 15"),
        ]
    shard = [_seconds_of_a_shard(plan) for _ in range(plan.repeats)]
    rows.append(Row("a shard with nothing to play", [1e3 * each for each in shard], "ms"))
    notes = [
        f"A generation, read as CuriosityES reads it; on as many workers as threads, on {n_cores} "
        f"cores. {IN_PYTHON} is stepped in Python, by one process without Ray."
    ]
    return [
        _bytes(n),
        Table("cluster: time of a generation", rows, notes),
        _model(workloads, figures, shard),
    ]


def _task(evaluator: Evaluator, workload: Workload) -> Task:
    """Seconds of a generation."""
    parameters = random_policies(evaluator, workload.n)
    summarizers = _summarizers(workload.env_id, workload.n)

    def play() -> None:
        evaluator.play(parameters, 0, summarizers)

    for _ in range(3):  # compiles, and starts the workers
        play()
    return lambda: seconds(play)


def _summarizers(env_id: str, n: int) -> Mapping[str, Summarizer]:
    env = gym.make(env_id)
    return CuriosityMotivation(env.observation_space, env.action_space, seed=0).summarizers(n)


def _seconds_of_a_shard(plan: Plan) -> float:
    """Of one of many shards that play nothing."""
    from curiosity_algos.evaluation.ray import RayEvaluator

    n = plan.size(SHARDS, 4)
    evaluator = RayEvaluator(Nothing, n_workers=1, num_cpus=0.1, shard_size=1)
    parameters = np.zeros((n, 1), dtype=np.float32)
    evaluator.play(parameters, 0, {})
    return seconds(lambda: evaluator.play(parameters, 0, {})) / n


class Nothing(Evaluator):
    """An evaluator that plays nothing."""

    n_parameters = 1

    def __init__(self) -> None:
        self._rollouts = make_evaluator(MAZE, n_threads=1)
        self._one = np.zeros((1, self._rollouts.n_parameters), dtype=np.float32)
        self._played = self._rollouts.evaluate(self._one)

    def evaluate(self, parameters: Any, seed: int | None = None) -> Any:
        """What was played when this was made."""
        return self._played


def _bytes(n: int) -> Table:
    """What a generation of a maze is, pickled, and what of it is needed."""
    evaluator = make_evaluator(MAZE)
    parameters = random_policies(evaluator, n)
    whole = evaluator.evaluate(parameters, 0)
    summarizers = _summarizers(MAZE, n)
    read = evaluator.play(parameters, 0, summarizers)
    contents = {
        "trajectories and all": whole,
        "what CuriosityES reads": replace(read, observations=None, actions=None),
        "what novelty search reads": whole.without_trajectories(),
        "parameters": parameters,
        "what is to be read": summarizers,
    }
    rows = [
        Row(name, [len(pickle.dumps(each, protocol=5)) / 1e6], "MB")
        for name, each in contents.items()
    ]
    return Table("cluster: a generation in bytes", rows, [f"{MAZE}, {n} individuals."])


def _model(
    workloads: list[Workload], figures: Mapping[str, list[float]], shard: list[float]
) -> Table:
    """Speedups over one machine of like machines, at best."""
    n_cores = available_cpus()
    rows = []
    for env_id, n in MODELLED.items():
        *_, largest = (each for each in workloads if each.env_id == env_id)
        # Seconds an individual, on one machine.
        each = median(figures[f"{largest.name}, local"]) / largest.n
        for n_nodes in NODES:
            n_workers = n_nodes * n_cores
            n_shards = min(n, 2 * n_workers)
            rounds = math.ceil(n_shards / n_workers)
            playing = rounds * math.ceil(n / n_shards) * each * n_cores
            serial = n_shards * median(shard)
            speedup = n * each / max(playing, serial)
            rows.append(Row(f"{env_id}, {n:,} individuals, {n_nodes} nodes", [speedup], "x"))
    notes = [
        f"A model, not a measurement: nodes of {n_cores} cores like this machine, two shards a "
        "worker, each of which costs the one that hands them out the time measured above; it knows "
        "nothing of a network."
    ]
    return Table("cluster: a model of more machines, over one", rows, notes)
