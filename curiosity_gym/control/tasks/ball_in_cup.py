"""Catch a ball on a string in the cup that it hangs from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from curiosity_gym.control.tasks.base import ControlTask, Fields
from curiosity_gym.core import Float32Array, Float64Array, Mask

if TYPE_CHECKING:
    import mujoco


class BallInCup(ControlTask):
    """A ball on a string hangs below a cup, and is to be swung into it.

    `ball_in_cup/catch` of the DeepMind Control Suite. The actuators push the cup along x and z; a
    step lasts 0.02 s.

    Action Space:
        `Box(-1, 1, (2,), float32)`: force on the cup along x and z, in units of 5 N.

    Observation Space:
        `Box` of shape `(8,)`, float32, unbounded. Positions in m, relative to where the model
        places cup and ball; velocities in m/s.

        ===== ==========================
        Index Meaning
        ===== ==========================
        0, 1  x and z of the cup
        2, 3  x and z of the ball
        4, 5  velocity of the cup
        6, 7  velocity of the ball
        ===== ==========================

    Behavior:
        x and z of the ball, within +-1, and of the cup, within +-0.5. Coverage counts all four;
        beside it, `coverage/ball` is that of the ball alone.

    Starting State:
        At rest, the cup at (0, 0), the ball straight below at (0, -0.05). A random start has the
        ball anywhere from -0.2 to 0.2 in x and from 0.2 to 0.5 in z where it touches nothing.

    Success:
        The ball is inside the cup. Random actions of full strength, held for ten steps each, catch
        it in three episodes of five.

    Args:
        random_start: As in `ControlTask`.
    """

    domain = "ball_in_cup"
    n_observations = 8
    n_substeps = 10
    fields = ("qpos", "qvel", "xpos", "site_xpos")
    start: ClassVar[Mapping[str, float]] = {"ball_z": -0.05}
    projections: ClassVar[Mapping[str, tuple[int, ...]]] = {"ball": (0, 1)}
    behavior_names = ("ball x (m)", "ball z (m)", "cup x (m)", "cup z (m)")
    behavior_low = np.array([-1.0, -1.0, -0.5, -0.5])
    behavior_high = np.array([1.0, 1.0, 0.5, 0.5])

    def _prepare(self, model: mujoco.MjModel) -> None:
        self._ball, self._target = model.body("ball").id, model.site("target").id
        self._room = model.site("target").size[[0, 2]] - model.geom("ball").size[0]

    def make_suite_task(self, random: np.random.RandomState) -> Any:
        return self.suite.BallInCup(random=random)

    def observe(self, fields: Fields, observations: Float32Array) -> None:
        observations[:, :4] = fields.qpos
        observations[:, 4:] = fields.qvel

    def success(self, fields: Fields) -> Mask:
        offset = fields.site_xpos[:, self._target, ::2] - fields.xpos[:, self._ball, ::2]
        return (np.abs(offset) < self._room).all(axis=1)

    def behavior(self, fields: Fields) -> Float64Array:
        return fields.qpos[:, [2, 3, 0, 1]]
