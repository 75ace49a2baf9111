"""Many robots of Gymnasium's at once, stepped on threads."""

from __future__ import annotations

from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.fixed import fixed
from curiosity_gym.locomotion.locomotion_env import SETTINGS, LocomotionEnv
from curiosity_gym.locomotion.tasks import LocomotionTask


@fixed(*SETTINGS)
class LocomotionVectorEnv(EpisodicVectorEnv):
    """An `EpisodicVectorEnv`; its other arguments are those of `LocomotionEnv`.

    There is no process an env: threads step them all.
    """

    task: LocomotionTask
    single_class = LocomotionEnv
    taken_over = ("task",)
