"""Quality diversity at the paper's size: what the archive costs in time and in memory."""

from __future__ import annotations

import resource
import time
from itertools import count
from multiprocessing import get_context
from pathlib import Path

import curiosity_algos
from benchmarks.measure import Plan, Row, Table
from benchmarks.training import Stopwatch
from curiosity_algos import MAPElites

MAZES = ("CuriosityMaze-Snake-v0", "CuriosityMaze-US-v0", "CuriosityMaze-Hard-v0")
POPULATION, HORIZON = 56, 2000
GIBIBYTE = 2**30


def run(plan: Plan) -> list[Table]:
    """The share of MAP-Elites' time that archive and emitter take, then peak memories."""
    return [_shares(plan), _memory(plan)]


def _shares(plan: Plan) -> Table:
    seeds = count()
    timesteps = plan.size(3e6, 1.0)
    MAPElites(MAZES[0], seed=0).learn(1)
    rows = []
    for env_id in MAZES:
        shares = [_share(env_id, timesteps, next(seeds)) for _ in range(plan.repeats)]
        rows.append(Row(f"{env_id}, archive and emitter", shares, "%", "<= 40"))
    notes = [f"MAPElites, {POPULATION} individuals, learn({timesteps:,.0f}), another seed each."]
    return Table("diversity: share of the time", rows, notes)


def _share(env_id: str, timesteps: float, seed: int) -> float:
    """Percent of `learn` that asking and telling take."""
    watch = Stopwatch()
    model = MAPElites(env_id, seed=seed)
    watch.wrap(model, "_ask", "emitter")
    watch.wrap(model, "_tell", "archive")
    began = time.perf_counter()
    model.learn(timesteps)
    elapsed = time.perf_counter() - began
    return 100.0 * (watch.seconds["emitter"] + watch.seconds["archive"]) / elapsed


def _memory(plan: Plan) -> Table:
    n_generations = int(plan.size(2000, 2))
    rows, notes = [], []
    for algorithm in ("MAPElites", "CMAME"):
        with get_context("spawn").Pool(1) as pool:  # a process of its own: its peak is its own
            peak, n_elites = pool.apply(_peak, (algorithm, n_generations))
        rows.append(Row(f"{algorithm}, whole process", [peak / GIBIBYTE], "GiB", "<= 1"))
        notes.append(f"{algorithm} holds {n_elites:,} elites after {n_generations:,} generations.")
    dense = 50**4 * (1746 * 8 + 4 * 8 + 8 + 8) / GIBIBYTE
    rows.append(Row("pyribs' GridArchive of that grid, by its arrays", [dense], "GiB"))
    return Table("diversity: peak memory", rows, notes)


def _peak(algorithm: str, n_generations: int) -> tuple[int, int]:
    """Largest resident bytes of this process after a run on the US maze, and the elites held."""
    model = getattr(curiosity_algos, algorithm)(MAZES[1], seed=0, device="cpu")
    model.learn(n_generations * POPULATION * HORIZON)
    return _peak_memory(), len(model.archive)


def _peak_memory() -> int:
    """Largest resident bytes of this process so far."""
    status = Path("/proc/self/status")
    if status.exists():  # where getrusage also counts what the parent held when it forked
        (line,) = (each for each in status.read_text().splitlines() if each.startswith("VmHWM"))
        return 1024 * int(line.split()[1])
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
