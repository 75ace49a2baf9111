"""What compiled evaluators need of an environment, which may be in another process."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from curiosity_gym.maze.dynamics import same_maze


@dataclass(frozen=True)
class KnownTask:
    """A maze, a control task or a robot that compiled evaluators can play without its env.

    Attributes:
        task: The maze or task.
        simulate: Makes simulations of a task; None: it is a maze.
        grid: The coverage grid of a maze.
        horizon: T of the reward `1 - t / T`; None: rewards are the task's own.
        max_steps: Steps after which an episode ends.
    """

    task: Any
    simulate: Any
    grid: Any
    horizon: int | None
    max_steps: int

    def is_same(self, other: KnownTask | None) -> bool:
        """Whether policies meet the same task."""
        if other is None or self.simulate is not other.simulate:
            return False
        if (self.horizon, self.max_steps) != (other.horizon, other.max_steps):
            return False
        is_maze = self.simulate is None
        return same_maze(self.task, other.task) if is_maze else bool(self.task == other.task)
