"""What the bonus of a run says of each place in a maze."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from curiosity_algos.bonuses.make import BONUSES
from curiosity_algos.experiments.names import ALGORITHMS, find_algorithm
from curiosity_algos.experiments.report.arrays import quantize
from curiosity_algos.experiments.report.collect import Run
from curiosity_algos.experiments.report.planes import N_CELLS, Plane
from curiosity_gym.maze.maze_env import MazeEnv

ACTIONS = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]], dtype=np.float32)
"""None, and full acceleration in each direction."""
PLACES = np.array([(0.5 + x / 4, 0.5 + y / 4) for x in (0, -1, 1) for y in (0, -1, 1)])
"""In a cell, as shares of its sides, the middle first: beside a wall it may be too near."""
Observed: TypeAlias = tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]


class Steps(NamedTuple):
    """One step of each action from each free cell, action by action in each."""

    cells: npt.NDArray[np.int64]
    observations: npt.NDArray[np.float32]
    actions: npt.NDArray[np.float32]
    next_observations: npt.NDArray[np.float32]


def has_bonus(run: Run) -> bool:
    """Whether the run has a bonus, of a kind that its checkpoint can give again."""
    settings = run.description.get("settings", {})
    return run.description["algorithm"] in ALGORITHMS and settings.get("bonus") in list(BONUSES)


def steps_of(plane: Plane) -> Steps | None:
    """What a robot at rest observes in each cell of a maze, before and after each action."""
    if plane.maze is None:
        return None
    seen = {
        cell: observed
        for cell in range(N_CELLS * N_CELLS)
        if (observed := _observe_cell(plane.maze, plane, cell)) is not None
    }
    before, after = (np.concatenate(each) for each in zip(*seen.values(), strict=True))
    return Steps(np.array([*seen]), before, np.tile(ACTIONS, (len(seen), 1)), after)


def _observe_cell(maze: MazeEnv, plane: Plane, cell: int) -> Observed | None:
    """What is seen nearest to the middle of a cell; None where the robot fits nowhere in it."""
    row, column = divmod(cell, N_CELLS)
    sides = (plane.high - plane.low) / N_CELLS
    for place in PLACES:
        observed = _observe(maze, plane.low + (np.array([column, row]) + place) * sides)
        if observed is not None:
            return observed
    return None


def _observe(maze: MazeEnv, place: npt.NDArray[np.float64]) -> Observed | None:
    """What is seen at a place and after each action there; None where the robot does not fit."""
    start = {"state": (*place, 0.0, 0.0)}
    try:
        before, _ = maze.reset(options=start)
    except ValueError:
        return None
    after = []
    for action in ACTIONS:
        maze.reset(options=start)
        after.append(maze.step(action)[0])
    return np.tile(before, (len(ACTIONS), 1)), np.array(after)


def bonus_map(run: Run, steps: Steps) -> dict[str, Any]:
    """Mean bonus of the actions in each cell of the maze, by the run's last checkpoint.

    Returns:
        The quantized values, NaN where a robot does not fit; `shown`, the 2nd and 98th percentile,
        where colors end.

    Raises:
        ValueError: If the checkpoint is damaged.
    """
    assert run.folder.checkpoint is not None  # the run has begun
    model = find_algorithm(run.description["algorithm"]).load(run.folder.checkpoint / "model")
    scores = model.trained_bonus.score(steps.observations, steps.actions, steps.next_observations)
    means = scores.reshape(-1, len(ACTIONS)).mean(axis=1, dtype=np.float64)
    values = np.full(N_CELLS * N_CELLS, np.nan)
    values[steps.cells] = means
    shown = np.percentile(means, [2.0, 98.0]).tolist()
    return quantize(values, float(means.min()), float(means.max())) | {"shown": shown}
