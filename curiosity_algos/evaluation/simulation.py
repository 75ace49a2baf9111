"""Control and locomotion tasks in closed loop: MuJoCo on threads, and compiled policies."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from curiosity_algos.evaluation.cells import VisitedCells
from curiosity_algos.evaluation.policies import Float32Array, Mlp, forward_each, scratch
from curiosity_algos.evaluation.rollouts import (
    Rollouts,
    check_parameters,
    concatenate,
    padded_rollouts,
    sparse_returns,
)
from curiosity_gym.core import CoverageGrid, Float64Array, FloatArray, Mask

MAX_SIMULATIONS = 256
"""Throughput is flat from 56 on, and a simulation takes half a megabyte."""


class Simulation(Protocol):
    """N simulations of one task; with `rewards`, (n,) of the last steps, unless it is sparse."""

    @property
    def n(self) -> int:
        """Number of simulations."""
        ...

    @property
    def observations(self) -> FloatArray:
        """(n, O), overwritten by each step."""
        ...

    @property
    def success(self) -> Mask:
        """(n,) whether the last step of each reached the goal, overwritten likewise."""
        ...

    @property
    def behaviors(self) -> Float64Array:
        """Of each episode so far, (n, B)."""
        ...

    def reset(self, ids: npt.NDArray[np.int64], rngs: Sequence[np.random.Generator]) -> None:
        """Begin episodes in simulations `ids`, of a generator each, or one for all."""
        ...

    def step(self, actions: Float32Array, ids: npt.NDArray[np.int64]) -> Mask:
        """Step simulations `ids`; which of their episodes end."""
        ...


class Task(Protocol):
    """What is simulated: its sizes, and the cells that coverage counts."""

    @property
    def n_observations(self) -> int:
        """Length of an observation."""
        ...

    @property
    def n_actions(self) -> int:
        """Number of actuators."""
        ...

    @property
    def coverage_grid(self) -> CoverageGrid | None:
        """None: there is nothing to count."""
        ...

    @property
    def draws(self) -> bool:
        """Whether episodes begin at random."""
        ...


class SimulationEvaluator:
    """Evaluates populations on one task; the same bits for every number of threads.

    An individual whose episode has ended is not stepped any more.

    Args:
        task: The task.
        simulate: `simulate(task, n, n_threads)` makes its simulations.
        mlp: The policies' shape.
        max_steps: Steps after which an episode ends.
        horizon: T of the reward, 1 - t / T for a success after t steps; None: rewards are those of
            the simulation, added up.
        n_threads: None: as many as there are processors.
    """

    def __init__(
        self,
        task: Task,
        simulate: Callable[..., Simulation],
        mlp: Mlp,
        *,
        max_steps: int,
        horizon: int | None = None,
        n_threads: int | None = None,
    ) -> None:
        self.task = task
        self._simulate = simulate
        self.mlp = mlp
        self.max_steps = max_steps
        self.horizon = horizon
        self.n_parameters = mlp.n_parameters
        self.block_size = MAX_SIMULATIONS
        self.draws = task.draws
        self._n_threads = n_threads
        self._simulation: Simulation | None = None

    def evaluate(self, parameters: Float32Array, seed: int | None = None) -> Rollouts:
        """One episode of each policy (P, n_parameters).

        A random start is that of the env's reset with `seed`, the same for all; None: a new one.
        """
        parameters = check_parameters(parameters, self.n_parameters)
        rngs = [seeding.np_random(seed)[0]] if self.task.draws else []
        n = min(len(parameters), MAX_SIMULATIONS)
        if self._simulation is None or self._simulation.n < n:
            self._simulation = self._simulate(self.task, n, self._n_threads)
        waves = [
            self._play(self._simulation, parameters[begin : begin + n], copy.deepcopy(rngs))
            for begin in range(0, len(parameters), n)
        ]
        return concatenate(waves)

    def _play(
        self,
        simulation: Simulation,
        parameters: Float32Array,
        rngs: Sequence[np.random.Generator],
    ) -> Rollouts:
        """Play one episode of each of at most as many policies as there are simulations."""
        n, n_steps = len(parameters), self.max_steps
        observations = np.empty((n, n_steps + 1, self.task.n_observations), dtype=np.float32)
        actions = np.empty((n, n_steps, self.task.n_actions), dtype=np.float32)
        returns, lengths = np.zeros(n), np.full(n, n_steps)
        success = np.zeros(n, dtype=np.bool_)
        visited = VisitedCells(self.task.coverage_grid)
        active = np.arange(n)
        even, odd = scratch(self.mlp, 1)
        rewards: Any = getattr(simulation, "rewards", None)  # its own, which each step writes
        simulation.reset(active, rngs)
        observations[:, 0] = simulation.observations[:n]
        chosen = actions[:, 0].copy()
        for t in range(n_steps):
            forward_each(self.mlp, parameters, observations[active, t], even[0], odd[0], chosen)
            actions[active, t] = chosen
            ended = simulation.step(chosen, active)
            observations[active, t + 1] = simulation.observations[active]
            visited.add(simulation.behaviors[active])
            if self.horizon is None:
                returns[active] += rewards[active]
            if ended.any():
                gone = active[ended]
                lengths[gone], success[gone] = t + 1, simulation.success[gone]
                active, parameters, chosen = active[~ended], parameters[~ended], chosen[~ended]
            if not len(active):
                break
        success[active] = simulation.success[active]  # cut off by `max_steps`
        longest = int(lengths.max())
        if self.horizon is not None:
            returns = sparse_returns(self.horizon, lengths, success)
        return padded_rollouts(
            returns=returns,
            lengths=lengths,
            success=success,
            behaviors=simulation.behaviors[:n],
            observations=observations[:, : longest + 1],
            actions=actions[:, :longest],
            visited=None if self.task.coverage_grid is None else visited.indices(),
        )
