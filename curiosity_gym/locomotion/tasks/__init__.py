"""The locomotion tasks: one robot each."""

from typing import Any

import gymnasium as gym

from curiosity_gym.locomotion.tasks.ant import Ant
from curiosity_gym.locomotion.tasks.base import BEHAVIORS, LocomotionTask
from curiosity_gym.locomotion.tasks.humanoid import Humanoid
from curiosity_gym.locomotion.tasks.planar import HalfCheetah, Hopper, Swimmer, Walker2d

__all__ = ["BEHAVIORS", "TASKS", "LocomotionTask", "task_class"]

TASKS: dict[str, type[LocomotionTask]] = {
    task.env_id: task for task in (Ant, HalfCheetah, Hopper, Humanoid, Swimmer, Walker2d)
}
"""By the id of Gymnasium's environment."""


def task_class(env: gym.Env[Any, Any]) -> type[LocomotionTask] | None:
    """The task of exactly this environment of Gymnasium's, without wrappers; None: there is none.

    Its classes are compared by their names, as they import MuJoCo.
    """
    name = f"{type(env).__module__}:{type(env).__qualname__}"
    return next((task for task in TASKS.values() if task.entry_point == name), None)
