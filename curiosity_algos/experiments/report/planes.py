"""The plane that an environment's final states are drawn on: its maze, or part of its behavior."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from curiosity_algos.evaluation.environments import env_attribute
from curiosity_algos.experiments.report.collect import Environment, Float64
from curiosity_gym.core import CoverageGrid
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.maze.maze_env import MazeEnv

N_PIXELS = 100
"""Along the longer side of the plane: final states within one are drawn as one."""
N_CELLS = 50
"""Along either side of the plane: as of the grid that coverage counts in mazes."""


@dataclass(frozen=True, eq=False)
class Plane:
    """A rectangle of the first two entries of the behavior.

    Attributes:
        low: (2,) its lower left corner.
        high: (2,) its upper right corner.
        maze: The environment, where the entries are a robot's position in it.
    """

    low: Float64
    high: Float64
    maze: MazeEnv | None = None

    @property
    def pixels(self) -> tuple[int, int]:
        """How many there are along x and y; those of a maze are squares."""
        if self.maze is None:
            return N_PIXELS, N_PIXELS
        nx, ny = np.maximum(1, np.round(N_PIXELS * self.high / self.high.max())).astype(int)
        return int(nx), int(ny)

    def indices(self, points: npt.NDArray[Any], counts: tuple[int, int]) -> npt.NDArray[np.int64]:
        """Flat indices (n,) of points (n, 2) among columns and rows, row by row from below."""
        shares = (points - self.low) / (self.high - self.low)
        columns, rows = np.clip(shares * counts, 0, np.array(counts) - 1).astype(np.int64).T
        flat: npt.NDArray[np.int64] = rows * counts[0] + columns
        return flat

    def payload(self) -> dict[str, Any]:
        """What the page draws."""
        x, y = np.stack([self.low, self.high], axis=1).tolist()
        return {"x": x, "y": y, "pixels": self.pixels, "cells": N_CELLS, "maze": self._drawing()}

    def _drawing(self) -> dict[str, Any] | None:
        if self.maze is None:
            return None
        layout = self.maze.layout
        goal = {"goal": layout.goal, "goal_radius": self.maze.maze.goal_radius}
        return {"start": layout.start, **goal, "walls": _outline(layout)}


def _outline(layout: MazeLayout) -> str:
    """The walls as one path."""
    return "".join(
        f"M{x:.6g},{y:.6g}H{x + width:.6g}V{y + height:.6g}H{x:.6g}Z"
        for x, y, width, height in layout.walls
    )


def plane_of(environment: Environment) -> Plane | None:
    """Where to draw the final states; None where behaviors have fewer than two entries."""
    ends = [run.episodes["behavior"] for run in environment.runs]
    if any(each.shape[1] < 2 for each in ends):
        return None
    env = _make(environment)
    if env is not None and isinstance(env.unwrapped, MazeEnv):
        layout = env.unwrapped.layout
        return Plane(np.zeros(2), np.array([layout.width, layout.height]), env.unwrapped)
    grid = None if env is None else env_attribute(env, "coverage_grid")
    paths = (run.folder.trajectory().get("behaviors") for run in environment.runs)
    drawn = [*ends, *(path[:, :2] for path in paths if path is not None)]
    return _plane_around(np.concatenate(drawn), grid)


def _make(environment: Environment) -> gym.Env[Any, Any] | None:
    """The environment; None where its description or what is installed does not suffice."""
    described = environment.runs[0].description
    if described.get("env") is None or described.get("wrappers"):
        return None
    try:
        return gym.make(described["env"], **described.get("env_kwargs", {}))
    except (gym.error.Error, ImportError, TypeError, ValueError):
        return None


def _plane_around(points: npt.NDArray[Any], grid: CoverageGrid | None) -> Plane | None:
    """The smallest plane that holds all points (n, 2), as far as coverage counts them."""
    finite = points[np.isfinite(points).all(axis=1)].astype(np.float64)
    if not len(finite):
        return None
    if grid is not None and {0, 1} <= set(grid.dimensions):
        order = [grid.dimensions.index(0), grid.dimensions.index(1)]
        finite = np.clip(finite, grid.low[order], grid.high[order])
    low, high = finite.min(axis=0), finite.max(axis=0)
    return Plane(low, np.where(high > low, high, low + 1.0))
