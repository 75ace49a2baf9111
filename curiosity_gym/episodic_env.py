"""The base of this package's single environments: episodes, rewards, pictures."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded

from curiosity_gym.core import EnvConfig, Float32Array, Float64Array, FloatArray, Frame
from curiosity_gym.episode_state import (
    check_generators,
    check_steps,
    checked_state,
    generator_states,
    load_generator_states,
)
from curiosity_gym.lazy_viewer import LazyViewer


class EpisodicEnv(gym.Env[FloatArray, Float32Array]):
    """Episodes; success in step t is rewarded `1 - t / horizon`, unless a subclass does otherwise.

    A subclass says how an episode begins and advances: `_begin`, `_advance`, `_info_arrays`,
    `_physics`, `_set_physics`, `_frame`, for "human" `_show`, `_generators` if it draws, and
    `_reward` if that is another.

    Args:
        config: Spaces, horizon and frame rate.
        render_mode: None, or one of the subclass' `metadata["render_modes"]`.

    Raises:
        ValueError: If the mode is another.
    """

    def __init__(self, config: EnvConfig, render_mode: str | None) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(
                f"`render_mode` must be None or one of {self.metadata['render_modes']}, "
                f"got {render_mode!r}."
            )
        self.observation_space = config.observation_space
        self.action_space = config.action_space
        self.behavior_space = config.behavior_space
        self.coverage_grid = config.coverage_grid
        self.horizon = config.horizon
        self.metadata = {**type(self).metadata, "render_fps": config.fps}
        self.render_mode = render_mode
        self._viewer: LazyViewer[Any] = LazyViewer(config.make_viewer)
        self._action_shape = config.action_space.shape
        space = config.observation_space
        self._observation: FloatArray = np.zeros(space.shape, space.dtype)
        self._t = -1  # no episode yet
        self._ended = False

    # -- what a subclass implements ---------------------------------------------------------------

    @abstractmethod
    def _begin(self, options: dict[str, Any] | None) -> None:
        """Begin an episode and write its first `_observation`; check options before."""

    @abstractmethod
    def _advance(self, action: Float32Array) -> tuple[bool, bool]:
        """Act and write `_observation`; whether the episode ended, and whether at the goal."""

    @abstractmethod
    def _info_arrays(self) -> dict[str, Float64Array]:
        """New arrays for the info, "behavior" among them."""

    @abstractmethod
    def _physics(self) -> Float64Array:
        """All that the next step depends on, a new array (S,), finite."""

    @abstractmethod
    def _set_physics(self, physics: Float64Array, observation: FloatArray) -> None:
        """Go on from a result of `_physics`, to keep; ValueError, unchanged, if it cannot be."""

    @abstractmethod
    def _frame(self) -> Frame:
        """A picture (height, width, 3)."""

    def _generators(self) -> list[np.random.Generator]:
        """What is drawn from: part of the episode's state."""
        return []

    def _reward(self, success: bool, t: int) -> float:
        """Of step t, the first being 1, that has just been taken."""
        return 1.0 - t / self.horizon if success else 0.0

    def _outcome_arrays(self) -> dict[str, Any]:
        """What the info tells of a step beside `_info_arrays`, and a reset does not."""
        return {}

    # -- episodes ---------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Of `np_random`, as in Gymnasium, which random starts are drawn from.
            options: The options that the class documents, if any.

        Raises:
            ValueError: If an option is not what it may be.
        """
        super().reset(seed=seed)
        self._begin(options)
        self._t, self._ended = 0, False
        if self.render_mode == "human":
            self.render()
        return self._observation.copy(), {**self._info_arrays(), "is_success": False}

    def step(self, action: Float32Array) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Act for one step.

        Args:
            action: (A,), rounded to float32. Beyond the action space it acts as far as that goes.

        Raises:
            ValueError: If the action is not A finite numbers.
            gymnasium.error.ResetNeeded: If no episode is under way.
            SimulationError: If the physics of a control task became unstable.
        """
        action = np.asarray(action, dtype=np.float32)
        # Python's own loop: a few numbers are checked before an array function has begun.
        if action.shape != self._action_shape or not all(map(math.isfinite, action.tolist())):
            raise ValueError(
                f"`action` must be {self._action_shape[0]} finite numbers, got {action!r}."
            )
        if self._t < 0 or self._ended:
            raise ResetNeeded("Call reset() before step(): no episode is under way.")
        t, self._t = self._t + 1, -1  # no episode is under way, should the physics fail
        terminated, success = self._advance(action)
        reward = self._reward(success, t)
        truncated = not terminated and t == self.horizon
        self._t, self._ended = t, terminated or truncated
        if self.render_mode == "human":
            self.render()
        info = {**self._info_arrays(), **self._outcome_arrays(), "is_success": success}
        return self._observation.copy(), reward, terminated, truncated, info

    # -- exact resume -----------------------------------------------------------------------------

    def state_dict(self) -> dict[str, Any]:
        """The episode as it stands, under way or just ended, for `load_state_dict`.

        The generators of the spaces are not part of it, nor is `np_random` of an environment that
        draws nothing.

        Returns:
            `steps`, an int, the steps taken; `ended`, a bool, whether the last of them ended the
            episode; `observation`, the last, (O,); `physics`, (S,) float64; and, if starts
            are random, `generators`, (1, 6) uint64, the state of `np_random`. The arrays are new.

        Raises:
            gymnasium.error.ResetNeeded: Before the first reset, and after the physics failed.
        """
        if self._t < 0:
            raise ResetNeeded("Call reset() before state_dict(): there is no episode.")
        return self._snapshot()

    def _snapshot(self) -> dict[str, Any]:
        observation, physics = self._observation.copy(), self._physics()
        own = {"steps": self._t, "ended": self._ended}
        drawn = generator_states(self._generators())
        return {**own, "observation": observation, "physics": physics, **drawn}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go on from what `state_dict` gave, here or elsewhere: the same bits from there on.

        No reset is needed before; the wrappers of `gym.make` ask for one before they step, though.

        Args:
            state: Of an environment made with the same keywords; its arrays are copied.

        Raises:
            ValueError: If it is not a state of such an environment; nothing has changed then.
        """
        own = checked_state(state, self._snapshot())
        check_steps(own["steps"], own["ended"], self.horizon)
        check_generators(own)
        self._set_physics(own["physics"], own["observation"])
        self._observation = own["observation"]
        self._t, self._ended = int(own["steps"]), bool(own["ended"])
        load_generator_states(self._generators(), own)

    # -- pictures ---------------------------------------------------------------------------------

    def render(self) -> Frame | None:
        """A frame (height, width, 3) for "rgb_array"; shown in a window for "human"."""
        if self.render_mode is None:
            gym.logger.warn("render() needs a render_mode: make the env with one.")
            return None
        if self._t < 0:
            raise ResetNeeded("Call reset() before render().")
        frame = self._frame()
        if self.render_mode == "human":
            self._show(frame)
            return None
        return frame

    def _show(self, frame: Frame) -> None:
        """Show a picture in a window."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the viewer and its window, if there is one."""
        self._viewer.close()
