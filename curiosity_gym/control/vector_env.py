"""Many episodes of a control task at once, stepped by MuJoCo's own batch and threads."""

from __future__ import annotations

from curiosity_gym.control.control_env import SETTINGS, ControlEnv
from curiosity_gym.control.tasks import ControlTask
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.fixed import fixed


@fixed(*SETTINGS)
class ControlVectorEnv(EpisodicVectorEnv):
    """An `EpisodicVectorEnv`; its other arguments are those of `ControlEnv`.

    There is no process an env: MuJoCo's threads step them all.
    """

    task: ControlTask
    single_class = ControlEnv
    taken_over = ("task",)
