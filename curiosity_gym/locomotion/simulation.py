"""n copies of a robot's physics, each advanced by the calls that Gymnasium makes, on threads.

Not by `mujoco.batch`, as the control tasks are: Gymnasium asks for the forces of contacts after the
last stage of a step (`mj_rnePostConstraint`), which no batch does. It is no faster, either.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from curiosity_gym.compiled import ThreadPool
from curiosity_gym.core import Float32Array, Float64Array, Mask
from curiosity_gym.extras import import_extra
from curiosity_gym.locomotion.tasks import LocomotionTask
from curiosity_gym.locomotion.tasks.base import Values

Ids = npt.NDArray[np.int64]
SLICES_PER_THREAD = 4
"""More slices than threads, as a robot that has fallen has more contacts than one that stands."""


class LocomotionSimulation:
    """n simulations of one task, bit for bit those of Gymnasium's own environment.

    One that MuJoCo finds unstable goes on from the model's own start, as in Gymnasium.

    Args:
        task: The task that is simulated.
        n: Number of simulations.
        n_threads: None: as many as there are processors. Results do not depend on it.

    Attributes:
        observations: (n, O) float64, overwritten by each step.
        rewards: (n,) of the last step of each.
        success: (n,) whether that reached a goal.

    Raises:
        ValueError: If `n_threads` is less than 1.
    """

    def __init__(self, task: LocomotionTask, n: int, n_threads: int | None = None) -> None:
        self.task = task
        self.n = n
        self.observations: Float64Array = np.zeros((n, task.n_observations))
        self.rewards: Float64Array = np.zeros(n)
        self.success: Mask = np.zeros(n, dtype=np.bool_)
        self._steps = np.zeros(n)
        self._touches = np.zeros((n, len(task.foot_bodies)))
        self._outcome: Values = {}
        self._pool = ThreadPool(n_threads)
        self._open()

    def _open(self) -> None:
        """Make the simulations, and the arrays that their fields are copied to."""
        (self._mujoco,) = import_extra("locomotion", "mujoco")
        self.data = [self._mujoco.MjData(self.task.model) for _ in range(self.n)]
        names = self.task.all_fields
        self._views = [[getattr(each, name) for name in names] for each in self.data]
        first = dict(zip(names, self._views[0], strict=True))
        self._fields = {name: np.zeros((self.n, *view.shape)) for name, view in first.items()}
        self._controls = [each.ctrl for each in self.data]
        self._places = self.task.place(self._rows(slice(None)))

    def _rows(self, rows: Any) -> SimpleNamespace:
        return SimpleNamespace(**{name: array[rows] for name, array in self._fields.items()})

    def reset(self, ids: Ids, rngs: Sequence[np.random.Generator]) -> None:
        """Put simulations at a start; the others stay as they are.

        Args:
            ids: Which, sorted.
            rngs: What starts are drawn from, one for each of `ids`, or one for all of them, which
                then begin alike.
        """
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

    def step(self, actions: Float32Array, ids: Ids | None = None) -> Mask:
        """Advance simulations `ids` by a step.

        Args:
            actions: (k, n_actions), one row for each of `ids`; what is beyond its range costs what
                it costs, and acts as far as its range goes.
            ids: k of them, sorted; None: all.

        Returns:
            Which of their episodes end, (k,).
        """
        numbers = range(self.n) if ids is None else ids.tolist()
        self._on_threads(self._advance(numbers, actions), len(numbers))
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
        self._note(rows, {**_by_axis((place - before) / self.task.dt), **terms})
        self.observations[rows] = self.task.observe(fields)
        self.success[rows] = success = self.task.success(fields)
        return success | (~healthy & self.task.ends_unhealthy)

    def _advance(self, numbers: Sequence[int], actions: Float32Array) -> Callable[[int, int], None]:
        """What each thread does with a part of the simulations."""
        model, frame_skip, mujoco = self.task.model, self.task.frame_skip, self._mujoco
        needs_forces = self.task.needs_forces

        def advance(begin: int, end: int) -> None:
            for k in range(begin, end):
                i = numbers[k]
                self._controls[i][:] = actions[k]
                mujoco.mj_step(model, self.data[i], frame_skip)
                if needs_forces:
                    mujoco.mj_rnePostConstraint(model, self.data[i])
                self._copy_fields(i)

        return advance

    def _on_threads(self, function: Callable[[int, int], None], n: int) -> None:
        self._pool.run(function, n, SLICES_PER_THREAD * self._pool.n_threads)

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
        """What the infos tell of the last step of each, new arrays (n, ...)."""
        return {name: values.copy() for name, values in self._outcome.items()}

    @property
    def info(self) -> Values:
        """What the infos tell at any time, new arrays (n, ...), the behavior among them."""
        return {**self.task.info(self._rows(slice(None))), "behavior": self.behaviors}

    @property
    def behaviors(self) -> Float64Array:
        """(n, B) the behavior of each episode, clipped to its bounds; a new array."""
        shares = self._touches / np.maximum(self._steps, 1.0)[:, None]
        return self.task.behavior(self._rows(slice(None)), shares)

    @property
    def state(self) -> Float64Array:
        """(n, S) all that the next steps depend on; a new array.

        A state of `mjSTATE_INTEGRATION`, with the solver's warm start; after it, where the velocity
        is measured from, steps, and steps that each foot touched something.
        """
        kind = self._mujoco.mjtState.mjSTATE_INTEGRATION
        states = np.empty((self.n, self._mujoco.mj_stateSize(self.task.model, kind)))
        for data, row in zip(self.data, states, strict=True):
            self._mujoco.mj_getState(self.task.model, data, row, kind)
        return np.hstack([states, self._places, self._steps[:, None], self._touches])

    def restore(self, state: Float64Array) -> None:
        """Go on from a `state`, bit for bit; `observations` stay, as forces are no part of it.

        Raises:
            ValueError: If MuJoCo warns of it, if steps are not whole, or if more of them have
                touched something than there were; the simulations are where they were then.
        """
        before = self.state
        n_feet = self._touches.shape[1]
        counts = state[:, -1 - n_feet :]
        steps, touches = np.split(counts, [1], axis=1)
        is_whole = np.isfinite(counts).all() and (counts == np.floor(np.abs(counts))).all()
        if not is_whole or (touches > steps).any():
            raise ValueError("`state` must count whole steps, no more on a foot than there were.")
        self._put(state)
        if any(np.count_nonzero(data.warning.number) for data in self.data):
            self._put(before)
            raise ValueError("`state` must be one that physics led to: MuJoCo warns of it.")

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

    def write_data(self, simulation: int, data: Any) -> None:
        """Write one simulation's state and derived fields into an `MjData`, to draw it."""
        self._mujoco.mj_copyData(data, self.task.model, self.data[simulation])

    def __getstate__(self) -> dict[str, Any]:
        """Pickle the state of the physics."""
        held = ("task", "n", "observations", "rewards", "success", "_pool", "_outcome")
        return {**{name: getattr(self, name) for name in held}, "state": self.state}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the simulations anew: the next step gives the same bits as that of the original."""
        rows = state.pop("state")
        self.__dict__.update(state)
        self._steps = np.zeros(self.n)
        self._touches = np.zeros((self.n, len(self.task.foot_bodies)))
        self._open()
        self._put(rows)


def _by_axis(velocity: Float64Array) -> Values:
    """What the info tells of velocities (k, d)."""
    return dict(zip(("x_velocity", "y_velocity"), velocity.T, strict=False))
