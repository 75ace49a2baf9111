"""The keywords of the locomotion environments, checked for single and vector environments alike."""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import load_env_creator

from curiosity_gym.extras import import_extra
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.locomotion.simulation import LocomotionSimulation
from curiosity_gym.locomotion.tasks import BEHAVIORS, TASKS, LocomotionTask
from curiosity_gym.locomotion.worlds import World
from curiosity_gym.mujoco_viewer import MujocoConfig
from curiosity_gym.validation import check_at_least_one, check_bool, check_choice

OF_PICTURES = {
    "camera_id",
    "camera_name",
    "default_camera_config",
    "height",
    "max_geom",
    "render_mode",
    "visual_options",
    "width",
}
"""Keywords of Gymnasium's environments that say what its own pictures are like."""


@dataclass(frozen=True)
class LocomotionConfig(MujocoConfig):
    """A checked task, its spaces and its viewer."""

    task: LocomotionTask
    sparse: bool

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
    def fps(self) -> int:
        """Steps a second."""
        return round(1.0 / self.task.dt)


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
        gymnasium.error.DependencyNotInstalled: If the extra `locomotion` is not installed.
    """
    check_choice(tuple(TASKS), env_id=env_id)
    check_bool(sparse=sparse)
    if sparse and world is None:
        raise ValueError("`sparse` must be False where there is no `world`, and so no goal.")
    check_at_least_one(horizon=horizon, width=width, height=height)
    assert env_id is not None
    check_choice(BEHAVIORS, behavior=behavior)
    original = _make_original(TASKS[env_id], env_kwargs)
    made = None if world is None else World(world)
    task = TASKS[env_id](original, behavior=behavior, world=made)
    _try(task)
    return LocomotionConfig(int(horizon), int(width), int(height), task, bool(sparse))


def _make_original(task: type[LocomotionTask], keywords: object) -> gym.Env[Any, Any]:
    """Gymnasium's environment, of its own class: anybody can register another by its id."""
    given = {} if keywords is None else keywords
    if not isinstance(given, Mapping):
        raise ValueError(f"`env_kwargs` must be a dictionary or None, got {given!r:.60}.")
    of_pictures = sorted(OF_PICTURES & set(given))
    if of_pictures:
        raise ValueError(
            f"`env_kwargs` must not hold {', '.join(of_pictures)}: `width`, `height` and "
            "`render_mode` say what pictures are like."
        )
    check_at_least_one(**{"env_kwargs['frame_skip']": given.get("frame_skip", 1)})
    import_extra("locomotion", "mujoco", "imageio")
    make = load_env_creator(task.entry_point)
    with _options_of(task.env_id):
        original: gym.Env[Any, Any] = make(**copy.deepcopy(dict(given)))  # type: ignore[assignment]
    return original


def _try(task: LocomotionTask) -> None:
    """See that the task can be begun and stepped: Gymnasium checks none of its options."""
    with _options_of(task.env_id):
        simulation = LocomotionSimulation(task, 1, n_threads=1)
        simulation.reset(np.arange(1), [np.random.default_rng(0)])
        simulation.step(np.zeros((1, task.n_actions), np.float32))


@contextmanager
def _options_of(env_id: str) -> Iterator[None]:
    """Errors of any kind, as a sentence."""
    try:
        yield
    except Exception as error:
        raise ValueError(
            f"`env_kwargs` must be what Gymnasium's {env_id} can be made and stepped with "
            f"({type(error).__name__}: {error})."
        ) from error
