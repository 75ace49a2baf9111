"""Robots that move in a plane: HalfCheetah, Hopper, Swimmer and Walker2d."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from curiosity_gym.core import Float64Array, Mask
from curiosity_gym.locomotion.tasks.base import Fields, LocomotionTask, is_inside
from curiosity_gym.simulation import Values


class HalfCheetah(LocomotionTask):
    """Gymnasium's `HalfCheetah-v5`."""

    env_id = "HalfCheetah-v5"
    entry_point = "gymnasium.envs.mujoco.half_cheetah_v5:HalfCheetahEnv"
    feet: ClassVar[Mapping[str, str]] = {"bfoot": "back foot", "ffoot": "front foot"}
    n_dimensions = 1
    draws_normal = True

    def info(self, fields: Fields) -> Values:
        return {"x_position": fields.qpos[:, 0].copy()}


class Walker2d(LocomotionTask):
    """Gymnasium's `Walker2d-v5`."""

    env_id = "Walker2d-v5"
    entry_point = "gymnasium.envs.mujoco.walker2d_v5:Walker2dEnv"
    feet: ClassVar[Mapping[str, str]] = {
        "foot_geom": "right foot",
        "foot_left_geom": "left foot",
    }
    n_dimensions = 1

    terminate_when_unhealthy: bool
    healthy_z_range: tuple[float, float]
    healthy_angle_range: tuple[float, float]

    def _prepare(self, env: Any) -> None:
        self._height = env.init_qpos[1]

    def healthy(self, fields: Fields) -> Mask:
        return is_inside(fields.qpos[:, 1], self.healthy_z_range) & is_inside(
            fields.qpos[:, 2], self.healthy_angle_range
        )

    def feel(self, fields: Fields) -> Float64Array:
        velocities = np.clip(fields.qvel, -10, 10)
        return np.concatenate([self.positions(fields), velocities], axis=1)

    def info(self, fields: Fields) -> Values:
        x, z = fields.qpos[:, :2].T
        return {"x_position": x.copy(), "z_distance_from_origin": z - self._height}


class Hopper(Walker2d):
    """Gymnasium's `Hopper-v5`."""

    env_id = "Hopper-v5"
    entry_point = "gymnasium.envs.mujoco.hopper_v5:HopperEnv"
    feet: ClassVar[Mapping[str, str]] = {"foot_geom": "foot"}

    healthy_state_range: tuple[float, float]

    def healthy(self, fields: Fields) -> Mask:
        state = np.concatenate([fields.qpos, fields.qvel], axis=1)[:, 2:]
        return is_inside(state, self.healthy_state_range).all(axis=1) & super().healthy(fields)


class Swimmer(LocomotionTask):
    """Gymnasium's `Swimmer-v5`."""

    env_id = "Swimmer-v5"
    entry_point = "gymnasium.envs.mujoco.swimmer_v5:SwimmerEnv"
