"""The paper's whole run, from a cold process to the saved model: its time and its memory.

2,000 generations of 56 individuals, of up to 2,000 steps each: the 224 million environment steps
that the paper gives one evolution, a day on a cluster's node. Each is run once.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from stable_baselines3.common.callbacks import BaseCallback

import curiosity_algos
from benchmarks.measure import Plan, Row, Table
from benchmarks.products import products
from benchmarks.roofline import products_task
from curiosity_gym.compiled import ThreadPool

MAZE = "CuriosityMaze-US-v0"
TARGETS = {
    "CanonicalES": "",
    "NSES": "<= 40",
    "NSLC": "",
    "MAPElites": "",
    "CMAME": "",
    "AURORA": "",
    "CuriosityES": "<= 150",
    "CuriosityES, paper": "<= 300",
    "CuriosityMAPElites": "",
}
"""Seconds, by algorithm and preset."""
LARGEST = {"CuriosityES, paper": "<= 1229", "MAPElites": "<= 1024", "CMAME": "<= 1024"}
"""MiB."""
MEBIBYTE = 2**20


def run(plan: Plan) -> list[Table]:
    """Seconds of each algorithm, and its resident memory early and at the end."""
    n_generations = plan.size(2000, 2)
    times, memory = [], []
    pool = ThreadPool()
    rate = products_task(plan, pool, pool.n_threads)
    names = ["CuriosityES, paper"] if plan.quick else list(TARGETS)
    for name in names:
        _in_a_process(name, 1)  # compiles what is not in the cache
        began = time.perf_counter()
        early, late, peak, done = _in_a_process(name, n_generations)
        elapsed = time.perf_counter() - began
        times.append(Row(name, [elapsed], "s", TARGETS[name], [done / rate() / elapsed]))
        memory += [
            Row(f"{name}, after a tenth", [early / MEBIBYTE], "MiB"),
            Row(f"{name}, at the end", [late / MEBIBYTE], "MiB"),
            Row(f"{name}, growth", [100.0 * (late / early - 1.0)], "%", "<= 5"),
            Row(f"{name}, at most", [peak / MEBIBYTE], "MiB", LARGEST.get(name, "")),
        ]
    done = (
        f"{n_generations:,} generations on {MAZE}, seed 0, once; machine code in cache. "
        "The roof is the time of the matrix products of policies, scores and training at the rate "
        "of large ones, on all threads; of CuriosityMAPElites and AURORA only those of policies "
        "are counted."
    )
    grid = 50**4 * (1746 * 8 + 4 * 8 + 8 + 8) / 2**30
    dense = f"pyribs' GridArchive of MAPElites' grid would take {grid:.0f} GiB by its arrays."
    return [
        Table("whole_run: from a cold process to the saved model", times, [done]),
        Table("whole_run: resident memory", memory, [dense]),
    ]


def _in_a_process(name: str, n_generations: int) -> list[float]:
    """What `main` prints."""
    command = [sys.executable, "-m", "benchmarks.whole_run", name, str(n_generations)]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    printed: list[float] = json.loads(done.stdout)
    return printed


class Generations(BaseCallback):
    """Ends a run after so many, and notes the resident bytes after a tenth and at the end."""

    def __init__(self, n: int) -> None:
        super().__init__()
        self.n = n
        self.early = self.late = 0

    def _on_step(self) -> bool:
        if self.n_calls == max(1, self.n // 10):
            self.early = resident()
        self.late = resident()
        return self.n_calls < self.n


def resident() -> int:
    """Bytes of this process that are in memory."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def largest_resident() -> int:
    """Largest resident bytes of this process so far."""
    status = Path("/proc/self/status").read_text().splitlines()
    (line,) = (each for each in status if each.startswith("VmHWM"))
    return 1024 * int(line.split()[1])


def main(name: str, n_generations: int) -> None:
    """Train, save, print resident bytes, after a tenth, at the end and at most, and products."""
    algorithm, _, preset = name.partition(", ")
    cls = getattr(curiosity_algos, algorithm)
    make = partial(cls.from_preset, preset) if preset else cls
    model = make(MAZE, seed=0, device="cpu")
    generations = Generations(n_generations)
    model.learn(1e12, callback=generations)
    with tempfile.TemporaryDirectory() as folder:
        model.save(Path(folder) / "model")
    resident_bytes = [generations.early, generations.late, largest_resident()]
    print(json.dumps([*resident_bytes, products(model)]))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
