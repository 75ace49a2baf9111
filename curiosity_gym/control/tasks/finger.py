"""Turn a spinner with a finger until its tip is in a small target."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from curiosity_gym.control.tasks.base import ControlTask, Fields
from curiosity_gym.core import Float32Array, Float64Array, Mask, norm

if TYPE_CHECKING:
    import mujoco


class Finger(ControlTask):
    """A finger of two joints turns a spinner until the spinner's tip is in a small target.

    `finger/turn_hard` of the DeepMind Control Suite, with a target of radius 0.03 m. There is no
    gravity; a step lasts 0.02 s.

    Action Space:
        `Box(-1, 1, (2,), float32)`: torque of the proximal joint in units of 30 Nm, and of the
        distal one in units of 15 Nm.

    Observation Space:
        `Box` of shape `(12,)`, float32, unbounded. Angles in rad, positions in m relative to the
        spinner's hinge.

        ====== =========================================================
        Index  Meaning
        ====== =========================================================
        0, 1   angles of the proximal and the distal joint
        2, 3   x and z of the tip
        4 - 6  velocity of proximal and distal joint and of the hinge
        7, 8   log(1 + force) of the two touch sensors of the fingertip
        9, 10  x and z of the target
        11     distance from the tip to the target's surface
        ====== =========================================================

    Behavior:
        Angles of the proximal and the distal joint, within their ranges of +-110 degrees, and of
        the hinge, wrapped to +-pi. A joint pushed past its range counts as at its end.

    Starting State:
        At rest: proximal joint and hinge at pi/2, distal joint at 0; the target lies at
        (0.117, 0.057) from the hinge. A random start has both joints anywhere in their ranges, the
        hinge at any angle, no contact, and the target anywhere on the circle of the spinner's tip.

    Success:
        The tip is inside the target.

    Args:
        random_start: As in `ControlTask`.
    """

    domain = "finger"
    n_observations = 12
    n_substeps = 2
    fields = ("qpos", "sensordata")
    start: ClassVar[Mapping[str, float]] = {"proximal": np.pi / 2, "hinge": np.pi / 2}
    target = "site"
    behavior_names = ("proximal angle (rad)", "distal angle (rad)", "hinge angle (rad)")

    def _prepare(self, model: mujoco.MjModel) -> None:
        model.site("target").pos[:] = (0.3168727, 0.0, 0.45692778)
        model.site("target").size[0] = self._radius = 0.03
        self._tip, self._target, self._spinner = (
            _plane(model.sensor(name).adr[0]) for name in ("tip", "target", "spinner")
        )
        touch = model.sensor("touchtop").adr[0]
        self._touch = slice(touch, touch + 2)
        ranges = np.array([model.joint(name).range for name in ("proximal", "distal")])
        self.behavior_low = np.append(ranges[:, 0], -np.pi)
        self.behavior_high = np.append(ranges[:, 1], np.pi)

    def make_suite_task(self, random: np.random.RandomState) -> Any:
        return self.suite.Turn(self._radius, random=random)

    def observe(self, fields: Fields, observations: Float32Array) -> None:
        sensors = fields.sensordata
        spinner = sensors[:, self._spinner]
        observations[:, :2] = sensors[:, :2]
        observations[:, 2:4] = sensors[:, self._tip] - spinner
        observations[:, 4:7] = sensors[:, 2:5]
        observations[:, 7:9] = np.log1p(sensors[:, self._touch])
        observations[:, 9:11] = sensors[:, self._target] - spinner
        observations[:, 11] = self._distance(sensors)

    def _distance(self, sensors: Float64Array) -> Float64Array:
        """From the tip to the target's surface, negative inside, (k,)."""
        spinner = sensors[:, self._spinner]
        offset = (sensors[:, self._target] - spinner) - (sensors[:, self._tip] - spinner)
        return norm(offset) - self._radius

    def success(self, fields: Fields) -> Mask:
        return self._distance(fields.sensordata) <= 0.0

    def behavior(self, fields: Fields) -> Float64Array:
        behavior = fields.qpos.copy()
        behavior[:, 2] = (behavior[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
        return behavior


def _plane(address: int) -> slice:
    """The places of x and z in a sensor of three values."""
    return slice(address, address + 3, 2)
