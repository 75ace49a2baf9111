"""n robots in one maze: the state of all in arrays, one compiled call a step."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from curiosity_gym.compiled import ThreadPool, compiled
from curiosity_gym.core import CoverageGrid, Float32Array, Float64Array, FloatArray, Frame, Mask
from curiosity_gym.layouts import ROBOT_RADIUS, MazeLayout, are_free, reachable_cells
from curiosity_gym.maze.dynamics import DT, MARGIN, N_BASE_FEATURES, Maze, draw_start, observe, step
from curiosity_gym.simulation import BaseSimulation, Ids, Options, Rngs, Values

ENVS_PER_THREAD = 128
"""Least number of robots a thread: handing fewer over costs more than stepping them."""
NEAREST = ROBOT_RADIUS - 1.01 * MARGIN
"""Least distance from a wall to a robot that slides past its corner, less a bit for rounding."""
TOLERANCE = 1e-4
"""Error of an observation on another processor, whose cosines may end in other bits."""


@compiled
def _step_slice(
    maze: Maze,
    begin: int,
    end: int,
    ids: Ids,
    states: Float64Array,
    actions: Float32Array,
    observations: Float32Array,
    success: Mask,
) -> None:
    """Step the robots `ids[begin:end]`."""
    for k in range(begin, end):
        i = ids[k]
        success[i] = step(maze, states[i], actions[k], observations[i])


@compiled
def _observe(maze: Maze, ids: Ids, states: Float64Array, observations: Float32Array) -> None:
    for i in ids:
        observe(maze, states[i], observations[i])


class MazeSimulation(BaseSimulation):
    """n robots in one maze; `states` (n, 4) are their x, y, vx, vy."""

    behavior_names = (
        *("x (maze units)", "y (maze units)"),
        *("x velocity (maze units/s)", "y velocity (maze units/s)"),
    )
    fps = round(1.0 / DT)

    def __init__(
        self,
        layout: MazeLayout,
        maze: Maze,
        lidar_range: float,
        n: int = 1,
        n_threads: int | None = None,
    ) -> None:
        self.layout, self.maze, self.lidar_range, self.n = layout, maze, lidar_range, n
        n_beams = len(maze.inverse_x)
        low = np.concatenate([np.full(N_BASE_FEATURES, -1.0), np.zeros(n_beams)]).astype(np.float32)
        self.observation_space = spaces.Box(low, np.ones_like(low))
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        world, speed = np.array([layout.width, layout.height]), np.full(2, maze.max_speed)
        bounds = np.append(np.zeros(2), -speed), np.append(world, speed)
        self.behavior_space = spaces.Box(*bounds, dtype=np.float64)
        cells = reachable_cells(layout)
        self.coverage_grid = CoverageGrid((0, 1), np.zeros(2), world, reachable=cells)
        self.observations = np.zeros((n, *low.shape), dtype=np.float32)
        self.success = np.zeros(n, dtype=np.bool_)
        self.states = np.tile(maze.start, (n, 1))
        self.draws = maze.start_radius > 0.0
        self._all = np.arange(n)
        self._pool = ThreadPool(n_threads)

    def replicate(self, n: int, n_threads: int | None) -> MazeSimulation:
        return MazeSimulation(self.layout, self.maze, self.lidar_range, n, n_threads)

    def reset(self, ids: Ids | None = None, rngs: Rngs = (), options: Options = None) -> None:
        """See `BaseSimulation`; the option `state` (4,) is where to begin."""
        ids = self._all if ids is None else ids
        self.states[ids] = self._start(rngs, options)
        self.success[ids] = False
        _observe(self.maze, ids, self.states, self.observations)

    def _start(self, rngs: Rngs, options: Options) -> Float64Array:
        if not options or options.get("state") is None:
            return np.array([draw_start(self.maze, rng) for rng in rngs] or self.maze.start)
        state = np.array(options["state"], dtype=np.float64)
        is_slow = state.shape == (4,) and (np.abs(state[2:]) <= self.maze.max_speed).all()
        if not is_slow or not are_free(self.layout, state[None, :2], NEAREST).all():
            raise ValueError(
                '`options["state"]` must be x, y, vx, vy, with speeds of at most '
                f"{self.maze.max_speed:g} and {ROBOT_RADIUS:g} from walls and border, got {state}."
            )
        return state

    def step(self, actions: FloatArray, ids: Ids | None = None) -> Mask:
        rows = self._all if ids is None else ids
        arrays = (rows, self.states, actions, self.observations, self.success)

        def run(begin: int, end: int) -> None:
            _step_slice(self.maze, begin, end, *arrays)

        n_slices = min(self._pool.n_threads, len(rows) // ENVS_PER_THREAD)
        if n_slices < 2:
            run(0, len(rows))
        else:
            self._pool.run(run, len(rows), n_slices)
        return self.success.copy() if ids is None else self.success[ids]

    @property
    def behaviors(self) -> Float64Array:
        return self.states.copy()

    @property
    def info(self) -> Values:
        position, velocity = self.states[:, :2].copy(), self.states[:, 2:].copy()
        return {"position": position, "velocity": velocity, "behavior": self.behaviors}

    @property
    def state(self) -> Float64Array:
        return self.states.copy()

    def restore(self, state: Float64Array, observations: FloatArray) -> None:
        """See `BaseSimulation`; robots must see there what was observed."""
        expected = np.empty_like(self.observations)
        _observe(self.maze, self._all, state, expected)
        if not np.allclose(observations, expected, rtol=0.0, atol=TOLERANCE):
            raise ValueError(
                "`state` must be of this maze: its observations are not what is seen there."
            )
        self.states[:], self.observations[:] = state, observations

    def draw(self, viewer: Any, index: int) -> Frame:
        beams = self.observations[index, N_BASE_FEATURES:] * self.lidar_range
        return viewer.draw(self.states[index], beams)
