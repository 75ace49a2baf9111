"""The keywords of the maze environments, checked for single and vector environments alike."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from curiosity_gym.core import CoverageGrid, Float32Array, Float64Array
from curiosity_gym.layouts import (
    GOAL_RADIUS,
    ROBOT_RADIUS,
    MazeLayout,
    closest_approach,
    reachable_cells,
    resolve_layout,
)
from curiosity_gym.maze.dynamics import MARGIN, N_BASE_FEATURES, Maze, build_maze, observe
from curiosity_gym.maze.viewer import MazeViewer
from curiosity_gym.validation import check_at_least_one, check_positive, check_share

FPS = 10
"""Frames a second: a step lasts 0.1 s."""
LIDAR_SHARE = 0.2
"""The lidar's default range as a share of the map's diagonal."""
NEAREST = ROBOT_RADIUS - 1.01 * MARGIN
"""Least distance from a wall to a robot that slides past its corner, less a bit for rounding."""
TOLERANCE = 1e-4
"""How far an observation may be off on another processor, whose cosines may end in other bits."""


@dataclass(frozen=True)
class MazeConfig:
    """A checked maze: its layout, what the compiled functions need, and its spaces."""

    layout: MazeLayout
    maze: Maze
    lidar_range: float
    observation_space: spaces.Box[np.float32]
    action_space: spaces.Box[np.float32]
    behavior_space: spaces.Box[np.float64]
    coverage_grid: CoverageGrid

    fps: int = FPS

    @property
    def horizon(self) -> int:
        """Steps after which an episode is truncated."""
        return self.maze.horizon

    def make_viewer(self) -> MazeViewer:
        """A new viewer of this maze."""
        return MazeViewer(
            self.layout,
            n_beams=len(self.maze.inverse_x),
            beam_range=self.lidar_range,
            goal_radius=self.maze.goal_radius,
        )


def configure_maze(
    layout: MazeLayout | str | os.PathLike[str] | None = None,
    *,
    horizon: int = 2000,
    max_speed: float = 20.0,
    max_acceleration: float = 5.0,
    n_beams: int = 32,
    lidar_range: float | None = None,
    restitution: float = 0.0,
    goal_radius: float = GOAL_RADIUS,
) -> MazeConfig:
    """Check the keywords of `MazeEnv`, where they are explained.

    Raises:
        ValueError: If one of them is not what it may be.
    """
    if layout is None:
        raise ValueError(
            "`layout` must be given: a MazeLayout, a built-in name, a .json file or ASCII text."
        )
    layout = resolve_layout(layout)
    diagonal = math.hypot(layout.width, layout.height)
    lidar_range = LIDAR_SHARE * diagonal if lidar_range is None else lidar_range
    positive = {"max_speed": max_speed, "max_acceleration": max_acceleration}
    check_positive(**positive, lidar_range=lidar_range, goal_radius=goal_radius)
    check_share(restitution=restitution)
    check_at_least_one(horizon=horizon, n_beams=n_beams)
    if closest_approach(layout) >= goal_radius:
        raise ValueError(f"`goal_radius` must let the robot come near enough, got {goal_radius!r}.")
    maze = build_maze(
        layout,
        horizon=horizon,
        max_speed=max_speed,
        max_acceleration=max_acceleration,
        n_beams=n_beams,
        lidar_range=lidar_range,
        restitution=restitution,
        goal_radius=goal_radius,
    )
    return MazeConfig(layout, maze, float(lidar_range), *_spaces(layout, maze))


def _spaces(
    layout: MazeLayout, maze: Maze
) -> tuple[spaces.Box[Any], spaces.Box[Any], spaces.Box[Any], CoverageGrid]:
    n_beams = len(maze.inverse_x)
    low = np.concatenate([np.full(N_BASE_FEATURES, -1.0), np.zeros(n_beams)]).astype(np.float32)
    observation = spaces.Box(low, np.ones_like(low))
    action = spaces.Box(-1.0, 1.0, (2,), np.float32)
    world = np.array([layout.width, layout.height])
    speed = np.full(2, maze.max_speed)
    behavior = spaces.Box(
        np.concatenate([np.zeros(2), -speed]), np.concatenate([world, speed]), dtype=np.float64
    )
    grid = CoverageGrid((0, 1), np.zeros(2), world, reachable=reachable_cells(layout))
    return observation, action, behavior, grid


def start_state(layout: MazeLayout, maze: Maze, options: dict[str, Any] | None) -> npt.NDArray[Any]:
    """The state (x, y, vx, vy) at which an episode begins: `options["state"]`, or the layout's.

    Raises:
        ValueError: If the given state is not four finite numbers, too fast, or inside a wall.
    """
    if not options or options.get("state") is None:
        return maze.start.copy()
    state = _four_numbers(options["state"])
    _check_robots(layout, maze, state[None], name='options["state"]')
    return state


def check_states(
    layout: MazeLayout, maze: Maze, states: Float64Array, observations: Float32Array
) -> None:
    """Raise ValueError unless robots can have come to `states` (n, 4) and see this maze there."""
    _check_robots(layout, maze, states, name="state")
    expected = np.empty_like(observations)
    for state, row in zip(states, expected, strict=True):
        observe(maze, state, row)
    if not np.allclose(observations, expected, rtol=0.0, atol=TOLERANCE):
        raise ValueError(
            "`state` must be of this maze: its observations are not what is seen there."
        )


def _check_robots(layout: MazeLayout, maze: Maze, states: Float64Array, *, name: str) -> None:
    """Raise ValueError, naming an argument, unless robots go and stand as they may."""
    if (np.abs(states[:, 2:]) > maze.max_speed).any():
        raise ValueError(f"`{name}` must not be faster than {maze.max_speed:g} per axis.")
    places = states[:, None, :2]
    low, high = layout.walls[:, :2], layout.walls.reshape(-1, 2, 2).sum(axis=1)
    inside = (places > low - NEAREST) & (places < high + NEAREST)
    limit = np.array([layout.width, layout.height]) - NEAREST
    in_world = ((places >= NEAREST) & (places <= limit)).all(axis=(1, 2))
    wrong = states[~in_world | inside.all(axis=2).any(axis=1)]
    if len(wrong):
        x, y = wrong[0, :2]
        raise ValueError(
            f"`{name}` must leave the robot {ROBOT_RADIUS:g} from walls and border, "
            f"got ({x:g}, {y:g})."
        )


def _four_numbers(value: object) -> npt.NDArray[np.float64]:
    try:
        state = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        state = np.empty(0)
    if state.shape != (4,) or not np.isfinite(state).all():
        raise ValueError(
            f'`options["state"]` must be 4 finite numbers x, y, vx, vy, got {value!r:.60}.'
        )
    return state
