"""One robot in a maze, the Gymnasium environment."""

from __future__ import annotations

import math
import os
from functools import partial
from typing import Any

from curiosity_gym.built_in import resolve_layout
from curiosity_gym.core import Float32Array
from curiosity_gym.episodic_env import EpisodicEnv
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.layouts import GOAL_RADIUS, MazeLayout, closest_approach
from curiosity_gym.maze.dynamics import Maze, build_maze, step
from curiosity_gym.maze.simulation import MazeSimulation
from curiosity_gym.maze.viewer import MazeViewer
from curiosity_gym.validation import (
    check_at_least_one,
    check_not_negative,
    check_positive,
    check_share,
)

LIDAR_SHARE = 0.2  # the lidar's default range as a share of the map's diagonal


class MazeEnv(EpisodicEnv):
    """A point robot with a ring of LIDAR beams looks for the goal of a maze, rewarded only there.

    Description:
        The environment of "Curiosity creates Diversity in Policy Search" (section 4.1). The robot,
        a square of half-width 1, accelerates through a world of axis-aligned walls. On contact it
        stops at the wall and slides along it. Dynamics are deterministic.

    Action Space:
        `Box(-1, 1, (2,), float32)`: acceleration along x and y, in units of `max_acceleration`,
        held for a step of 0.1 s. Actions outside are clipped; NaN and infinity are a `ValueError`.

    Observation Space:
        `Box` of shape `(4 + n_beams,)`, float32.

        ===== ============================ ==== ===
        Index Meaning                      Min  Max
        ===== ============================ ==== ===
        0     x, scaled to the world       -1   1
        1     y, scaled to the world       -1   1
        2     velocity along x / max_speed -1   1
        3     velocity along y / max_speed -1   1
        4 ... distance along each beam     0    1
        ===== ============================ ==== ===

        Beam i points to angle `2 pi i / n_beams`, counterclockwise from the x axis and fixed to the
        world. It is the distance from the robot's center to the nearest wall or border, cut at
        `lidar_range` and divided by it.

    Behavior:
        `info["behavior"]`, of `behavior_space`: x, y, vx, vy. Coverage counts x and y on a grid of
        50 x 50 cells (`coverage_grid`, which knows the cells that the robot can reach).

    Rewards:
        `1 - t / horizon` on the step t that brings the robot within `goal_radius` of the goal, and
        0 on every other.

    Starting State:
        At the layout's start, at rest, or near it, see `start_radius`;
        `reset(options={"state": (x, y, vx, vy)})` starts elsewhere.

    Episode End:
        Terminated at the goal; truncated after `horizon` steps without it.

    Information:
        `position` (2,), `velocity` (2,), `behavior` (4,), float64, and `is_success`.

    Args:
        layout: "snake", "us", "hard", "labyrinth", a name of `random_layout`, a `MazeLayout`, a
            path to its `.json` file, or ASCII text. The ids give it, but for `CuriosityMaze-v0`,
            which needs it.
        horizon: Steps after which an episode is truncated, and the T of the reward `1 - t / T`.
        max_speed: Bound of each velocity component (maze units per s).
        max_acceleration: Acceleration of an action of 1 (maze units per s^2).
        n_beams: Number of LIDAR beams.
        lidar_range: Reach of the beams (maze units); None: 20 % of the map's diagonal.
        restitution: Share of the velocity into a wall that bounces back, from 0 (it stops there) to
            1. Bouncing robots find most goals by chance.
        goal_radius: How near the goal is near enough (maze units).
        start_radius: Distance from the layout's start within which each episode begins (maze
            units), drawn from `np_random`: uniform among the places, not yet at the goal, to which
            the robot can go from there on a straight line without touching a wall. 0: at the start.
        render_mode: "rgb_array" or None; `gym.make` also takes "human", and opens a window.

    Raises:
        ValueError: If an argument is not what it may be, or the layout is malformed.
    """

    simulation: MazeSimulation

    settings = (
        *("layout", "maze", "max_speed", "max_acceleration", "n_beams", "lidar_range"),
        *("restitution", "goal_radius", "start_radius"),
    )

    def __init__(
        self,
        layout: MazeLayout | str | os.PathLike[str] | None = None,
        *,
        horizon: int = 2000,
        max_speed: float = 20.0,
        max_acceleration: float = 5.0,
        n_beams: int = 32,
        lidar_range: float | None = None,
        restitution: float = 0.0,
        goal_radius: float = GOAL_RADIUS,
        start_radius: float = 0.0,
        render_mode: str | None = None,
    ) -> None:
        self.layout = layout = resolve_layout(layout)
        if lidar_range is None:
            lidar_range = LIDAR_SHARE * math.hypot(layout.width, layout.height)
        check_positive(max_speed=max_speed, max_acceleration=max_acceleration)
        check_positive(lidar_range=lidar_range, goal_radius=goal_radius)
        check_not_negative(start_radius=start_radius)
        check_share(restitution=restitution)
        check_at_least_one(horizon=horizon, n_beams=n_beams)
        if closest_approach(layout) >= goal_radius:
            raise ValueError(
                f"`goal_radius` must let the robot come near enough, got {goal_radius!r}."
            )
        # One of numpy may have half the precision, in which walls would not be where they are.
        self.lidar_range, n_beams = float(lidar_range), int(n_beams)
        self.maze = build_maze(
            layout,
            n_beams=n_beams,
            lidar_range=self.lidar_range,
            max_speed=float(max_speed),
            max_acceleration=float(max_acceleration),
            restitution=float(restitution),
            goal_radius=float(goal_radius),
            start_radius=float(start_radius),
        )
        make_viewer = partial(
            MazeViewer,
            layout,
            n_beams=n_beams,
            beam_range=self.lidar_range,
            goal_radius=float(goal_radius),
        )
        super().__init__(
            MazeSimulation(layout, self.maze, self.lidar_range, n_threads=1),
            horizon=horizon,
            render_mode=render_mode,
            make_viewer=make_viewer,
        )

    # Without what the simulation of many needs, a step takes two thirds of the time.

    def _advance(self, action: Float32Array) -> tuple[bool, bool]:
        states, observations = self.simulation.states, self.simulation.observations
        success = step(self.simulation.maze, states[0], action, observations[0])
        self.simulation.success[0] = success
        return success, success

    def _info(self) -> dict[str, Any]:
        state = self.simulation.states[0].copy()
        return {"position": state[:2].copy(), "velocity": state[2:].copy(), "behavior": state}


class MazeVectorEnv(EpisodicVectorEnv):
    """An `EpisodicVectorEnv` of `MazeEnv`, with the same options of a reset."""

    layout: MazeLayout
    maze: Maze
    lidar_range: float
    single_class = MazeEnv
    settings = MazeEnv.settings
