"""Plays policies in mazes: policy and dynamics are compiled as one, and threads share the work."""

from __future__ import annotations

import math

import numpy as np
from gymnasium.utils import seeding

from curiosity_algos.common.arrays import Float32Array, Float64Array, Int64Array, Mask
from curiosity_algos.evaluation.base import Evaluator, KnownTask
from curiosity_algos.evaluation.cells import CompiledGrid, cell_of, compiled_grid
from curiosity_algos.evaluation.mlp import Mlp, forward, scratch
from curiosity_algos.evaluation.rollouts import Rollouts, check_parameters, sparse_returns
from curiosity_gym.compiled import ThreadPool, compiled
from curiosity_gym.maze.dynamics import N_BASE_FEATURES, Maze, draw_start, reset, step

SLICES_PER_THREAD = 4
"""More slices than threads, as episodes differ in length."""
BLOCK_SIZE = 128
"""Individuals whose trajectories get the same memory from malloc again; more would not."""


@compiled
def _rollout_slice(
    maze: Maze,
    grid: CompiledGrid,
    mlp: Mlp,
    parameters: Float32Array,
    begin: int,
    end: int,
    memory: Float32Array,
    observations: Float32Array,
    actions: Float32Array,
    states: Float64Array,
    lengths: Int64Array,
    success: Mask,
    visited: Mask,
) -> None:
    """Play an episode of each of the individuals `begin` to `end`, and mark its cells.

    Each writes only its own rows of the arrays; an episode ends when those of `actions` are full.
    """
    for i in range(begin, end):
        state = states[i]
        reset(maze, state, observations[i, 0])
        lengths[i], success[i] = actions.shape[1], False
        for t in range(actions.shape[1]):
            forward(mlp, parameters[i], observations[i, t], memory[i], actions[i, t])
            if step(maze, state, actions[i, t], observations[i, t + 1]):
                visited[i, cell_of(grid, state)] = True
                lengths[i], success[i] = t + 1, True
                break
            visited[i, cell_of(grid, state)] = True  # twice, as it is slower before the branch


class MazeEvaluator(Evaluator):
    """Evaluates populations on one maze; the same bits for every number of threads.

    Args:
        known: The maze.
        mlp: The policies' shape.
        n_threads: None: as many as there are processors.
    """

    known: KnownTask
    block_size = BLOCK_SIZE

    def __init__(self, known: KnownTask, mlp: Mlp, n_threads: int | None = None) -> None:
        self.known = known
        self.mlp = mlp
        self.n_parameters = mlp.n_parameters
        self.draws = known.task.start_radius > 0.0
        self._grid = compiled_grid(known.grid)
        self._pool = ThreadPool(n_threads)

    def evaluate(self, parameters: Float32Array, seed: int | None = None) -> Rollouts:
        """One episode of each policy (P, n_parameters), all from the start that `seed` draws."""
        parameters = check_parameters(parameters, self.n_parameters)
        assert self.known.horizon is not None
        n, n_steps, maze = len(parameters), self.known.max_steps, self.known.task
        if self.draws:
            maze = maze._replace(start=draw_start(maze, seeding.np_random(seed)[0]))
        n_features = N_BASE_FEATURES + len(maze.inverse_x)
        observations = np.empty((n, n_steps + 1, n_features), dtype=np.float32)
        actions = np.empty((n, n_steps, 2), dtype=np.float32)
        states = np.empty((n, 4))
        lengths = np.empty(n, dtype=np.int64)
        success = np.empty(n, dtype=np.bool_)
        visited = np.zeros((n, math.prod(self.known.grid.shape)), dtype=np.bool_)
        memory = scratch(self.mlp, n)

        def run(begin: int, end: int) -> None:
            arrays = (memory, observations, actions, states, lengths, success, visited)
            _rollout_slice(maze, self._grid, self.mlp, parameters, begin, end, *arrays)

        self._pool.run(run, n, SLICES_PER_THREAD * self._pool.n_threads)
        return Rollouts(
            returns=sparse_returns(self.known.horizon, lengths, success),
            lengths=lengths,
            success=success,
            terminated=success,
            behaviors=states,
            final_observations=observations[np.arange(n), lengths],
            observations=observations,
            actions=actions,
            visited=np.flatnonzero(visited.any(axis=0)),
        )
