"""A chain of three links that swims in a plane."""

from __future__ import annotations

from curiosity_gym.locomotion.tasks.base import LocomotionTask


class Swimmer(LocomotionTask):
    """Gymnasium's `Swimmer-v5`, whose documentation says what is observed and rewarded.

    Behavior:
        "position": x and y of the first link (m), within +-30. It has no feet.
    """

    env_id = "Swimmer-v5"
    entry_point = "gymnasium.envs.mujoco.swimmer_v5:SwimmerEnv"
