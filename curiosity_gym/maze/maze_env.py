"""One robot in a maze, the Gymnasium environment."""

from __future__ import annotations

import math
import os
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from curiosity_gym.maze.config import FPS, configure_maze, start_state
from curiosity_gym.maze.dynamics import N_BASE_FEATURES, observe, step
from curiosity_gym.maze.layouts import MazeLayout
from curiosity_gym.maze.viewer import MazeViewer

Observation = npt.NDArray[np.float32]


class MazeEnv(gym.Env[Observation, npt.NDArray[np.float32]]):
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
            ASCII text.
        horizon: Steps after which an episode is truncated.
        max_speed: Bound of each velocity component.
        max_acceleration: Acceleration of an action of 1.
        n_beams: Number of LIDAR beams.
        lidar_range: Reach of the beams; None: 20 % of the map's diagonal.
        restitution: Share of the velocity into a wall that bounces back, from 0 (it stops there) to
            1. Bouncing robots find most goals by chance.
        goal_radius: How near the goal is near enough.
        render_mode: "rgb_array", "human" (a pygame window), or None.

    Raises:
        ValueError: If an argument is not what it may be, or the layout is malformed.

    Version History:
        * v0: Initial version.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": FPS}  # noqa: RUF012

    def __init__(
        self,
        layout: MazeLayout | str | os.PathLike[str] | None = None,
        *,
        render_mode: str | None = None,
        **kwargs: Any,
    ) -> None:
        config = configure_maze(layout, **kwargs)
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(
                f"`render_mode` must be None or one of {self.metadata['render_modes']}, "
                f"got {render_mode!r}."
            )
        self.layout = config.layout
        self.maze = config.maze
        self.lidar_range = config.lidar_range
        self._make_viewer = config.make_viewer
        self.observation_space = config.observation_space
        self.action_space = config.action_space
        self.behavior_space = config.behavior_space
        self.coverage_grid = config.coverage_grid
        self.render_mode = render_mode
        self._viewer: MazeViewer | None = None
        self._n_features = N_BASE_FEATURES + len(self.maze.inverse_x)
        self._state = self.maze.start.copy()
        self._t = -1

    @property
    def horizon(self) -> int:
        """Steps after which an episode is truncated."""
        return self.maze.horizon

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Of `np_random`, as in Gymnasium; nothing here is random.
            options: `state`: x, y, vx, vy to start from, instead of the layout's start at rest.

        Raises:
            ValueError: If the state is inside a wall, too fast, or not four finite numbers.
        """
        state = start_state(self.layout, self.maze, options)
        super().reset(seed=seed)
        self._state = state
        self._t = 0
        self._observation = np.empty(self._n_features, dtype=np.float32)
        observe(self.maze, self._state, self._observation)
        if self.render_mode == "human":
            self.render()
        return self._observation.copy(), self._info(is_success=False)

    def step(
        self, action: npt.NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Accelerate for one step.

        Args:
            action: (2,), clipped to [-1, 1].

        Raises:
            ValueError: If the action is not two finite numbers.
            gymnasium.error.ResetNeeded: If no episode is under way.
        """
        action = np.asarray(action, dtype=np.float32)
        if action.shape != (2,) or not (math.isfinite(action[0]) and math.isfinite(action[1])):
            raise ValueError(f"`action` must be 2 finite numbers, got {action!r}.")
        if not 0 <= self._t < self.maze.horizon:
            raise ResetNeeded("Call reset() before step(): no episode is under way.")
        observation = np.empty(self._n_features, dtype=np.float32)
        terminated = step(self.maze, self._state, action, observation)
        self._t += 1
        self._observation = observation
        reward = 1.0 - self._t / self.maze.horizon if terminated else 0.0
        truncated = not terminated and self._t == self.maze.horizon
        if terminated:
            self._t = self.maze.horizon
        if self.render_mode == "human":
            self.render()
        return observation.copy(), reward, terminated, truncated, self._info(terminated)

    def _info(self, is_success: bool) -> dict[str, Any]:
        behavior = self._state.copy()
        return {
            "position": behavior[:2].copy(),
            "velocity": behavior[2:].copy(),
            "behavior": behavior,
            "is_success": is_success,
        }

    def render(self) -> npt.NDArray[np.uint8] | None:
        """A frame (500, 500, 3) for "rgb_array"; shown in a window for "human"."""
        if self.render_mode is None:
            gym.logger.warn("render() needs a render_mode: make the env with one.")
            return None
        if self._t < 0:
            raise ResetNeeded("Call reset() before render().")
        if self._viewer is None:
            self._viewer = self._make_viewer()
        beams = self._observation[N_BASE_FEATURES:] * self.lidar_range
        frame = self._viewer.draw(self._state, beams)
        if self.render_mode == "human":
            self._viewer.show(frame)
            return None
        return frame

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None
