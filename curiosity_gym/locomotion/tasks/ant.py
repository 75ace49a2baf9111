"""A four-legged robot that runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from curiosity_gym.core import Float32Array, Float64Array, Mask
from curiosity_gym.locomotion.tasks.base import Fields, LocomotionTask, flat
from curiosity_gym.simulation import Values


class Ant(LocomotionTask):
    """Gymnasium's `Ant-v5`."""

    env_id = "Ant-v5"
    entry_point = "gymnasium.envs.mujoco.ant_v5:AntEnv"
    fields = ("qpos", "qvel", "xpos", "cfrc_ext")
    feet: ClassVar[Mapping[str, str]] = {
        "left_ankle_geom": "front left foot",
        "right_ankle_geom": "front right foot",
        "third_ankle_geom": "back left foot",
        "fourth_ankle_geom": "back right foot",
    }
    draws_normal = True
    walks_around = True

    contact_cost_weight: float
    terminate_when_unhealthy: bool
    healthy_z_range: tuple[float, float]
    contact_force_range: tuple[float, float]
    include_cfrc_ext_in_observation: bool

    def _prepare(self, env: Any) -> None:
        self._torso = env.data.body(env._main_body).id

    def place(self, fields: Fields) -> Float64Array:
        return fields.xpos[:, self._torso, :2].copy()

    def healthy(self, fields: Fields) -> Mask:
        low, high = self.healthy_z_range
        z = fields.qpos[:, 2]
        is_finite = np.isfinite(fields.qpos).all(axis=1) & np.isfinite(fields.qvel).all(axis=1)
        return is_finite & (low <= z) & (z <= high)

    def feel(self, fields: Fields) -> Float64Array:
        parts = [self.positions(fields), fields.qvel]
        if self.include_cfrc_ext_in_observation:
            parts.append(flat(self._contact_forces(fields)[:, 1:]))
        return np.concatenate(parts, axis=1)

    def _contact_forces(self, fields: Fields) -> Float64Array:
        return np.clip(fields.cfrc_ext, *self.contact_force_range)

    def costs(self, fields: Fields, actions: Float32Array) -> Values:
        forces = flat(self._contact_forces(fields))
        contact = self.contact_cost_weight * np.square(forces).sum(axis=1)
        return {**super().costs(fields, actions), "reward_contact": contact}
