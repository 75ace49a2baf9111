"""n copies of a task's physics, stepped together by MuJoCo's own batch."""

from __future__ import annotations

import copy
import os
from types import SimpleNamespace
from typing import Any

import numpy as np

from curiosity_gym.control.tasks import ControlTask
from curiosity_gym.core import Float64Array, FloatArray, Mask, SimulationError
from curiosity_gym.extras import import_extra
from curiosity_gym.forks import keep_in_children
from curiosity_gym.processors import available_cpus
from curiosity_gym.simulation import Ids, MujocoSimulation, Options, Rngs, Values
from curiosity_gym.validation import check_at_least_one


class Simulation(MujocoSimulation):
    """n simulations of one task, bit for bit those of dm_control's own environment."""

    task: ControlTask

    def __init__(self, task: ControlTask, n: int, n_threads: int | None = None) -> None:
        if n_threads is not None:
            check_at_least_one(n_threads=n_threads)
        super().__init__(task, n, n_threads)
        (self._mujoco, batch) = import_extra("control", "mujoco", "mujoco.batch")
        n_threads = min(n, n_threads or available_cpus())
        # Persistent: an MjData each, from which the next step goes on and which the viewer draws.
        self._batch = batch.Batch(task.model, n, n_threads, persistent=True)
        self._owner = os.getpid()
        keep_in_children(self, self._batch)
        self._controls: Float64Array = self._batch.bind("ctrl")
        self._warnings = self._batch.warning[:, :, 1]
        self._fields = {name: self._batch.bind(name) for name in task.fields}
        self._targets = np.empty((n, 0))  # each simulation's own (n, 3), where it moves
        if (kind := task.moving_target) is not None:
            target = getattr(task.model, kind)("target").id
            self._targets = self._batch.expand(f"{kind}_pos")[:, target]
        self._start = task.start_state(task.model)
        self._random_starts = RandomStarts(task) if task.draws else None

    def reset(self, ids: Ids | None = None, rngs: Rngs = (), options: Options = None) -> None:
        self._stay_in_process()
        ids, rows = self._select(ids)
        starts = self._start
        if self._random_starts is not None:
            starts = np.stack([self._random_starts.draw(rng) for rng in rngs])
        self._write(rows, starts)
        self._batch.forward(ids, self._mujoco.mjtStage.mjSTAGE_ACC.value)
        self.success[rows] = False
        self._observe(rows)

    def _write(self, rows: Any, states: Float64Array) -> None:
        n = self._batch.state.shape[1]
        self._batch.state[rows] = states[..., :n]
        self._targets[rows] = states[..., n:]

    def step(self, actions: FloatArray, ids: Ids | None = None) -> Mask:
        """See `BaseSimulation`; a SimulationError, if MuJoCo warned of one, and maybe reset it."""
        self._stay_in_process()
        ids, rows = self._select(ids)
        self._controls[rows] = actions
        # dm_control steps with mj_step2, mj_step, mj_step1: of the stages, this one equals it.
        stage = self._mujoco.mjtStage.mjSTAGE_VEL.value
        self._batch.step(ids, self.task.n_substeps, stage)
        if self._warnings.any():
            simulation, kind = np.argwhere(self._warnings)[0].tolist()
            self._batch.warning[:] = 0
            raise SimulationError.of(self._mujoco.mjtWarning(kind), simulation)
        self.success[rows] = solved = self.task.success(self._observe(rows))
        return solved

    def _select(self, ids: Ids | None) -> tuple[Ids | None, Any]:
        """The ids as the batch takes them, and as an index: a slice for all, which copies less."""
        if ids is None or len(ids) == self.n:
            return None, slice(None)
        return ids, ids

    def _observe(self, rows: Any) -> SimpleNamespace:
        """Write the observations of `rows`; their fields."""
        fields = SimpleNamespace(**{name: array[rows] for name, array in self._fields.items()})
        observations = self.observations[rows]  # a view of all, or a copy of some
        self.task.observe(fields, observations)
        self.observations[rows] = observations
        return fields

    @property
    def behaviors(self) -> Float64Array:
        behaviors = self.task.behavior(SimpleNamespace(**self._fields))
        return np.clip(behaviors, self.task.behavior_low, self.task.behavior_high)

    @property
    def info(self) -> Values:
        return {"behavior": self.behaviors}

    @property
    def state(self) -> Float64Array:
        return np.hstack([self._batch.state, self._targets])

    def _put(self, state: Float64Array) -> None:
        self._stay_in_process()
        self._write(slice(None), state)
        self._batch.forward(None, self._mujoco.mjtStage.mjSTAGE_VEL.value)

    def _has_warned(self) -> bool:
        has_warned = bool(self._warnings.any())
        self._batch.warning[:] = 0
        return has_warned

    def write_data(self, simulation: int, data: Any) -> None:
        self._batch.get_data(simulation, data)

    def _stay_in_process(self) -> None:
        """Threads do not survive a fork: a child process makes its own batch."""
        if self._owner != os.getpid():
            self.__setstate__(self.__getstate__())


class RandomStarts:
    """Draws starts as dm_control does, and draws again where the task is already solved."""

    def __init__(self, task: ControlTask) -> None:
        # dm_control moves the target in the model itself.
        (wrapper,) = import_extra("control", "dm_control.mujoco.wrapper")
        model = wrapper.MjModel(copy.copy(task.model))
        self._task = task
        self._physics = task.suite.Physics.from_model(model)

    def draw(self, rng: np.random.Generator) -> Float64Array:
        """A start, (S,), as `ControlTask.state` gives it, drawn from a generator's own bits."""
        episode = self._task.make_suite_task(np.random.RandomState(rng.bit_generator))
        while True:
            with self._physics.reset_context():
                episode.initialize_episode(self._physics)
            data = self._physics.data.ptr
            fields = {name: getattr(data, name)[None] for name in self._task.fields}
            if not self._task.success(SimpleNamespace(**fields))[0]:
                return self._task.state(self._physics.model.ptr, data)
