"""Many robots at once: the state of all in arrays, one compiled call a step."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from curiosity_gym.compiled import ThreadPool, compiled
from curiosity_gym.maze.config import configure_maze, start_state
from curiosity_gym.maze.dynamics import N_BASE_FEATURES, Maze, observe, reset, step
from curiosity_gym.maze.layouts import MazeLayout
from curiosity_gym.maze.maze_env import FPS, MazeEnv
from curiosity_gym.maze.viewer import MazeViewer
from curiosity_gym.validation import check_at_least_one

Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

ENVS_PER_THREAD = 128
"""Fewer envs than this a thread: handing them over costs more than stepping them."""


@compiled
def _step_slice(
    maze: Maze,
    begin: int,
    end: int,
    states: Float64Array,
    steps: npt.NDArray[np.int64],
    resets: Mask,
    actions: Float32Array,
    observations: Float32Array,
    terminated: Mask,
) -> None:
    """Envs `begin` to `end`: step them, or begin an episode where `resets` says so."""
    for i in range(begin, end):
        if resets[i]:
            reset(maze, states[i], observations[i])
            steps[i] = 0
            terminated[i] = False
        else:
            terminated[i] = step(maze, states[i], actions[i], observations[i])
            steps[i] += 1


@compiled
def _observe_masked(
    maze: Maze, states: Float64Array, mask: Mask, observations: Float32Array
) -> None:
    for i in range(len(states)):
        if mask[i]:
            observe(maze, states[i], observations[i])


class MazeVectorEnv(VectorEnv[Float32Array, Float32Array, Mask]):
    """`num_envs` robots in the same maze; step for step what a `SyncVectorEnv` of `MazeEnv` gives.

    `gymnasium.make_vec(id, num_envs=n, vectorization_mode="vector_entry_point")` makes it.

    Args:
        layout: See `MazeEnv`, as for every keyword not named here.
        num_envs: Number of robots.
        autoreset_mode: When an env that ended is reset: an `AutoresetMode` or its value. With
            `DISABLED`, `reset(options={"reset_mask": mask})` does it.
        max_episode_steps: Stands for `horizon`, as `make_vec` knows it by this name.
        render_mode: "rgb_array" or None.
        copy: Hand out new arrays each step; False: the observations of a step are overwritten by
            the next.
        n_threads: None: as many as there are processors. Results do not depend on it.
        **kwargs: Keywords of `MazeEnv`.

    Raises:
        ValueError: If an argument is not what it may be.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": FPS}  # noqa: RUF012

    def __init__(
        self,
        layout: MazeLayout | str | os.PathLike[str] | None = None,
        *,
        num_envs: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        copy: bool = True,
        n_threads: int | None = None,
        **kwargs: Any,
    ) -> None:
        if max_episode_steps is not None:
            kwargs["horizon"] = max_episode_steps
        config = configure_maze(layout, **kwargs)
        check_at_least_one(num_envs=num_envs)
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f'`render_mode` must be None or "rgb_array", got {render_mode!r}.')
        self.num_envs = num_envs
        self._keywords = kwargs
        self.layout = config.layout
        self.maze = config.maze
        self.lidar_range = config.lidar_range
        self._make_viewer = config.make_viewer
        self.behavior_space = config.behavior_space
        self.coverage_grid = config.coverage_grid
        self.single_observation_space = config.observation_space
        self.single_action_space = config.action_space
        self.observation_space = batch_space(config.observation_space, num_envs)
        self.action_space = batch_space(config.action_space, num_envs)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**type(self).metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode
        self.copy = copy
        self._pool = ThreadPool(n_threads)
        self._viewer: MazeViewer | None = None
        self._states = np.tile(self.maze.start, (num_envs, 1))
        self._steps = np.full(num_envs, -1)  # no episode yet
        self._ended = np.zeros(num_envs, dtype=np.bool_)
        self._is_ready = False
        shape = (num_envs, N_BASE_FEATURES + len(self.maze.inverse_x))
        self._observations = np.zeros(shape, dtype=np.float32)

    def make_single_env(self) -> MazeEnv:
        """A single env of the same maze."""
        return MazeEnv(self.layout, **self._keywords)

    @property
    def horizon(self) -> int:
        """Steps after which an episode is truncated."""
        return self.maze.horizon

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Float32Array, dict[str, Any]]:
        """Begin episodes.

        Args:
            seed: As in Gymnasium; nothing here is random.
            options: `state`: x, y, vx, vy to start from; `reset_mask`: (num_envs,) bool, the envs
                to reset, None: all.

        Raises:
            ValueError: If seeds are not as many as envs, or an option is not what it may be.
        """
        if isinstance(seed, Sequence) and len(seed) != self.num_envs:
            raise ValueError(
                f"`seed` must hold {self.num_envs} seeds, one an env, got {len(seed)}."
            )
        mask = self._reset_mask(options)
        state = start_state(self.layout, self.maze, options)
        super().reset(seed=seed if isinstance(seed, int) else None)
        self._begin(mask, state)
        self._is_ready = bool((self._steps >= 0).all())
        return self._handed_out(), self._infos(mask)

    def _reset_mask(self, options: dict[str, Any] | None) -> Mask:
        mask = None if options is None else options.get("reset_mask")
        if mask is None:
            return np.ones(self.num_envs, dtype=np.bool_)
        is_mask = isinstance(mask, np.ndarray) and mask.dtype == np.bool_
        if not is_mask or mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(
                f'`options["reset_mask"]` must be a bool array of shape ({self.num_envs},) with at '
                "least one True."
            )
        return np.asarray(mask)

    def _begin(self, mask: Mask, state: Float64Array) -> None:
        """Begin an episode from `state` in the envs of `mask`."""
        self._states[mask] = state
        self._steps[mask] = 0
        self._ended = self._ended & ~mask
        _observe_masked(self.maze, self._states, mask, self._observations)

    def step(  # type: ignore[override]
        self, actions: Float32Array
    ) -> tuple[Float32Array, Float64Array, Mask, Mask, dict[str, Any]]:
        """Step every env once.

        Args:
            actions: (num_envs, 2), clipped to [-1, 1].

        Returns:
            Observations (num_envs, 4 + n_beams), rewards, terminations, truncations (num_envs,),
            and infos.

        Raises:
            ValueError: If the actions are not (num_envs, 2) finite numbers.
            gymnasium.error.ResetNeeded: Before the first reset, and with autoreset disabled while
                an env has ended.
        """
        actions = np.ascontiguousarray(actions, dtype=np.float32)
        if actions.shape != (self.num_envs, 2) or not np.isfinite(actions).all():
            raise ValueError(f"`actions` must be finite, of shape ({self.num_envs}, 2).")
        is_disabled = self.autoreset_mode == AutoresetMode.DISABLED
        if not self._is_ready or (is_disabled and self._ended.any()):
            raise ResetNeeded("Call reset() before step(): an env has no episode under way.")
        resets = self._ended
        terminated, truncated = self._advance(actions, resets)
        rewards = np.where(terminated, 1.0 - self._steps / self.horizon, 0.0)
        self._ended = terminated | truncated
        infos = self._infos(np.ones(self.num_envs, dtype=np.bool_), terminated)
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._ended.any():
            infos = self._reset_ended(infos)
        return self._handed_out(), rewards, terminated, truncated, infos

    def _handed_out(self) -> Float32Array:
        return self._observations.copy() if self.copy else self._observations

    def _advance(self, actions: Float32Array, resets: Mask) -> tuple[Mask, Mask]:
        """Step or reset all envs; which are terminated and truncated."""
        terminated = np.empty(self.num_envs, dtype=np.bool_)

        def run(begin: int, end: int) -> None:
            arrays = (self._states, self._steps, resets, actions, self._observations, terminated)
            _step_slice(self.maze, begin, end, *arrays)

        n_slices = min(self._pool.n_threads, self.num_envs // ENVS_PER_THREAD)
        self._pool.run(run, self.num_envs, n_slices)
        return terminated, ~terminated & (self._steps >= self.horizon)

    def _reset_ended(self, infos: dict[str, Any]) -> dict[str, Any]:
        """Same-step autoreset: the final observations and infos go into the infos."""
        ended = self._ended
        final_obs = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(ended):
            final_obs[i] = self._observations[i].copy()
        final_info = self._infos(ended, infos["is_success"])
        self._begin(ended, self.maze.start)
        return {
            "final_obs": final_obs,
            "_final_obs": ended.copy(),
            "final_info": final_info,
            "_final_info": ended.copy(),
            **self._infos(np.ones(self.num_envs, dtype=np.bool_), infos["is_success"] & ~ended),
        }

    def _infos(self, mask: Mask, is_success: Mask | None = None) -> dict[str, Any]:
        """Infos of the envs of `mask`, in the form that Gymnasium's vector environments give."""
        behavior = np.where(mask[:, None], self._states, 0.0)
        success = (
            np.zeros(self.num_envs, dtype=np.bool_) if is_success is None else is_success & mask
        )
        values = {
            "position": behavior[:, :2].copy(),
            "velocity": behavior[:, 2:].copy(),
            "behavior": behavior,
            "is_success": success,
        }
        infos: dict[str, Any] = {}
        for key, value in values.items():
            infos[key], infos[f"_{key}"] = value, mask.copy()
        return infos

    def render(self) -> tuple[npt.NDArray[np.uint8], ...] | None:
        """A frame (500, 500, 3) of each env for "rgb_array"."""
        if self.render_mode is None:
            gym.logger.warn("render() needs a render_mode: make the env with one.")
            return None
        if not self._is_ready:
            raise ResetNeeded("Call reset() before render().")
        if self._viewer is None:
            self._viewer = self._make_viewer()
        beams = self._observations[:, N_BASE_FEATURES:] * self.lidar_range
        return tuple(self._viewer.draw(*each) for each in zip(self._states, beams, strict=True))

    def close_extras(self, **kwargs: Any) -> None:
        """Let go of the viewer."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None
