"""A robot with two legs and two arms that runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from curiosity_gym.core import Float32Array, Float64Array, Mask
from curiosity_gym.locomotion.tasks.base import Fields, LocomotionTask, flat, is_inside
from curiosity_gym.simulation import Values


class Humanoid(LocomotionTask):
    """Gymnasium's `Humanoid-v5`."""

    env_id = "Humanoid-v5"
    entry_point = "gymnasium.envs.mujoco.humanoid_v5:HumanoidEnv"
    fields = (
        *("qpos", "qvel", "xipos", "cinert", "cvel", "qfrc_actuator", "cfrc_ext", "ctrl"),
        *("ten_length", "ten_velocity"),
    )
    feet: ClassVar[Mapping[str, str]] = {"right_foot": "right foot", "left_foot": "left foot"}
    walks_around = True

    contact_cost_weight: float
    contact_cost_range: tuple[float, float]
    terminate_when_unhealthy: bool
    healthy_z_range: tuple[float, float]
    include_cinert_in_observation: bool
    include_cvel_in_observation: bool
    include_qfrc_actuator_in_observation: bool
    include_cfrc_ext_in_observation: bool

    def place(self, fields: Fields) -> Float64Array:
        """The center of mass."""
        masses = self.model.body_mass
        center: Float64Array = (masses[:, None] * fields.xipos).sum(axis=1) / masses.sum()
        return center[:, :2]

    def healthy(self, fields: Fields) -> Mask:
        return is_inside(fields.qpos[:, 2], self.healthy_z_range)

    def feel(self, fields: Fields) -> Float64Array:
        optional = (
            (self.include_cinert_in_observation, fields.cinert[:, 1:]),
            (self.include_cvel_in_observation, fields.cvel[:, 1:]),
            (self.include_qfrc_actuator_in_observation, fields.qfrc_actuator[:, 6:]),
            (self.include_cfrc_ext_in_observation, fields.cfrc_ext[:, 1:]),
        )
        # As Gymnasium has it: nothing but True itself is taken for it.
        parts = [flat(values) for is_included, values in optional if is_included is True]
        return np.concatenate([self.positions(fields), fields.qvel, *parts], axis=1)

    def costs(self, fields: Fields, actions: Float32Array) -> Values:
        contact = self.contact_cost_weight * np.square(flat(fields.cfrc_ext)).sum(axis=1)
        contact = np.clip(contact, *self.contact_cost_range)
        return {**super().costs(fields, fields.ctrl), "reward_contact": contact}

    def info(self, fields: Fields) -> Values:
        tendons = {
            "tendon_length": fields.ten_length.copy(),
            "tendon_velocity": fields.ten_velocity.copy(),
        }
        return {**super().info(fields), **tendons}
