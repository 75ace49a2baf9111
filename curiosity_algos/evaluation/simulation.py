"""Control and locomotion tasks in closed loop: MuJoCo on threads, and compiled policies."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding

from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.evaluation.base import Evaluator, KnownTask
from curiosity_algos.evaluation.cells import VisitedCells
from curiosity_algos.evaluation.mlp import Mlp, forward_each, scratch
from curiosity_algos.evaluation.rollouts import (
    Rollouts,
    check_parameters,
    concatenate,
    sparse_returns,
)

MAX_SIMULATIONS = 256
"""Throughput is flat from 56 on, and a simulation takes half a megabyte."""


class SimulationEvaluator(Evaluator):
    """Evaluates populations on one task; the same bits for every number of threads.

    An individual is not stepped after the end of its episode.

    Args:
        known: The task.
        mlp: The policies' shape.
        n_threads: None: as many as there are processors.
    """

    known: KnownTask
    block_size = MAX_SIMULATIONS

    def __init__(self, known: KnownTask, mlp: Mlp, n_threads: int | None = None) -> None:
        self.known = known
        self.mlp = mlp
        self.n_parameters = mlp.n_parameters
        self.draws = known.task.draws
        self._n_threads = n_threads
        self._simulation: Any = None

    def evaluate(self, parameters: Float32Array, seed: int | None = None) -> Rollouts:
        """One episode of each policy (P, n_parameters), all from the start that `seed` draws."""
        parameters = check_parameters(parameters, self.n_parameters)
        rngs = [seeding.np_random(seed)[0]] if self.draws else []
        n = min(len(parameters), MAX_SIMULATIONS)
        if self._simulation is None or self._simulation.n < n:
            self._simulation = self.known.simulate(self.known.task, n, self._n_threads)
        waves = [
            self._play(self._simulation, parameters[begin : begin + n], copy.deepcopy(rngs))
            for begin in range(0, len(parameters), n)
        ]
        return concatenate(waves)

    def _play(
        self, simulation: Any, parameters: Float32Array, rngs: Sequence[np.random.Generator]
    ) -> Rollouts:
        """Play one episode of each policy: at most as many as there are simulations."""
        task, horizon = self.known.task, self.known.horizon
        n, n_steps = len(parameters), self.known.max_steps
        observations = np.empty((n, n_steps + 1, task.n_observations), dtype=np.float32)
        actions = np.empty((n, n_steps, task.n_actions), dtype=np.float32)
        returns, lengths = np.zeros(n), np.full(n, n_steps)
        success, terminated = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
        visited = VisitedCells(task.coverage_grid)
        active = np.arange(n)
        memory = scratch(self.mlp, 1)[0]
        simulation.reset(active, rngs)
        observations[:, 0] = simulation.observations[:n]
        chosen = actions[:, 0].copy()
        for t in range(n_steps):
            forward_each(self.mlp, parameters, observations[active, t], memory, chosen)
            actions[active, t] = chosen
            ended = simulation.step(chosen, active)
            observations[active, t + 1] = simulation.observations[active]
            visited.add(simulation.behaviors[active])
            if horizon is None:
                returns[active] += simulation.rewards[active]
            if ended.any():
                gone = active[ended]
                lengths[gone], success[gone] = t + 1, simulation.success[gone]
                terminated[gone] = True
                active, parameters, chosen = active[~ended], parameters[~ended], chosen[~ended]
            if not len(active):
                break
        success[active] = simulation.success[active]  # cut off by `max_steps`
        longest = int(lengths.max())
        if horizon is not None:
            returns = sparse_returns(horizon, lengths, success)
        return Rollouts(
            returns=returns,
            lengths=lengths,
            success=success,
            terminated=terminated,
            behaviors=simulation.behaviors[:n],
            final_observations=observations[np.arange(n), lengths],
            observations=observations[:, : longest + 1],
            actions=actions[:, :longest],
            visited=None if task.coverage_grid is None else visited.indices(),
        )
