"""Many robots at once: the state of all in arrays, one compiled call a step."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from curiosity_gym.compiled import ThreadPool, compiled
from curiosity_gym.core import Float32Array, Float64Array, FloatArray, Frame, Mask
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.layouts import GOAL_RADIUS, MazeLayout
from curiosity_gym.maze.config import check_states, configure_maze, start_state
from curiosity_gym.maze.dynamics import N_BASE_FEATURES, Maze, observe, reset, step
from curiosity_gym.maze.maze_env import MazeEnv

ENVS_PER_THREAD = 128
"""Least number of envs a thread: handing fewer over costs more than stepping them."""


@compiled
def _step_slice(
    maze: Maze,
    begin: int,
    end: int,
    states: Float64Array,
    resets: Mask,
    actions: Float32Array,
    observations: Float32Array,
    terminated: Mask,
) -> None:
    """Envs `begin` to `end`: step them, or begin an episode where `resets` says so."""
    for i in range(begin, end):
        if resets[i]:
            reset(maze, states[i], observations[i])
            terminated[i] = False
        else:
            terminated[i] = step(maze, states[i], actions[i], observations[i])


@compiled
def _observe_masked(
    maze: Maze, states: Float64Array, mask: Mask, observations: Float32Array
) -> None:
    for i in range(len(states)):
        if mask[i]:
            observe(maze, states[i], observations[i])


class MazeVectorEnv(EpisodicVectorEnv):
    """`num_envs` robots in the same maze; step for step what a `SyncVectorEnv` of `MazeEnv` gives.

    `gymnasium.make_vec(id, num_envs=n, vectorization_mode="vector_entry_point")` makes it.
    `reset(options={"state": (x, y, vx, vy)})` starts elsewhere.

    The other arguments are those of `MazeEnv`.

    Args:
        num_envs: Number of episodes side by side.
        autoreset_mode: When an env that ended is reset: an `AutoresetMode` or its value. With
            `DISABLED`, `reset(options={"reset_mask": mask})` does it.
        max_episode_steps: Truncates episodes after so many steps, as the `TimeLimit` of
            `gymnasium.make` does; the reward stays that of the horizon. None or -1: no such limit.
        render_mode: "rgb_array" or None.
        copy: Hand out new arrays each step; False: the observations of a step are overwritten by
            the next.
        n_threads: None: as many as there are processors. Results do not depend on it.

    Raises:
        ValueError: If an argument is not what it may be.
    """

    _single_class = MazeEnv

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
        num_envs: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        copy: bool = True,
        n_threads: int | None = None,
    ) -> None:
        keywords: dict[str, Any] = {
            "horizon": horizon,
            "max_speed": max_speed,
            "max_acceleration": max_acceleration,
            "n_beams": n_beams,
            "lidar_range": lidar_range,
            "restitution": restitution,
            "goal_radius": goal_radius,
        }
        config = configure_maze(layout, **keywords)
        super().__init__(
            config,
            num_envs=num_envs,
            autoreset_mode=autoreset_mode,
            max_episode_steps=max_episode_steps,
            render_mode=render_mode,
            copy=copy,
        )
        self._keywords = {"layout": config.layout, **keywords}
        self.layout = config.layout
        self.maze = config.maze
        self.lidar_range = config.lidar_range
        self._pool = ThreadPool(n_threads)
        self._states = np.tile(self.maze.start, (num_envs, 1))

    def _begin(self, mask: Mask, options: dict[str, Any] | None) -> None:
        self._states[mask] = start_state(self.layout, self.maze, options)
        _observe_masked(self.maze, self._states, mask, self._observations)

    def _advance(self, actions: Float32Array, resets: Mask) -> tuple[Mask, Mask]:
        at_goal = np.empty(self.num_envs, dtype=np.bool_)

        def run(begin: int, end: int) -> None:
            arrays = (self._states, resets, actions, self._observations, at_goal)
            _step_slice(self.maze, begin, end, *arrays)

        n_slices = min(self._pool.n_threads, self.num_envs // ENVS_PER_THREAD)
        self._pool.run(run, self.num_envs, n_slices)
        return at_goal, at_goal

    def _info_arrays(self) -> dict[str, Float64Array]:
        return {
            "position": self._states[:, :2].copy(),
            "velocity": self._states[:, 2:].copy(),
            "behavior": self._states.copy(),
        }

    def _physics(self) -> Float64Array:
        return self._states.copy()

    def _set_physics(self, physics: Float64Array, observations: FloatArray) -> None:
        check_states(self.layout, self.maze, physics, observations)
        self._states = physics

    def _frames(self) -> tuple[Frame, ...]:
        beams = self._observations[:, N_BASE_FEATURES:] * self.lidar_range
        viewer = self._viewer.get()
        return tuple(viewer.draw(*each) for each in zip(self._states, beams, strict=True))
