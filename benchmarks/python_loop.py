"""One environment in a Python loop, beside Gymnasium-Robotics' PointMaze."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt

import curiosity_gym  # noqa: F401  registers the ids
from benchmarks.measure import Plan, Row, Table, Task, add_peer, interleave, ratios, seconds

MAZE = "CuriosityMaze-Snake-v0"
POINT_MAZE = "PointMaze_UMaze-v3"
UNIT = "steps/s"


def run(plan: Plan) -> list[Table]:
    """Steps a second of both, as `gym.make` gives them."""
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1.0, 1.0, (plan.size(20_000, 100), 2)).astype(np.float32)
    tasks = {MAZE: loop_task(gym.make(MAZE), actions)}
    notes = ["With gym.make's default wrappers, the same fixed actions, resets included."]
    add_peer(tasks, notes, POINT_MAZE, lambda: point_maze_task(actions))
    figures = interleave(tasks, plan.repeats)
    rows = [Row(name, values, UNIT) for name, values in figures.items()]
    if POINT_MAZE in figures:
        values = ratios(figures[MAZE], figures[POINT_MAZE])
        rows.append(Row(f"over {POINT_MAZE}", values, "x", ">= 3"))
    return [Table("python_loop: one environment", rows, notes)]


def point_maze_task(actions: npt.NDArray[np.float32]) -> Task:
    """The peer's loop.

    Raises:
        ImportError: If Gymnasium-Robotics is not installed.
    """
    import gymnasium_robotics

    gym.register_envs(gymnasium_robotics)
    return loop_task(gym.make(POINT_MAZE), actions)


def loop_task(env: gym.Env[Any, Any], actions: npt.NDArray[Any]) -> Task:
    """Steps a second of a loop over actions (n, A), an episode after the other."""

    def loop(actions: npt.NDArray[Any]) -> None:
        env.reset(seed=0)
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    loop(actions[:10])
    return lambda: len(actions) / seconds(lambda: loop(actions))
