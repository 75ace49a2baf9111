"""What the control tasks are: model, start, observation, success and behavior.

A task is written for k simulations at once: it reads their derived fields, arrays with k rows, and
computes with the operations of dm_control, in their order, so that the bits are the same.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from curiosity_gym.core import CoverageGrid, Float32Array, Float64Array, Mask
from curiosity_gym.extras import import_extra
from curiosity_gym.validation import check_positive

if TYPE_CHECKING:
    import mujoco

Fields = Any
"""Namespace of MuJoCo's fields (`qpos`, `sensordata`, ...), arrays (k, ...)."""


class ControlTask:
    """One task of the suite with a fixed start.

    Attributes:
        model: The compiled MuJoCo model, target in place.
        n_observations: Length of an observation.
        n_actions: Number of actuators.
        behavior_low: (B,) lower bounds of the behavior.
        behavior_high: (B,) upper bounds.
        coverage_grid: What coverage counts.
    """

    domain: ClassVar[str]
    """Module of `dm_control.suite`."""
    n_observations: ClassVar[int]
    n_substeps: ClassVar[int]
    """Physics steps in a control step."""
    fields: ClassVar[tuple[str, ...]]
    """Names of the fields that the task reads."""
    start: ClassVar[Mapping[str, float]]
    """Joint: its position at the start, where that is not the model's own."""
    projections: ClassVar[Mapping[str, tuple[int, ...]]] = {}
    """Name: entries of the behavior that are also counted alone."""
    behavior_low: Float64Array
    behavior_high: Float64Array

    def __init__(self) -> None:
        # The package before its module: two threads would wait for each other's import.
        names = ("mujoco", "dm_control.suite", f"dm_control.suite.{self.domain}")
        mujoco, _, suite = import_extra("control", *names)
        self.model = mujoco.MjModel.from_xml_string(*self._source(suite))
        # Without this stage of collision detection the bits are the same, and the steps faster.
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
        self.n_actions: int = self.model.nu
        self._prepare(self.model)
        self.coverage_grid = CoverageGrid(
            tuple(range(len(self.behavior_low))),
            self.behavior_low,
            self.behavior_high,
            projections=self.projections,
        )

    def __eq__(self, other: object) -> bool:
        """Equal tasks begin, observe and succeed alike."""
        return type(self) is type(other)

    def _source(self, suite: Any) -> tuple[str, Mapping[str, bytes]]:
        """XML and assets of the model."""
        xml, assets = suite.get_model_and_assets()
        return xml, assets

    def start_state(self, model: mujoco.MjModel) -> Float64Array:
        """The start, at rest, with the solver's warm start: a state of `mjSTATE_INTEGRATION`.

        Args:
            model: The task's own, or dm_control's.
        """
        (mujoco,) = import_extra("control", "mujoco")
        data = mujoco.MjData(model)
        for joint, position in self.start.items():
            data.joint(joint).qpos[:] = position
        mujoco.mj_forward(model, data)
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(model, kind))
        mujoco.mj_getState(model, data, state, kind)
        return state

    @abstractmethod
    def _prepare(self, model: mujoco.MjModel) -> None:
        """Put the target in place, and note where things are in the fields."""

    @abstractmethod
    def observe(self, fields: Fields, observations: Float32Array) -> None:
        """Write the observations (k, n_observations), in dm_control's own order."""

    @abstractmethod
    def success(self, fields: Fields) -> Mask:
        """Which simulations are at the goal, (k,)."""

    @abstractmethod
    def behavior(self, fields: Fields) -> Float64Array:
        """What the episodes have come to, (k, B)."""


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
        At rest, the cup at (0, 0), the ball straight below at (0, -0.05).

    Success:
        The ball is inside the cup. From this start it is no feat: random actions of full strength,
        held for ten steps each, catch it in three episodes of five.
    """

    domain = "ball_in_cup"
    n_observations = 8
    n_substeps = 10
    fields = ("qpos", "qvel", "xpos", "site_xpos")
    start: ClassVar[Mapping[str, float]] = {"ball_x": 0.0, "ball_z": -0.05}
    projections: ClassVar[Mapping[str, tuple[int, ...]]] = {"ball": (0, 1)}
    behavior_low = np.array([-1.0, -1.0, -0.5, -0.5])
    behavior_high = np.array([1.0, 1.0, 0.5, 0.5])

    def _prepare(self, model: mujoco.MjModel) -> None:
        self._ball, self._target = model.body("ball").id, model.site("target").id
        self._room = model.site("target").size[[0, 2]] - model.geom("ball").size[0]

    def observe(self, fields: Fields, observations: Float32Array) -> None:
        """See `ControlTask`."""
        observations[:, :4] = fields.qpos
        observations[:, 4:] = fields.qvel

    def success(self, fields: Fields) -> Mask:
        """See `ControlTask`."""
        offset = fields.site_xpos[:, self._target, ::2] - fields.xpos[:, self._ball, ::2]
        inside: Mask = (np.abs(offset) < self._room).all(axis=1)
        return inside

    def behavior(self, fields: Fields) -> Float64Array:
        """See `ControlTask`."""
        behavior: Float64Array = fields.qpos[:, [2, 3, 0, 1]]
        return behavior


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
        the hinge, wrapped to +-pi. The ranges are soft: a joint pushed past its own, by up
        to 0.4 rad, counts as at its end.

    Starting State:
        At rest: proximal joint and hinge at pi/2, distal joint at 0; the target lies at
        (0.117, 0.057) from the hinge.

    Success:
        The tip is inside the target.
    """

    domain = "finger"
    n_observations = 12
    n_substeps = 2
    fields = ("qpos", "sensordata")
    start: ClassVar[Mapping[str, float]] = {"proximal": np.pi / 2, "hinge": np.pi / 2}

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

    def observe(self, fields: Fields, observations: Float32Array) -> None:
        """See `ControlTask`."""
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
        return _norm(offset) - self._radius

    def success(self, fields: Fields) -> Mask:
        """See `ControlTask`."""
        return self._distance(fields.sensordata) <= 0.0

    def behavior(self, fields: Fields) -> Float64Array:
        """See `ControlTask`."""
        behavior: Float64Array = fields.qpos.copy()
        behavior[:, 2] = (behavior[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
        return behavior


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
        upright at (-0.3, 0.04), the target at (0, 0.07).

    Success:
        dm_control's own reward, which is 1 with the box on the target and the hand away from it,
        is at least `success_threshold`.

    Args:
        success_threshold: From above 0 to 1.

    Raises:
        ValueError: If it is out of this range.
    """

    domain = "stacker"
    n_observations = 42
    n_substeps = 10
    fields = ("qpos", "qvel", "xpos", "xquat", "site_xpos", "sensordata")
    start: ClassVar[Mapping[str, float]] = {
        "arm_root": np.pi / 2,
        "box0_x": -0.3,
        "box0_z": 0.04,
        "box0_y": 0.0,
    }
    behavior_low = np.array([-1.0, -1.0])
    behavior_high = np.array([1.0, 1.0])

    JOINTS = (
        "arm_root",
        "arm_shoulder",
        "arm_elbow",
        "arm_wrist",
        "finger",
        "fingertip",
        "thumb",
        "thumbtip",
    )

    def __init__(self, success_threshold: float = 0.1) -> None:
        check_positive(success_threshold=success_threshold)
        if success_threshold > 1.0:
            raise ValueError(
                f"`success_threshold` must be above 0 and at most 1, got {success_threshold!r}."
            )
        self.success_threshold = float(success_threshold)
        super().__init__()
        (rewards,) = import_extra("control", "dm_control.utils.rewards")
        self._tolerance = rewards.tolerance

    def __eq__(self, other: object) -> bool:
        """Equal tasks have the same threshold too."""
        return isinstance(other, Stacker) and self.success_threshold == other.success_threshold

    def _source(self, suite: Any) -> tuple[str, Mapping[str, bytes]]:
        xml, assets = suite.make_model(1)
        return xml, assets

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

    def observe(self, fields: Fields, observations: Float32Array) -> None:
        """See `ControlTask`."""
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
        box = _norm(sites[:, self._sites["box0"]] - target)
        hand = _norm(sites[:, self._sites["grasp"]] - target)
        box_is_close = self._tolerance(box, margin=2 * self._box_size)
        hand_is_far = self._tolerance(hand, bounds=(0.1, np.inf), margin=0.01)
        reward: Float64Array = box_is_close * hand_is_far
        return reward

    def success(self, fields: Fields) -> Mask:
        """See `ControlTask`."""
        return self.reward(fields) >= self.success_threshold

    def behavior(self, fields: Fields) -> Float64Array:
        """See `ControlTask`."""
        behavior: Float64Array = fields.xpos[:, self._hand, ::2].copy()
        return behavior


def _plane(address: int) -> slice:
    """Where x and z of a sensor of three values are."""
    return slice(address, address + 3, 2)


def _norm(vectors: Float64Array) -> Float64Array:
    """Lengths of the rows: `numpy.linalg.norm` of each, whose dot product `vecdot` calls too."""
    lengths: Float64Array = np.sqrt(np.vecdot(vectors, vectors))
    return lengths


TASKS: dict[str, type[ControlTask]] = {
    "ball_in_cup": BallInCup,
    "finger": Finger,
    "stacker": Stacker,
}
