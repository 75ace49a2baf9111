"""The tasks of Gymnasium's environments, made with the options that a user gives."""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import load_env_creator

from curiosity_gym.extras import import_extra
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.locomotion.simulation import LocomotionSimulation
from curiosity_gym.locomotion.tasks import BEHAVIORS, TASKS, LocomotionTask
from curiosity_gym.locomotion.worlds import World
from curiosity_gym.validation import check_at_least_one, check_choice

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


def make_simulation(
    env_id: str,
    behavior: str,
    world: MazeLayout | str | os.PathLike[str] | None,
    env_kwargs: Mapping[str, Any] | None,
) -> LocomotionSimulation:
    """One simulation of the arguments of `LocomotionEnv`, where they and the errors are explained.

    It was begun and stepped: Gymnasium checks none of its options.
    """
    check_choice(BEHAVIORS, behavior=behavior)
    with closing(_make_original(TASKS[env_id], env_kwargs)) as original:
        walls = None if world is None else World(world)
        task = TASKS[env_id](original, behavior=behavior, world=walls)
    with _options_of(env_id, env_kwargs):
        simulation = LocomotionSimulation(task, 1, n_threads=1)
        simulation.reset(rngs=[np.random.default_rng(0)])
        simulation.step(np.zeros((1, task.n_actions), np.float32))
    return simulation


def _make_original(task: type[LocomotionTask], keywords: object) -> gym.Env[Any, Any]:
    """Gymnasium's environment, of its own class: anybody can register another by its id."""
    keywords = {} if keywords is None else keywords
    if not isinstance(keywords, Mapping):
        raise ValueError(f"`env_kwargs` must be a dictionary or None, got {keywords!r:.60}.")
    of_pictures = sorted(OF_PICTURES & set(keywords))
    if of_pictures:
        raise ValueError(
            f"`env_kwargs` must not hold {', '.join(of_pictures)}: `width`, `height` and "
            "`render_mode` say what pictures are like."
        )
    check_at_least_one(**{"env_kwargs['frame_skip']": keywords.get("frame_skip", 1)})
    import_extra("locomotion", "mujoco", "imageio")
    make = load_env_creator(task.entry_point)
    with _options_of(task.env_id, keywords):
        original: gym.Env[Any, Any] = make(**copy.deepcopy(dict(keywords)))  # type: ignore[assignment]
    return original


@contextmanager
def _options_of(env_id: str, env_kwargs: Mapping[str, Any] | None) -> Iterator[None]:
    """Errors of any kind, as a sentence about the options, if there are any."""
    try:
        yield
    except Exception as error:
        if not env_kwargs:
            raise
        raise ValueError(
            f"`env_kwargs` must be what Gymnasium's {env_id} can be made and stepped with "
            f"({type(error).__name__}: {error})."
        ) from error
