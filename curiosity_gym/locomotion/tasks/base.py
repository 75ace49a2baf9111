"""The base of the locomotion tasks: options, starts, observation, reward and behavior.

A task reads the fields of k simulations, arrays with k rows, and computes with the operations of
Gymnasium's environment, in their order, so that the bits are the same.
"""

from __future__ import annotations

import copy
import inspect
import math
from collections.abc import Mapping
from functools import reduce
from operator import add
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from curiosity_gym.core import CoverageGrid, Float32Array, Float64Array, Mask, norm
from curiosity_gym.extras import import_extra
from curiosity_gym.locomotion.worlds import World
from curiosity_gym.simulation import Values

Fields = Any  # namespace of MuJoCo's fields (`qpos`, `cfrc_ext`, ...), arrays (k, ...)

BEHAVIORS = ("position", "feet")
EXTENT = 30.0
"""Bound of a position (m), as in the "omni" tasks of QDax; who comes farther counts at the edge."""


class LocomotionTask:
    """One of Gymnasium's MuJoCo environments, version 5, with its options.

    Args:
        env: Gymnasium's environment: its model and options are taken over.
        behavior: As in `LocomotionEnv`; None: there is none.
        world: Walls and a goal; None: open ground.

    Attributes:
        model: The compiled MuJoCo model.
        frame_skip: Physics steps in a step, which lasts `dt` seconds.
        needs_forces: Whether anything asks for the forces from outside, which cost extra.
    """

    env_id: ClassVar[str]
    entry_point: ClassVar[str]
    """The place of Gymnasium's class: a module and a name in it."""
    fields: ClassVar[tuple[str, ...]] = ("qpos", "qvel")
    """Names of the fields that the task reads."""
    feet: ClassVar[Mapping[str, str]] = {}
    """Geoms of the feet, each with the name of its foot."""
    n_dimensions: ClassVar[int] = 2
    """Coordinates of a position: those that begin `qpos`."""
    draws: ClassVar[bool] = True
    """Whether episodes begin at random."""
    draws_normal: ClassVar[bool] = False
    """Whether the velocities of a start are normal, not uniform as its positions are."""
    walks_around: ClassVar[bool] = False
    """Whether there can be walls around it."""

    forward_reward_weight: float
    ctrl_cost_weight: float
    healthy_reward: float
    reset_noise_scale: float
    exclude_current_positions_from_observation: bool

    def __init__(
        self,
        env: gym.Env[Any, Any],
        *,
        behavior: str | None = "position",
        world: World | None = None,
    ) -> None:
        inner: Any = env.unwrapped
        # Arguments of Gymnasium's constructor that say how it computes become attributes.
        arguments = inspect.signature(type(inner).__init__).parameters
        self.options = tuple(name for name in arguments if hasattr(inner, f"_{name}"))
        for name in self.options:
            setattr(self, name, getattr(inner, f"_{name}"))
        if world is not None and not self.walks_around:
            raise ValueError(f"`world` must be None of {self.env_id}, which does not walk around.")
        self.behavior_name = behavior
        self.world = world
        # Its own: what is changed in the environment later is not half of it.
        self.model = copy.copy(inner.model) if world is None else world.model_of(inner.fullpath)
        self.ends_unhealthy = bool(getattr(self, "terminate_when_unhealthy", False))
        self.frame_skip: int = inner.frame_skip
        self.dt: float = inner.dt
        self.n_actions: int = self.model.nu
        n = inner.observation_space.shape[0] + 2 * (world is not None)
        self.observation_space = spaces.Box(-np.inf, np.inf, (n,), np.float64)
        self.n_observations: int = n
        self.action_space = inner.action_space
        self._start = np.append(inner.init_qpos, inner.init_qvel)
        if behavior == "feet" and not self.feet:
            raise ValueError(f'`behavior` must be "position" of {self.env_id}, which has no feet.')
        feet = self.feet if behavior == "feet" else ()
        self.foot_bodies = [int(self.model.geom(name).bodyid[0]) for name in feet]
        self.needs_forces = "cfrc_ext" in self.fields or behavior == "feet"
        self._prepare(inner)
        self._bound_behavior()

    def _bound_behavior(self) -> None:
        n = self.n_dimensions if self.behavior_name == "position" else len(self.foot_bodies)
        names, low, high = ("x (m)", "y (m)")[:n], np.full(n, -EXTENT), np.full(n, EXTENT)
        if self.foot_bodies:
            names = tuple(f"{foot} (share of steps)" for foot in self.feet.values())
            low, high = np.zeros(n), np.ones(n)
        elif self.world is not None:
            low, high = self.world.low[:n], self.world.high[:n]
        self.behavior_names, self.behavior_low, self.behavior_high = names, low, high
        has_behavior = self.behavior_name is not None
        self.coverage_grid = CoverageGrid(tuple(range(n)), low, high) if has_behavior else None

    def __eq__(self, other: object) -> bool:
        """Equal tasks begin, move, observe and reward alike."""
        if type(self) is not type(other) or not isinstance(other, LocomotionTask):
            return False
        names = (*self.options, "behavior_name", "frame_skip")
        return (
            self.world == other.world
            and all(np.array_equal(getattr(self, name), getattr(other, name)) for name in names)
            and np.array_equal(self._start, other._start)
            and np.array_equal(_bytes(self.model), _bytes(other.model))
        )

    @property
    def all_fields(self) -> tuple[str, ...]:
        """Names of the fields that simulations keep, the task's own and what tells of feet."""
        return tuple(dict.fromkeys([*self.fields, *(["cfrc_ext"] if self.needs_forces else [])]))

    def draw(self, rng: np.random.Generator) -> tuple[Float64Array, Float64Array]:
        """Positions and velocities (nq,), (nv,) of a start, drawn as Gymnasium draws them."""
        noise, (qpos, qvel) = self.reset_noise_scale, np.split(self._start, [self.model.nq])
        moved = qpos + rng.uniform(low=-noise, high=noise, size=self.model.nq)
        if self.draws_normal:
            return moved, qvel + noise * rng.standard_normal(self.model.nv)
        return moved, qvel + rng.uniform(low=-noise, high=noise, size=self.model.nv)

    def _prepare(self, env: Any) -> None:
        """Note where things are in the model."""

    def behavior(self, fields: Fields, shares: Float64Array) -> Float64Array:
        """The behavior of each simulation, (k, B), of the shares of touching feet (k, F)."""
        values = shares if self.foot_bodies else fields.qpos[:, : len(self.behavior_names)]
        return np.clip(values, self.behavior_low, self.behavior_high)

    def touches(self, fields: Fields) -> Mask:
        """Whether a force from outside acts on each foot, (k, F)."""
        return (fields.cfrc_ext[:, self.foot_bodies] != 0.0).any(axis=2)

    def place(self, fields: Fields) -> Float64Array:
        """The places whose change is the velocity, (k, d)."""
        return fields.qpos[:, : self.n_dimensions].copy()

    def healthy(self, fields: Fields) -> Mask:
        """Whether each simulation may go on, (k,)."""
        return np.ones(len(fields.qpos), dtype=np.bool_)

    def success(self, fields: Fields) -> Mask:
        """Whether each simulation is at the goal of its world, (k,)."""
        if self.world is None:
            return np.zeros(len(fields.qpos), dtype=np.bool_)
        return self.world.is_at_goal(fields.qpos[:, :2])

    def speed(self, before: Float64Array, after: Float64Array) -> Float64Array:
        """The rewarded speed, (k,) m/s, of places (k, d): along x, or towards the world's goal."""
        if self.world is None:
            return (after[:, 0] - before[:, 0]) / self.dt
        return (self.world.distances(before) - self.world.distances(after)) / self.dt

    def observe(self, fields: Fields) -> Float64Array:
        """The observations (k, n_observations): where in its world it is, and what it feels."""
        if self.world is None:
            return self.feel(fields)
        where = self.world.standardize(fields.qpos[:, :2])
        return np.concatenate([where, self.feel(fields)], axis=1)

    def feel(self, fields: Fields) -> Float64Array:
        """The observations of Gymnasium's environment."""
        return np.concatenate([self.positions(fields), fields.qvel], axis=1)

    def reward(
        self, fields: Fields, speed: Float64Array, actions: Float32Array, healthy: Mask
    ) -> tuple[Float64Array, Values]:
        """The rewards (k,) of a step that led to `fields`, and what the info tells of them."""
        gains: Values = {"reward_forward": self.forward_reward_weight * speed}
        if "healthy_reward" in self.options:
            gains["reward_survive"] = healthy * self.healthy_reward
        costs = self.costs(fields, actions)
        # Added up in Gymnasium's order.
        reward = reduce(add, gains.values()) - reduce(add, costs.values())
        return reward, {**gains, **{name: -cost for name, cost in costs.items()}}

    def costs(self, fields: Fields, actions: Float32Array) -> Values:
        """Costs that are subtracted from the rewards, (k,) each."""
        return {"reward_ctrl": self.ctrl_cost_weight * np.square(actions).sum(axis=1)}

    def info(self, fields: Fields) -> Values:
        """Entries of the info at any time."""
        position = fields.qpos[:, :2].copy()
        x, y = position.T
        return {"x_position": x, "y_position": y, "distance_from_origin": norm(position)}

    def positions(self, fields: Fields) -> Float64Array:
        """The first entries of an observation."""
        skipped = self.n_dimensions * self.exclude_current_positions_from_observation
        return fields.qpos[:, skipped:]


def flat(array: Float64Array) -> Float64Array:
    """(k, ...) to (k, n)."""
    return array.reshape(len(array), math.prod(array.shape[1:]))  # -1 is no length of no rows


def is_inside(values: Float64Array, bounds: tuple[float, float]) -> Mask:
    """Whether values lie between bounds, which are not part of it."""
    low, high = bounds
    return (low < values) & (values < high)


def _bytes(model: Any) -> Any:
    (mujoco,) = import_extra("locomotion", "mujoco")
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer
