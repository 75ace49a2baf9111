"""Control tasks in closed loop: one batch of physics, and compiled policies."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
from gymnasium.utils import seeding

from curiosity_algos.evaluation.cells import VisitedCells
from curiosity_algos.evaluation.policies import Float32Array, Mlp, forward_each, scratch
from curiosity_algos.evaluation.rollouts import (
    Rollouts,
    check_parameters,
    concatenate,
    sparse_rollouts,
)
from curiosity_gym.control.simulation import Simulation
from curiosity_gym.control.tasks import ControlTask

MAX_SIMULATIONS = 256
"""Throughput is flat from 56 on, and a simulation takes half a megabyte."""


class ControlEvaluator:
    """Evaluates populations on one control task; the same bits for every number of threads.

    An individual that has succeeded is not stepped any more.

    Args:
        task: The task.
        horizon: T of the reward, 1 - t / T for a success after t steps.
        mlp: The policies' shape.
        n_threads: None: as many as there are processors.
        max_steps: Steps after which an episode ends; None: the horizon.
    """

    def __init__(
        self,
        task: ControlTask,
        horizon: int,
        mlp: Mlp,
        n_threads: int | None = None,
        max_steps: int | None = None,
    ) -> None:
        self.task = task
        self.horizon = horizon
        self.max_steps = horizon if max_steps is None else max_steps
        self.mlp = mlp
        self.n_parameters = mlp.n_parameters
        self.block_size = MAX_SIMULATIONS
        self._n_threads = n_threads
        self._simulation: Simulation | None = None

    def evaluate(self, parameters: Float32Array, seed: int | None = None) -> Rollouts:
        """One episode of each policy (P, n_parameters).

        A random start is that of the env's reset with `seed`, the same for all; None: a new one.
        """
        parameters = check_parameters(parameters, self.n_parameters)
        rngs = [seeding.np_random(seed)[0]] if self.task.random_start else []
        n = min(len(parameters), MAX_SIMULATIONS)
        if self._simulation is None or self._simulation.n < n:
            self._simulation = Simulation(self.task, n, self._n_threads)
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
        lengths = np.full(n, n_steps)
        success = np.zeros(n, dtype=np.bool_)
        visited = VisitedCells(self.task.coverage_grid)
        active = np.arange(n)
        even, odd = scratch(self.mlp, 1)
        simulation.reset(active, rngs)
        observations[:, 0] = simulation.observations[:n]
        chosen = actions[:, 0].copy()
        for t in range(n_steps):
            forward_each(self.mlp, parameters, observations[active, t], even[0], odd[0], chosen)
            actions[active, t] = chosen
            succeeded = simulation.step(chosen, active)
            observations[active, t + 1] = simulation.observations[active]
            visited.add(simulation.behaviors[active])
            if succeeded.any():
                lengths[active[succeeded]], success[active[succeeded]] = t + 1, True
                going = ~succeeded
                active, parameters, chosen = active[going], parameters[going], chosen[going]
            if not len(active):
                break
        longest = int(lengths.max())
        return sparse_rollouts(
            self.horizon,
            lengths=lengths,
            success=success,
            behaviors=simulation.behaviors[:n],
            observations=observations[:, : longest + 1],
            actions=actions[:, :longest],
            visited=visited.indices(),
        )
