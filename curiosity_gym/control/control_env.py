"""One control task, the Gymnasium environment."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from curiosity_gym.control.config import configure_control
from curiosity_gym.control.simulation import Simulation
from curiosity_gym.control.viewer import ControlViewer

Float32Array = npt.NDArray[np.float32]


class ControlEnv(gym.Env[Float32Array, Float32Array]):
    """A task of the DeepMind Control Suite from a fixed start, rewarded only when it is solved.

    Description:
        The control environments of "Curiosity creates Diversity in Policy Search" (section 4.1).
        Physics, observations and goals are dm_control's own, bit for bit; start, target and reward
        are the paper's. The task's own class, in `curiosity_gym.control.tasks`, says the rest:

        =================================== =========== ============ =======
        Id                                  `task`      observations actions
        =================================== =========== ============ =======
        `CuriosityControl-BallInCup-v0`     ball_in_cup 8            2
        `CuriosityControl-Finger-v0`        finger      12           2
        `CuriosityControl-Stacker-v0`       stacker     42           5
        =================================== =========== ============ =======

        `pip install "curiosity[control]"` installs what they need.

    Action Space:
        `Box(-1, 1, (A,), float32)`, a share of each actuator's strength. Actions outside are
        clipped; NaN and infinity are a `ValueError`.

    Observation Space:
        `Box` of shape `(O,)`, float32, unbounded: dm_control's observations, in its order.

    Behavior:
        `info["behavior"]`, of `behavior_space`. Coverage counts it in 50 cells a dimension
        (`coverage_grid`); which of them can be reached at all is not known.

    Rewards:
        `1 - t / horizon` on the step t that solves the task, and 0 on every other.

    Starting State:
        Always the same, at rest.

    Episode End:
        Terminated when the task is solved; truncated after `horizon` steps without it.

    Information:
        `behavior` (B,), float64, and `is_success`.

    Args:
        task: "ball_in_cup", "finger" or "stacker".
        horizon: Steps after which an episode is truncated.
        width: Of a frame, in pixels.
        height: Likewise.
        render_mode: "rgb_array" or None. `gym.make` also takes "human", and shows these frames in
            Gymnasium's own window.
        **kwargs: Keywords of the task: for stacker `success_threshold`.

    Raises:
        ValueError: If an argument is not what it may be.
        gymnasium.error.DependencyNotInstalled: If the extra `control` is not installed.

    Version History:
        * v0: Initial version.
    """

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(
        self, task: str | None = None, *, render_mode: str | None = None, **kwargs: Any
    ) -> None:
        config = configure_control(task, **kwargs)
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f'`render_mode` must be None or "rgb_array", got {render_mode!r}.')
        self.task = config.task
        self.horizon = config.horizon
        self._make_viewer = config.make_viewer
        self.observation_space = config.observation_space
        self.action_space = config.action_space
        self.behavior_space = config.behavior_space
        self.coverage_grid = config.coverage_grid
        self.metadata = {**type(self).metadata, "render_fps": config.fps}
        self.render_mode = render_mode
        self._simulation = Simulation(config.task, 1)
        self._viewer: ControlViewer | None = None
        self._t = -1

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32Array, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Of `np_random`, as in Gymnasium; nothing here is random.
            options: Unused.
        """
        super().reset(seed=seed)
        self._simulation.reset()
        self._t = 0
        return self._simulation.observations[0].copy(), self._info(is_success=False)

    def step(self, action: Float32Array) -> tuple[Float32Array, float, bool, bool, dict[str, Any]]:
        """Act for one control step.

        Args:
            action: (A,), clipped to [-1, 1].

        Raises:
            ValueError: If the action is not A finite numbers.
            gymnasium.error.ResetNeeded: If no episode is under way.
            SimulationError: If the physics became unstable.
        """
        action = np.asarray(action, dtype=np.float32)
        if action.shape != self.action_space.shape or not np.isfinite(action).all():
            raise ValueError(f"`action` must be {self.task.n_actions} finite numbers.")
        if not 0 <= self._t < self.horizon:
            raise ResetNeeded("Call reset() before step(): no episode is under way.")
        t, self._t = self._t + 1, -1  # no episode is under way where the simulation fails
        terminated = bool(self._simulation.step(action[None])[0])
        truncated = not terminated and t == self.horizon
        self._t = self.horizon if terminated else t
        reward = 1.0 - t / self.horizon if terminated else 0.0
        observation = self._simulation.observations[0].copy()
        return observation, reward, terminated, truncated, self._info(terminated)

    def _info(self, is_success: bool) -> dict[str, Any]:
        return {"behavior": self._simulation.behaviors[0], "is_success": is_success}

    def render(self) -> npt.NDArray[np.uint8] | None:
        """A frame (height, width, 3) for "rgb_array"."""
        if self.render_mode is None:
            gym.logger.warn("render() needs a render_mode: make the env with one.")
            return None
        if self._t < 0:
            raise ResetNeeded("Call reset() before render().")
        if self._viewer is None:
            self._viewer = self._make_viewer()
        return self._viewer.draw(self._simulation)

    def __getstate__(self) -> dict[str, Any]:
        """Pickle without the renderer, which belongs to its process."""
        return {**self.__dict__, "_viewer": None}

    def close(self) -> None:
        """Free the renderer, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None
