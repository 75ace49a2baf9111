"""Quality diversity at the paper's size: what the archive costs in time."""

from __future__ import annotations

import time
from itertools import count

from benchmarks.measure import Plan, Row, Stopwatch, Table
from benchmarks.plan import MAZES
from curiosity_algos import MAPElites


def run(plan: Plan) -> list[Table]:
    """The share of MAP-Elites' time that archive and emitter take."""
    seeds = count()
    timesteps = plan.size(3e6, 1.0)
    MAPElites(MAZES[0], seed=0).learn(1)
    rows = []
    for env_id in MAZES:
        shares = [_share(env_id, timesteps, next(seeds)) for _ in range(plan.repeats)]
        rows.append(Row(f"{env_id}, archive and emitter", shares, "%", "<= 40"))
    notes = [f"MAPElites, learn({timesteps:,.0f}), another seed each."]
    return [Table("diversity: share of the time", rows, notes)]


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
