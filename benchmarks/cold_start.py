"""Fresh processes: what an import and a first step cost, beside Gymnasium and Stable-Baselines3."""

from __future__ import annotations

import subprocess
import sys

from benchmarks.measure import Plan, Row, Table, Task, interleave, ratios

TIMED = """
import time
began = time.perf_counter()
{code}
print(time.perf_counter() - began)
"""
FIRST_STEP = """
import gymnasium
{imports}
env = gymnasium.make("{env_id}")
env.reset(seed=0)
env.step(env.action_space.sample())
"""
MAZE, CART_POLE = "CuriosityMaze-Hard-v0", "CartPole-v1"
IMPORTS = ("gymnasium", "curiosity_gym", "stable_baselines3", "curiosity_algos")


def run(plan: Plan) -> list[Table]:
    """Seconds inside the process, from the first import on."""
    tasks = {f"import {name}": process_task(f"import {name}") for name in IMPORTS}
    maze, cart_pole = f"first step of {MAZE}", f"first step of {CART_POLE}"
    tasks[maze] = process_task(FIRST_STEP.format(imports="import curiosity_gym", env_id=MAZE))
    tasks[cart_pole] = process_task(FIRST_STEP.format(imports="", env_id=CART_POLE))
    if not plan.quick:
        interleave(tasks, 1)  # compiles the kernels, and reads every file from disk
    figures = interleave(tasks, plan.repeats)
    pairs = zip(figures["import curiosity_gym"], figures["import gymnasium"], strict=True)
    algos, sb3 = figures["import curiosity_algos"], figures["import stable_baselines3"]
    rows = [
        *(Row(name, figures[name], "s") for name in tasks if name != maze),
        Row(maze, figures[maze], "s", "<= 1.5"),
        Row("curiosity_gym beyond gymnasium", [a - b for a, b in pairs], "s", "<= 0.15"),
        Row("curiosity_algos over stable_baselines3", ratios(algos, sb3), "x"),
        Row(f"{MAZE} over {CART_POLE}", ratios(figures[maze], figures[cart_pole]), "x"),
    ]
    notes = ["Machine code and files in cache; a first step counts from the first import."]
    return [Table("cold_start: fresh processes", rows, notes)]


def process_task(code: str) -> Task:
    """Seconds that `code` takes in a process of its own."""
    command = [sys.executable, "-c", TIMED.format(code=code)]

    def task() -> float:
        printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        return float(printed.split()[-1])

    return task
