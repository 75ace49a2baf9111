"""The keywords of the control environments, checked for single and vector environments alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gymnasium import spaces

from curiosity_gym.control.tasks import TASKS, ControlTask
from curiosity_gym.mujoco_viewer import MujocoConfig
from curiosity_gym.validation import check_at_least_one, check_choice


@dataclass(frozen=True)
class ControlConfig(MujocoConfig):
    """A checked task, its spaces and its viewer."""

    task: ControlTask

    @property
    def observation_space(self) -> spaces.Box[np.float32]:
        """Unbounded: positions and velocities have no limits of their own."""
        return spaces.Box(-np.inf, np.inf, (self.task.n_observations,), np.float32)

    @property
    def action_space(self) -> spaces.Box[np.float32]:
        """Every actuator's range."""
        return spaces.Box(-1.0, 1.0, (self.task.n_actions,), np.float32)

    @property
    def fps(self) -> int:
        """Control steps a second."""
        return round(1.0 / float(self.task.model.opt.timestep * self.task.n_substeps))


def configure_control(
    task: str | None = None,
    *,
    horizon: int = 1000,
    width: int = 320,
    height: int = 240,
    success_threshold: float | None = None,
    random_start: bool = False,
) -> ControlConfig:
    """Check the keywords of `ControlEnv`, where they are explained.

    Raises:
        ValueError: If one of them is not what it may be.
        TypeError: If `success_threshold` is given for another task than stacker.
        gymnasium.error.DependencyNotInstalled: If the extra `control` is not installed.
    """
    check_choice(tuple(TASKS), task=task)
    check_at_least_one(horizon=horizon, width=width, height=height)
    assert task is not None
    own = {} if success_threshold is None else {"success_threshold": success_threshold}
    made = TASKS[task](random_start=random_start, **own)
    return ControlConfig(int(horizon), int(width), int(height), made)
