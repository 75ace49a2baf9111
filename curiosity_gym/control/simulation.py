"""n copies of a task's physics, stepped together by MuJoCo's own batch."""

from __future__ import annotations

import os
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from curiosity_gym.control.starts import RandomStarts
from curiosity_gym.control.tasks import ControlTask
from curiosity_gym.core import Float32Array, Float64Array, Mask, SimulationError
from curiosity_gym.extras import import_extra
from curiosity_gym.forks import keep_in_children
from curiosity_gym.processors import available_cpus
from curiosity_gym.validation import check_at_least_one


class Simulation:
    """n simulations of one task, bit for bit those of dm_control's own environment.

    Args:
        task: The task that is simulated.
        n: Number of simulations.
        n_threads: None: as many as there are processors. Results do not depend on it.

    Attributes:
        observations: (n, O) float32, overwritten by each step.
        success: (n,) whether the last step of each solved the task.

    Raises:
        ValueError: If `n_threads` is less than 1.
    """

    def __init__(self, task: ControlTask, n: int, n_threads: int | None = None) -> None:
        if n_threads is not None:
            check_at_least_one(n_threads=n_threads)
        self.task = task
        self.n = n
        self.n_threads = min(n, n_threads or available_cpus())
        self.observations: Float32Array = np.zeros((n, task.n_observations), dtype=np.float32)
        self.success: Mask = np.zeros(n, dtype=np.bool_)
        self._open()

    def _open(self) -> None:
        """Make the batch, which owns threads, and bind the arrays that are views of it."""
        (self._mujoco, batch) = import_extra("control", "mujoco", "mujoco.batch")
        # Persistent: an MjData each, from which the next step goes on and which the viewer draws.
        self._batch = batch.Batch(self.task.model, self.n, self.n_threads, persistent=True)
        self._owner = os.getpid()
        keep_in_children(self, self._batch)
        self._controls: Float64Array = self._batch.bind("ctrl")
        self._warnings = self._batch.warning[:, :, 1]
        self._fields = {name: self._batch.bind(name) for name in self.task.fields}
        self._targets = self._open_targets()
        self._start = self.task.start_state(self.task.model)
        self._random_starts = RandomStarts(self.task) if self.task.random_start else None

    def _open_targets(self) -> Float64Array:
        """Each simulation's own target (n, 3), a view; (n, 0) where it never moves."""
        kind = self.task.moving_target
        if kind is None:
            return np.empty((self.n, 0))
        targets = self._batch.expand(f"{kind}_pos")
        view: Float64Array = targets[:, getattr(self.task.model, kind)("target").id]
        return view

    def reset(
        self,
        ids: npt.NDArray[np.int64] | None = None,
        rngs: Sequence[np.random.Generator] = (),
    ) -> None:
        """Put simulations at a start; the others stay as they are.

        Args:
            ids: Which, sorted; None: all.
            rngs: What random starts are drawn from, one for each of `ids`, or one for all of them,
                which then begin alike. Fixed starts take none.
        """
        self._stay_in_process()
        ids, rows = self._select(ids)
        self._write(rows, self._draw_starts(rngs))
        self._batch.forward(ids, self._mujoco.mjtStage.mjSTAGE_ACC.value)
        self._observe(rows)

    def _draw_starts(self, rngs: Sequence[np.random.Generator]) -> Float64Array:
        """The starts, (k, S) or (S,)."""
        if self._random_starts is None:
            return self._start
        return np.stack([self._random_starts.draw(rng) for rng in rngs])

    def _write(self, rows: Any, states: Float64Array) -> None:
        n = self._batch.state.shape[1]
        self._batch.state[rows] = states[..., :n]
        self._targets[rows] = states[..., n:]

    def step(
        self, actions: npt.NDArray[np.floating[Any]], ids: npt.NDArray[np.int64] | None = None
    ) -> Mask:
        """Advance simulations `ids` by a control step.

        Args:
            actions: (k, n_actions), one row for each of `ids`.
            ids: k of them, sorted; None: all.

        Returns:
            Which of them are at the goal, (k,).

        Raises:
            SimulationError: If MuJoCo warned of a simulation, most of which it then resets.
        """
        self._stay_in_process()
        ids, rows = self._select(ids)
        self._controls[rows] = actions
        # dm_control steps with mj_step2, mj_step, mj_step1: of the stages, this one equals it.
        stage = self._mujoco.mjtStage.mjSTAGE_VEL.value
        self._batch.step(ids, self.task.n_substeps, stage)
        if self._warnings.any():
            self._raise_warning()
        self.success[rows] = solved = self.task.success(self._observe(rows))
        return solved

    def _select(
        self, ids: npt.NDArray[np.int64] | None
    ) -> tuple[npt.NDArray[np.int64] | None, Any]:
        """The ids as the batch takes them, and as an index: a slice for all, which copies less."""
        if ids is None or len(ids) == self.n:
            return None, slice(None)
        return ids, ids

    def _observe(self, rows: Any) -> SimpleNamespace:
        """Write the observations of `rows`; their fields."""
        fields = SimpleNamespace(**{name: array[rows] for name, array in self._fields.items()})
        if isinstance(rows, slice):
            self.task.observe(fields, self.observations)
        else:
            observations = np.empty((len(rows), self.task.n_observations), dtype=np.float32)
            self.task.observe(fields, observations)
            self.observations[rows] = observations
        return fields

    def _raise_warning(self) -> None:
        simulation, kind = np.argwhere(self._warnings)[0].tolist()
        self._batch.warning[:] = 0
        name = self._mujoco.mjtWarning(kind).name.removeprefix("mjWARN_")
        raise SimulationError(
            f"MuJoCo warned of {name} in simulation {simulation} and may have reset it: "
            "its episode cannot go on, reset the environment."
        )

    @property
    def behaviors(self) -> Float64Array:
        """(n, B) the behavior of each episode, clipped to its bounds; a new array."""
        behaviors = self.task.behavior(SimpleNamespace(**self._fields))
        return np.clip(behaviors, self.task.behavior_low, self.task.behavior_high)

    @property
    def state(self) -> Float64Array:
        """(n, S) all that the next steps depend on, as `ControlTask.state`; a new array."""
        return np.hstack([self._batch.state, self._targets])

    def restore(self, state: Float64Array) -> None:
        """Go on from a `state`, bit for bit; `observations` stay, as MuJoCo's state lacks touch.

        Raises:
            ValueError: If MuJoCo warns of it; the simulations are where they were then.
        """
        self._stay_in_process()
        before = self.state
        self._put(state)
        if self._warnings.any():
            self._batch.warning[:] = 0
            self._put(before)
            raise ValueError("`state` must be one that physics led to: MuJoCo warns of it.")

    def _put(self, state: Float64Array) -> None:
        """Write the states and what derives from them, as a step leaves it."""
        self._write(slice(None), state)
        self._batch.forward(None, self._mujoco.mjtStage.mjSTAGE_VEL.value)

    def write_data(self, simulation: int, data: Any) -> None:
        """Write one simulation's state and derived fields into an `MjData`, to draw it."""
        self._batch.get_data(simulation, data)

    def _stay_in_process(self) -> None:
        """Threads do not survive a fork: a child process makes its own batch."""
        if self._owner != os.getpid():
            self.__setstate__(self.__getstate__())

    def __getstate__(self) -> dict[str, Any]:
        """Pickle the state of the physics; the batch itself owns threads and does not pickle."""
        kept = ("task", "n", "n_threads", "observations", "success")
        return {**{name: getattr(self, name) for name in kept}, "state": self.state}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the batch anew: the next step gives the same bits as that of the original."""
        rows = state.pop("state")
        self.__dict__.update(state)
        self._open()
        self._put(rows)
