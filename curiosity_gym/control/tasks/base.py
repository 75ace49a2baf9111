"""The base of the control tasks: model, start, observation, success and behavior.

A task reads the derived fields of k simulations, arrays with k rows, and computes with the
operations of dm_control, in their order, so that the bits are the same.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from gymnasium import spaces

from curiosity_gym.core import CoverageGrid, Float32Array, Float64Array, Mask
from curiosity_gym.extras import import_extra
from curiosity_gym.validation import check_bool

if TYPE_CHECKING:
    import mujoco

Fields = Any  # namespace of MuJoCo's fields (`qpos`, `sensordata`, ...), arrays (k, ...)


class ControlTask:
    """One task of the suite, from the paper's fixed start or from dm_control's random ones.

    Args:
        random_start: Whether each episode begins where dm_control begins one.

    Attributes:
        model: The compiled MuJoCo model, the target where the fixed start has it.
        dt: Seconds of a control step.
        draws: Whether episodes begin at random.
    """

    domain: ClassVar[str]
    """Module of `dm_control.suite`."""
    n_observations: ClassVar[int]
    n_substeps: ClassVar[int]
    """Physics steps in a control step."""
    fields: ClassVar[tuple[str, ...]]
    """Names of the fields that the task reads."""
    start: ClassVar[Mapping[str, float]]
    """By joint, its position at the fixed start, where that is not the model's own."""
    target: ClassVar[str | None] = None
    """Kind of the model's "target", such as "site", if random starts move it; or None."""
    projections: ClassVar[Mapping[str, tuple[int, ...]]] = {}
    """By name, entries of the behavior that are also counted alone."""
    behavior_names: ClassVar[tuple[str, ...]]
    """Of each entry lower-case words and its unit, such as "ball x (m)"."""
    behavior_low: Float64Array
    behavior_high: Float64Array

    def __init__(self, *, random_start: bool = False) -> None:
        check_bool(random_start=random_start)
        self.draws = bool(random_start)
        self.moving_target = self.target if random_start else None
        # The package before its module: two threads would wait for each other's import.
        names = ("mujoco", "dm_control.suite", f"dm_control.suite.{self.domain}")
        mujoco, _, suite = import_extra("control", *names)
        self.model = mujoco.MjModel.from_xml_string(*self._source(suite))
        # Without this stage of collision detection the bits are the same, and the steps faster.
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
        self.n_actions: int = self.model.nu
        self.dt = float(self.model.opt.timestep * self.n_substeps)
        self.observation_space = spaces.Box(-np.inf, np.inf, (self.n_observations,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (self.n_actions,), np.float32)
        self._prepare(self.model)
        bounds = self.behavior_low, self.behavior_high
        dimensions = tuple(range(len(self.behavior_low)))
        self.coverage_grid = CoverageGrid(dimensions, *bounds, projections=self.projections)

    def __eq__(self, other: object) -> bool:
        """Equal tasks begin, observe and succeed alike."""
        return type(self) is type(other) and self.draws == other.draws

    @property
    def suite(self) -> ModuleType:
        """dm_control's module of the domain."""
        (suite,) = import_extra("control", f"dm_control.suite.{self.domain}")
        return suite

    def _source(self, suite: Any) -> tuple[str, Mapping[str, bytes]]:
        """XML and assets of the model."""
        return suite.get_model_and_assets()

    def start_state(self, model: mujoco.MjModel) -> Float64Array:
        """The fixed start in the task's own model or dm_control's, at rest, as `state` gives it."""
        (mujoco,) = import_extra("control", "mujoco")
        data = mujoco.MjData(model)
        for joint, position in self.start.items():
            data.joint(joint).qpos[:] = position
        mujoco.mj_forward(model, data)
        return self.state(model, data)

    def state(self, model: mujoco.MjModel, data: mujoco.MjData) -> Float64Array:
        """All that the next step depends on, (S,): `mjSTATE_INTEGRATION`, and a moving target."""
        (mujoco,) = import_extra("control", "mujoco")
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(model, kind))
        mujoco.mj_getState(model, data, state, kind)
        if self.moving_target is None:
            return state
        return np.append(state, getattr(model, self.moving_target)("target").pos)

    @abstractmethod
    def make_suite_task(self, random: np.random.RandomState) -> Any:
        """dm_control's own task, which draws from `random`."""

    @abstractmethod
    def _prepare(self, model: mujoco.MjModel) -> None:
        """Put the target in place, and note where things are in the fields."""

    @abstractmethod
    def observe(self, fields: Fields, observations: Float32Array) -> None:
        """Write the observations (k, n_observations), in dm_control's own order."""

    @abstractmethod
    def success(self, fields: Fields) -> Mask:
        """Whether each simulation is at the goal, (k,)."""

    @abstractmethod
    def behavior(self, fields: Fields) -> Float64Array:
        """The behavior of each simulation, (k, B)."""
