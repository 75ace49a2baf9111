"""What this machine can do at most: the rates that other sections' figures are to be held to."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch as th

from benchmarks.measure import Plan, Row, Table, Task, interleave, seconds
from curiosity_algos.common.networks import single_torch_thread
from curiosity_gym.compiled import ThreadPool, compiled

WIDTH = 1024
"""Of the matrices that are multiplied."""
N_IN_CACHE = 2048
"""Floats of a loop that stays in the first cache."""


@compiled
def multiply_add(values: npt.NDArray[np.float32], n: int) -> None:
    """`v <- a v + b` of every value, n times, as the compiled loops do their arithmetic."""
    for _ in range(n):
        for i in range(len(values)):
            values[i] = values[i] * np.float32(0.5) + np.float32(1.0)


def run(plan: Plan) -> list[Table]:
    """Matrix products, arithmetic in the first cache and copies, on one thread and on all."""
    pool = ThreadPool()
    tasks: dict[str, Task] = {}
    for n_threads in sorted({1, pool.n_threads}):
        where = "one thread" if n_threads == 1 else f"{n_threads} threads"
        tasks[f"matrix product, {where}"] = products_task(plan, pool, n_threads)
        tasks[f"multiply and add in the first cache, {where}"] = loops_task(plan, pool, n_threads)
        tasks[f"copy, {where}"] = _copies(plan, pool, n_threads)
    figures = interleave(tasks, plan.repeats)
    rows = [
        Row(name, values, "GB/s" if name.startswith("copy") else "GFLOP/s")
        for name, values in figures.items()
    ]
    notes = [
        f"float32. Products of {WIDTH:,} by {WIDTH:,} by torch, each thread its own; copies of "
        "arrays far larger than the caches, bytes read and written."
    ]
    return [Table("roofline: this machine", rows, notes)]


def products_task(plan: Plan, pool: ThreadPool, n_threads: int) -> Task:
    """Billions of operations a second, of products of large matrices on so many threads."""
    n_products = plan.size(20, 1)
    operands = [th.ones(WIDTH, WIDTH) for _ in range(n_threads)]
    outs = [th.empty(WIDTH, WIDTH) for _ in range(n_threads)]

    def multiply(begin: int, end: int) -> None:
        th.set_num_threads(1)  # torch's setting holds only in the thread that makes it
        for i in range(begin, end):
            for _ in range(n_products):
                th.mm(operands[i], operands[i], out=outs[i])

    def rate() -> float:
        with single_torch_thread():
            elapsed = seconds(lambda: pool.run(multiply, n_threads, n_threads))
        return 2e-9 * WIDTH**3 * n_products * n_threads / elapsed

    return rate


def loops_task(plan: Plan, pool: ThreadPool, n_threads: int) -> Task:
    """Billions of operations a second of a compiled loop in the first cache, on so many threads."""
    n_passes = plan.size(200_000, 100)
    values = [np.ones(N_IN_CACHE, dtype=np.float32) for _ in range(n_threads)]
    multiply_add(values[0], 1)  # compiled before it is timed

    def loop(begin: int, end: int) -> None:
        for i in range(begin, end):
            multiply_add(values[i], n_passes)

    def rate() -> float:
        elapsed = seconds(lambda: pool.run(loop, n_threads, n_threads))
        return 2e-9 * N_IN_CACHE * n_passes * n_threads / elapsed

    return rate


def _copies(plan: Plan, pool: ThreadPool, n_threads: int) -> Task:
    n_bytes = plan.size(256_000_000, 1_000_000)
    source, target = np.ones(n_bytes, dtype=np.uint8), np.zeros(n_bytes, dtype=np.uint8)

    def copy(begin: int, end: int) -> None:
        np.copyto(target[begin:end], source[begin:end])

    def rate() -> float:
        return 2e-9 * n_bytes / seconds(lambda: pool.run(copy, n_bytes, n_threads))

    return rate
