"""The base of this package's single environments: episodes, rewards, pictures."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import gymnasium as gym
from gymnasium.error import ResetNeeded

from curiosity_gym.core import Float32Array, FloatArray, Frame
from curiosity_gym.fixed import FixedSettings
from curiosity_gym.simulation import BaseSimulation
from curiosity_gym.validation import as_float32, check_render_mode


class EpisodicEnv(FixedSettings, gym.Env[FloatArray, Float32Array]):
    """Episodes of one simulation; success in step t is rewarded `1 - t / horizon`.

    Unless it is `sparse`, rewards are those of the simulation. `make_viewer` makes what draws it.
    """

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(
        self,
        simulation: BaseSimulation,
        *,
        horizon: int,
        render_mode: str | None,
        make_viewer: Callable[[], Any],
        sparse: bool = True,
    ) -> None:
        check_render_mode(render_mode=render_mode)
        self.simulation = simulation
        self.observation_space = simulation.observation_space
        self.action_space = simulation.action_space
        self.behavior_space = simulation.behavior_space
        self.behavior_names = simulation.behavior_names
        self.coverage_grid = simulation.coverage_grid
        self.horizon = int(horizon)
        self.sparse = bool(sparse)
        self.metadata = {**type(self).metadata, "render_fps": simulation.fps}
        self.render_mode = render_mode
        self._make_viewer = make_viewer
        self._action_shape = simulation.action_space.shape
        self._t = -1  # no episode yet
        self._ended = False

    # -- episodes ---------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Begin an episode; see Gymnasium, and the class for its options."""
        super().reset(seed=seed)
        rngs = [self.np_random] if self.simulation.draws else []
        self.simulation.reset(rngs=rngs, options=options)
        self._t, self._ended = 0, False
        return self.simulation.observations[0].copy(), self._info() | {"is_success": False}

    def _info(self) -> dict[str, Any]:
        return {name: value[0] for name, value in self.simulation.info.items()}

    def step(self, action: Float32Array) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Act for one step; an action beyond the action space acts as far as that goes.

        Raises:
            ValueError: If the action is not A finite numbers.
            gymnasium.error.ResetNeeded: If no episode is under way.
            SimulationError: If the physics of a control task became unstable.
        """
        array = as_float32(action)
        # Python's own loop checks a few numbers faster than an array function.
        if array.shape != self._action_shape or not all(map(math.isfinite, array.tolist())):
            raise ValueError(
                f"`action` must be {self._action_shape[0]} finite numbers, got {action!r:.60}."
            )
        if self._t < 0 or self._ended:
            raise ResetNeeded("Call reset() before step(): no episode is under way.")
        t, self._t = self._t + 1, -1  # no episode is under way, should the physics fail
        terminated, success = self._advance(array)
        reward = self._reward(success, t)
        truncated = not terminated and t == self.horizon
        self._t, self._ended = t, terminated or truncated
        info = self._info()
        for name, values in self.simulation.outcome.items():
            info[name] = values[0]
        info["is_success"] = success
        return self.simulation.observations[0].copy(), reward, terminated, truncated, info

    def _advance(self, action: Float32Array) -> tuple[bool, bool]:
        """Step the simulation; whether the episode is terminated, and a success."""
        terminated = self.simulation.step(action[None])
        return bool(terminated[0]), bool(self.simulation.success[0])

    def _reward(self, success: bool, t: int) -> float:
        if not vars(self)["sparse"]:  # directly: every step reads it
            return float(self.simulation.rewards[0])
        return 1.0 - t / self.horizon if success else 0.0

    def set_wrapper_attr(self, name: str, value: Any, *, force: bool = True) -> bool:
        """See Gymnasium; it would set on a wrapper what cannot be changed here."""
        return super().set_wrapper_attr(name, value, force=force or hasattr(type(self), name))

    # -- pictures ---------------------------------------------------------------------------------

    def render(self) -> Frame | None:
        """A frame (height, width, 3) for "rgb_array"."""
        if self.render_mode is None:
            gym.logger.warn("render() needs a render_mode: make the env with one.")
            return None
        if self._t < 0:
            raise ResetNeeded("Call reset() before render().")
        return self.simulation.draw(self.viewer, 0)

    @cached_property
    def viewer(self) -> Any:
        """The viewer of the simulation."""
        return self._make_viewer()

    def close(self) -> None:
        """Drop the viewer; the next picture makes another."""
        vars(self).pop("viewer", None)

    def __getstate__(self) -> dict[str, Any]:
        """Pickle and copy without the viewer, which belongs to its process."""
        return {name: value for name, value in vars(self).items() if name != "viewer"}
