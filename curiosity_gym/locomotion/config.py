"""The keywords of the locomotion environments, checked for single and vector environments alike."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from curiosity_gym.core import CoverageGrid
from curiosity_gym.extras import import_extra
from curiosity_gym.locomotion.tasks import TASKS, LocomotionTask
from curiosity_gym.locomotion.worlds import World
from curiosity_gym.maze.layouts import MazeLayout
from curiosity_gym.mujoco_viewer import MujocoViewer
from curiosity_gym.validation import check_at_least_one, check_bool, check_choice


@dataclass(frozen=True)
class LocomotionConfig:
    """A checked task, its spaces and its viewer."""

    task: LocomotionTask
    sparse: bool
    horizon: int
    width: int
    height: int

    @property
    def observation_space(self) -> spaces.Box[np.float64]:
        """Gymnasium's own, after where in its world the robot is."""
        space: spaces.Box[np.float64] = self.task.observation_space
        return space

    @property
    def action_space(self) -> spaces.Box[np.float32]:
        """Gymnasium's own."""
        space: spaces.Box[np.float32] = self.task.action_space
        return space

    @property
    def behavior_space(self) -> spaces.Box[np.float64]:
        """Bounds of `info["behavior"]`."""
        return spaces.Box(self.task.behavior_low, self.task.behavior_high, dtype=np.float64)

    @property
    def coverage_grid(self) -> CoverageGrid:
        """The cells of the behavior that coverage counts."""
        assert self.task.coverage_grid is not None
        return self.task.coverage_grid

    @property
    def fps(self) -> int:
        """Steps a second."""
        return round(1.0 / self.task.dt)

    def make_viewer(self) -> MujocoViewer:
        """A new viewer of the robot."""
        return MujocoViewer(self.task.model, width=self.width, height=self.height)


def configure_locomotion(
    env_id: str | None = None,
    *,
    behavior: str = "position",
    world: MazeLayout | str | os.PathLike[str] | None = None,
    sparse: bool = False,
    horizon: int = 1000,
    width: int = 320,
    height: int = 240,
    env_kwargs: Mapping[str, Any] | None = None,
) -> LocomotionConfig:
    """Check the keywords of `LocomotionEnv`, where they are explained.

    Raises:
        ValueError: If one of them is not what it may be.
        TypeError: If Gymnasium's environment does not know one of `env_kwargs`.
        gymnasium.error.DependencyNotInstalled: If the extra `locomotion` is not installed.
    """
    check_choice(tuple(TASKS), env_id=env_id)
    check_bool(sparse=sparse)
    if sparse and world is None:
        raise ValueError("`sparse` must be False where there is no `world`, and so no goal.")
    check_at_least_one(horizon=horizon, width=width, height=height)
    assert env_id is not None
    if "render_mode" in (env_kwargs or {}):
        raise ValueError("`env_kwargs` must not hold `render_mode`, which is an argument itself.")
    import_extra("locomotion", "mujoco", "imageio")
    original: gym.Env[Any, Any] = gym.make(env_id, disable_env_checker=True, **(env_kwargs or {}))
    made = None if world is None else World(world)
    task = TASKS[env_id](original, behavior=behavior, world=made)
    return LocomotionConfig(task, bool(sparse), int(horizon), int(width), int(height))
