"""Bring a box to a target with a planar arm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from curiosity_gym.control.tasks.base import ControlTask, Fields
from curiosity_gym.core import Float32Array, Float64Array, Mask, norm
from curiosity_gym.extras import import_extra
from curiosity_gym.validation import check_positive, check_share

if TYPE_CHECKING:
    import mujoco


class Stacker(ControlTask):
    """A planar arm with a gripper brings a box to a target slightly above the ground.

    The stacker of the DeepMind Control Suite with one box, fully observable. A step lasts 0.01 s.

    Action Space:
        `Box(-1, 1, (5,), float32)`: torques of arm_root, arm_shoulder, arm_elbow and arm_wrist in
        units of 12, 8, 4 and 2 Nm, and the gripper's force in units of 2 N.

    Observation Space:
        `Box` of shape `(42,)`, float32, unbounded. Poses are x, z and the entries w and y of the
        orientation's quaternion; positions in m, angles in rad.

        ======= ==========================================================================
        Index   Meaning
        ======= ==========================================================================
        0 - 15  sine and cosine, joint by joint: arm_root, arm_shoulder, arm_elbow,
                arm_wrist, finger, fingertip, thumb, thumbtip
        16 - 23 velocities of these joints
        24 - 28 log(1 + force) of the touch sensors: palm, finger, thumb, fingertip, thumbtip
        29 - 32 pose of the hand
        33 - 36 pose of the box
        37 - 39 velocity of the box: x, rotation, z
        40, 41  x and z of the target
        ======= ==========================================================================

    Behavior:
        x and z of the hand, within +-1 m.

    Starting State:
        At rest: the arm stretched out level (arm_root at pi/2, every other joint at 0), the box
        upright at (-0.3, 0.04), the target at (0, 0.07). A random start has every joint of the arm
        anywhere in its range, finger and thumb alike, the box at any angle from 0.1 to 0.3 in x
        and from 0 to 0.7 in z, no contact, and the target on the ground, from -0.37 to 0.37 in x.

    Success:
        dm_control's own reward, which is 1 with the box on the target and the hand away from it,
        is at least `success_threshold`.

    Args:
        success_threshold: From above 0 to 1.
        random_start: As in `ControlTask`.
    """

    domain = "stacker"
    n_observations = 42
    n_substeps = 10
    fields = ("qpos", "qvel", "xpos", "xquat", "site_xpos", "sensordata")
    start: ClassVar[Mapping[str, float]] = {"arm_root": np.pi / 2, "box0_x": -0.3, "box0_z": 0.04}
    target = "body"
    behavior_names = ("hand x (m)", "hand z (m)")
    behavior_low, behavior_high = np.full(2, -1.0), np.full(2, 1.0)

    JOINTS = (
        *("arm_root", "arm_shoulder", "arm_elbow", "arm_wrist"),
        *("finger", "fingertip", "thumb", "thumbtip"),
    )

    def __init__(self, success_threshold: float = 0.1, *, random_start: bool = False) -> None:
        check_positive(success_threshold=success_threshold)
        check_share(success_threshold=success_threshold)
        self.success_threshold = float(success_threshold)
        super().__init__(random_start=random_start)
        (rewards,) = import_extra("control", "dm_control.utils.rewards")
        self._tolerance = rewards.tolerance

    def __eq__(self, other: object) -> bool:
        own = self.success_threshold
        return super().__eq__(other) and own == getattr(other, "success_threshold", None)

    def _source(self, suite: Any) -> tuple[str, Mapping[str, bytes]]:
        return suite.make_model(1)

    def _prepare(self, model: mujoco.MjModel) -> None:
        model.body("target").pos[:] = (0.0, 0.0, 0.07)
        joints = [model.joint(name) for name in self.JOINTS]
        box = [model.joint(f"box0_{axis}") for axis in "xyz"]
        self._joints = [joint.qposadr[0] for joint in joints]
        self._joint_velocities = [joint.dofadr[0] for joint in joints]
        self._box_velocity = [joint.dofadr[0] for joint in box]
        self._bodies = [model.body(name).id for name in ("hand", "box0")]
        self._hand = self._bodies[0]
        self._target_body = model.body("target").id
        self._sites = {name: model.site(name).id for name in ("box0", "grasp", "target")}
        self._box_size = float(model.geom("target").size[0])

    def make_suite_task(self, random: np.random.RandomState) -> Any:
        return self.suite.Stack(1, fully_observable=True, random=random)

    def observe(self, fields: Fields, observations: Float32Array) -> None:
        angles = fields.qpos[:, self._joints]
        observations[:, 0:16:2] = np.sin(angles)
        observations[:, 1:16:2] = np.cos(angles)
        observations[:, 16:24] = fields.qvel[:, self._joint_velocities]
        observations[:, 24:29] = np.log1p(fields.sensordata)
        for body, at in zip(self._bodies, (29, 33), strict=True):
            observations[:, at : at + 2] = fields.xpos[:, body, ::2]
            observations[:, at + 2 : at + 4] = fields.xquat[:, body, ::2]
        observations[:, 37:40] = fields.qvel[:, self._box_velocity]
        observations[:, 40:42] = fields.xpos[:, self._target_body, ::2]

    def reward(self, fields: Fields) -> Float64Array:
        """dm_control's dense reward, (k,)."""
        sites = fields.site_xpos
        target = sites[:, self._sites["target"]]
        box = norm(sites[:, self._sites["box0"]] - target)
        hand = norm(sites[:, self._sites["grasp"]] - target)
        box_is_close = self._tolerance(box, margin=2 * self._box_size)
        hand_is_far = self._tolerance(hand, bounds=(0.1, np.inf), margin=0.01)
        return box_is_close * hand_is_far

    def success(self, fields: Fields) -> Mask:
        return self.reward(fields) >= self.success_threshold

    def behavior(self, fields: Fields) -> Float64Array:
        return fields.xpos[:, self._hand, ::2].copy()
