"""n copies of a robot's physics, each advanced by the calls that Gymnasium makes, on threads.

No `mujoco.batch` asks for the forces of contacts (`mj_rnePostConstraint`), as Gymnasium does.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from curiosity_gym.compiled import ThreadPool
from curiosity_gym.core import Float64Array, FloatArray, Mask
from curiosity_gym.extras import import_extra
from curiosity_gym.locomotion.tasks import LocomotionTask
from curiosity_gym.simulation import Ids, MujocoSimulation, Options, Rngs, Values

SLICES_PER_THREAD = 4
"""More slices than threads, as a robot that has fallen has more contacts than one that stands."""


class LocomotionSimulation(MujocoSimulation):
    """n simulations of one task, bit for bit those of Gymnasium's own environment.

    One that MuJoCo finds unstable goes on from the model's own start, as in Gymnasium.
    """

    task: LocomotionTask
    _kept = ("observations", "success", "rewards", "_outcome")

    def __init__(self, task: LocomotionTask, n: int, n_threads: int | None = None) -> None:
        super().__init__(task, n, n_threads)
        self.rewards = np.zeros(n)
        self._steps = np.zeros(n)
        self._touches = np.zeros((n, len(task.foot_bodies)))
        self._outcome: Values = {}
        self._pool = ThreadPool(n_threads)
        (self._mujoco,) = import_extra("locomotion", "mujoco")
        self.data = [self._mujoco.MjData(task.model) for _ in range(n)]
        # Their fields are copied to arrays.
        names = task.all_fields
        self._views = [[getattr(data, name) for name in names] for data in self.data]
        first = dict(zip(names, self._views[0], strict=True))
        self._fields = {name: np.zeros((n, *view.shape)) for name, view in first.items()}
        self._controls = [data.ctrl for data in self.data]
        self._places = task.place(self._rows(slice(None)))

    def _rows(self, rows: Any) -> SimpleNamespace:
        return SimpleNamespace(**{name: array[rows] for name, array in self._fields.items()})

    def reset(self, ids: Ids | None = None, rngs: Rngs = (), options: Options = None) -> None:
        ids = np.arange(self.n) if ids is None else ids
        starts = [self.task.draw(rng) for rng in rngs]
        if len(starts) == 1:
            starts = starts * len(ids)
        for i, (qpos, qvel) in zip(ids.tolist(), starts, strict=True):
            data = self.data[i]
            self._mujoco.mj_resetData(self.task.model, data)
            data.qpos[:], data.qvel[:] = qpos, qvel
            self._mujoco.mj_forward(self.task.model, data)
            self._copy_fields(i)
        self._steps[ids], self._touches[ids], self.rewards[ids] = 0.0, 0.0, 0.0
        self.success[ids] = False
        fields = self._rows(ids)
        self._places[ids] = self.task.place(fields)
        self.observations[ids] = self.task.observe(fields)

    def step(self, actions: FloatArray, ids: Ids | None = None) -> Mask:
        """See `BaseSimulation`; actions beyond their range cost what they cost."""
        numbers = range(self.n) if ids is None else ids.tolist()
        n_slices = SLICES_PER_THREAD * self._pool.n_threads
        self._pool.run(partial(self._advance, numbers, actions), len(numbers), n_slices)
        rows = slice(None) if ids is None or len(ids) == self.n else ids
        fields = self._rows(rows)
        place = self.task.place(fields)
        before = self._places[rows].copy()
        healthy = self.task.healthy(fields)
        self._places[rows] = place
        self._steps[rows] += 1.0
        if self.task.foot_bodies:
            self._touches[rows] += self.task.touches(fields)
        speed = self.task.speed(before, place)
        self.rewards[rows], terms = self.task.reward(fields, speed, actions, healthy)
        velocity = (place - before) / self.task.dt
        self._note(rows, dict(zip(("x_velocity", "y_velocity"), velocity.T, strict=False)) | terms)
        self.observations[rows] = self.task.observe(fields)
        self.success[rows] = success = self.task.success(fields)
        return success | (~healthy & self.task.ends_unhealthy)

    def _advance(self, numbers: Sequence[int], actions: FloatArray, begin: int, end: int) -> None:
        """The work of a thread on a part of the simulations."""
        model, frame_skip, mujoco = self.task.model, self.task.frame_skip, self._mujoco
        for k in range(begin, end):
            i = numbers[k]
            self._controls[i][:] = actions[k]
            mujoco.mj_step(model, self.data[i], frame_skip)
            if self.task.needs_forces:
                mujoco.mj_rnePostConstraint(model, self.data[i])
            self._copy_fields(i)

    def _copy_fields(self, i: int) -> None:
        for array, view in zip(self._fields.values(), self._views[i], strict=True):
            array[i] = view

    def _note(self, rows: Any, terms: Values) -> None:
        """Keep what the info tells of a step."""
        for name, values in terms.items():
            if name not in self._outcome:
                self._outcome[name] = np.zeros(self.n, dtype=values.dtype)
            self._outcome[name][rows] = values

    @property
    def outcome(self) -> Values:
        return {name: values.copy() for name, values in self._outcome.items()}

    @property
    def info(self) -> Values:
        return {**self.task.info(self._rows(slice(None))), "behavior": self.behaviors}

    @property
    def behaviors(self) -> Float64Array:
        shares = self._touches / np.maximum(self._steps, 1.0)[:, None]
        return self.task.behavior(self._rows(slice(None)), shares)

    @property
    def state(self) -> Float64Array:
        """See `BaseSimulation`: `mjSTATE_INTEGRATION`, and what derives from earlier steps."""
        kind = self._mujoco.mjtState.mjSTATE_INTEGRATION
        states = np.empty((self.n, self._mujoco.mj_stateSize(self.task.model, kind)))
        for data, row in zip(self.data, states, strict=True):
            self._mujoco.mj_getState(self.task.model, data, row, kind)
        return np.hstack([states, self._places, self._steps[:, None], self._touches])

    def _put(self, state: Float64Array) -> None:
        kind, model = self._mujoco.mjtState.mjSTATE_INTEGRATION, self.task.model
        n = self._mujoco.mj_stateSize(model, kind)
        n_places = self._places.shape[1]
        for i, (data, row) in enumerate(zip(self.data, state, strict=True)):
            self._mujoco.mj_resetData(model, data)
            self._mujoco.mj_setState(model, data, row[:n], kind)
            self._mujoco.mj_checkPos(model, data)
            self._mujoco.mj_checkVel(model, data)
            self._mujoco.mj_forward(model, data)  # what is drawn; it warms the solver, too
            self._mujoco.mj_setState(model, data, row[:n], kind)
            self._copy_fields(i)
        self._places[:] = state[:, n : n + n_places]
        self._steps[:] = state[:, n + n_places]
        self._touches[:] = state[:, n + n_places + 1 :]

    def _has_warned(self) -> bool:
        return any(np.count_nonzero(data.warning.number) for data in self.data)

    def write_data(self, simulation: int, data: Any) -> None:
        self._mujoco.mj_copyData(data, self.task.model, self.data[simulation])
        self._mujoco.mj_forward(self.task.model, data)  # to where the step has led
