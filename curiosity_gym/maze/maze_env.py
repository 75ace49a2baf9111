"""One robot in a maze, the Gymnasium environment."""

from __future__ import annotations

import os
from typing import Any

from curiosity_gym.core import Float32Array, Float64Array, FloatArray, Frame
from curiosity_gym.episodic_env import EpisodicEnv
from curiosity_gym.layouts import GOAL_RADIUS, MazeLayout
from curiosity_gym.maze.config import check_states, configure_maze, start_state
from curiosity_gym.maze.dynamics import N_BASE_FEATURES, observe, step


class MazeEnv(EpisodicEnv):
    """A point robot with a ring of LIDAR beams looks for the goal of a maze, rewarded only there.

    Description:
        The environment of "Curiosity creates Diversity in Policy Search" (section 4.1). The robot,
        a square of half-width 1, accelerates through a world of axis-aligned walls. It never enters
        a wall, whatever its speed: on contact it stops at the wall and slides along it. Dynamics
        and start are deterministic. Lengths are in maze units, times in seconds.

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
        At the layout's start, at rest; `reset(options={"state": (x, y, vx, vy)})` starts elsewhere.

    Episode End:
        Terminated at the goal; truncated after `horizon` steps without it.

    Information:
        `position` (2,), `velocity` (2,), `behavior` (4,), float64, and `is_success`.

    Args:
        layout: "snake", "us", "hard", "labyrinth", a `MazeLayout`, a path to its `.json` file, or
            ASCII text. The ids give it, but for `CuriosityMaze-v0`, which needs it.
        horizon: Steps after which an episode is truncated, and the T of the reward `1 - t / T`.
        max_speed: Bound of each velocity component (maze units per s).
        max_acceleration: Acceleration of an action of 1 (maze units per s^2).
        n_beams: Number of LIDAR beams.
        lidar_range: Reach of the beams (maze units); None: 20 % of the map's diagonal.
        restitution: Share of the velocity into a wall that bounces back, from 0 (it stops there) to
            1. Bouncing robots find most goals by chance.
        goal_radius: How near the goal is near enough (maze units).
        render_mode: "rgb_array", "human" (a pygame window), or None.

    Raises:
        ValueError: If an argument is not what it may be, or the layout is malformed.

    Version History:
        * v0: Initial version.
    """

    metadata = {"render_modes": ["human", "rgb_array"]}  # noqa: RUF012

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
        render_mode: str | None = None,
    ) -> None:
        config = configure_maze(
            layout,
            horizon=horizon,
            max_speed=max_speed,
            max_acceleration=max_acceleration,
            n_beams=n_beams,
            lidar_range=lidar_range,
            restitution=restitution,
            goal_radius=goal_radius,
        )
        super().__init__(config, render_mode)
        self.layout = config.layout
        self.maze = config.maze
        self.lidar_range = config.lidar_range
        self._state = self.maze.start.copy()

    def _begin(self, options: dict[str, Any] | None) -> None:
        self._state = start_state(self.layout, self.maze, options)
        observe(self.maze, self._state, self._observation)

    def _advance(self, action: Float32Array) -> tuple[bool, bool]:
        is_at_goal = step(self.maze, self._state, action, self._observation)
        return is_at_goal, is_at_goal

    def _info_arrays(self) -> dict[str, Float64Array]:
        behavior = self._state.copy()
        return {
            "position": behavior[:2].copy(),
            "velocity": behavior[2:].copy(),
            "behavior": behavior,
        }

    def _physics(self) -> Float64Array:
        return self._state.copy()

    def _set_physics(self, physics: Float64Array, observation: FloatArray) -> None:
        check_states(self.layout, self.maze, physics[None], observation[None])
        self._state = physics

    def _frame(self) -> Frame:
        beams = self._observation[N_BASE_FEATURES:] * self.lidar_range
        frame: Frame = self._viewer.get().draw(self._state, beams)
        return frame

    def _show(self, frame: Frame) -> None:
        self._viewer.get().show(frame)
