"""The nearest neighbors of novelty search in a full archive, beside a linear scan."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.distance import cdist

from benchmarks.measure import Plan, Row, Table, Task, interleave, ratios, seconds
from curiosity_algos.motivations.novelty import NoveltyArchive
from curiosity_gym.maze.dynamics import observe
from curiosity_gym.maze.maze_env import MazeEnv

FloatArray = npt.NDArray[np.float64]

MAZE = "us"
N_BEHAVIORS = 500_000
POPULATION_SIZE, N_NEIGHBORS = 56, 20
UNIT = "ms"


def run(plan: Plan) -> list[Table]:
    """Milliseconds a generation: neighbors of a population, which then enters the archive."""
    n_behaviors, n_around = plan.size(N_BEHAVIORS, 2000), plan.size(20_000, 100)
    states = maze_states(n_behaviors + n_around)
    behaviors = {"x, y, vx, vy": states, "observation": observations(states)}
    tasks: dict[str, Task] = {}
    for name, rows in behaviors.items():
        tasks[name] = archive_task(rows, 2 * n_around)
        tasks[f"{name}, linear scan"] = scan_task(rows[:n_behaviors], plan.size(3, 1))
    figures = interleave(tasks, plan.repeats)
    return [Table("novelty: the archive", _rows(behaviors, figures), _notes(n_behaviors, n_around))]


def _rows(behaviors: dict[str, FloatArray], figures: dict[str, list[float]]) -> list[Row]:
    rows = []
    for (name, array), target in zip(behaviors.items(), ["<= 20", ""], strict=True):
        label, peer = f"{name} ({array.shape[1]} dimensions)", f"{name}, linear scan"
        speedup = ratios(figures[peer], figures[name])
        rows += [
            Row(label, figures[name], UNIT, target),
            Row(peer, figures[peer], UNIT),
            Row(f"{name}, scan over archive", speedup, "x"),
        ]
    return rows


def _notes(n_behaviors: int, n_around: int) -> list[str]:
    low, high = n_behaviors - n_around, n_behaviors + n_around
    return [
        f"A generation: the {N_NEIGHBORS} nearest of each of {POPULATION_SIZE} behaviors, which "
        f"are then added; the mean while the archive grows from {low:,} to {high:,}, rebuilds "
        "counted. One thread.",
        f"States in reach of the maze {MAZE!r}, no two equal: positions uniform, 60 % at rest. The "
        "linear scan is scipy's cdist and a partial sort.",
    ]


def archive_task(behaviors: FloatArray, n_added: int) -> Task:
    """Milliseconds a generation while the last `n_added` behaviors enter."""
    size = POPULATION_SIZE
    begins = range(len(behaviors) - n_added, len(behaviors) - size + 1, size)

    def task() -> float:
        archive = NoveltyArchive(behaviors.shape[1])
        archive.add(behaviors[: begins[0]])

        def generations() -> None:
            for begin in begins:
                population = behaviors[begin : begin + size]
                archive.nearest(population, N_NEIGHBORS)
                archive.add(population)

        return 1e3 * seconds(generations) / len(begins)

    return task


def scan_task(behaviors: FloatArray, n_generations: int) -> Task:
    """Milliseconds a generation without an index."""
    population = behaviors[-POPULATION_SIZE:]

    def generations() -> None:
        for _ in range(n_generations):
            squares = cdist(population, behaviors, "sqeuclidean")
            nearest = np.argpartition(squares, N_NEIGHBORS, axis=1)[:, :N_NEIGHBORS]
            np.sort(np.take_along_axis(squares, nearest, axis=1))

    return lambda: 1e3 * seconds(generations) / n_generations


def maze_states(n: int) -> FloatArray:
    """States (n, 4) x, y, vx, vy: anywhere in the cells in reach, most of them at rest."""
    rng = np.random.default_rng(0)
    grid = MazeEnv(MAZE).coverage_grid
    cells = rng.choice(np.argwhere(grid.reachable), n)
    cell_size = (grid.high - grid.low) / grid.n_cells
    positions = grid.low + cell_size * (cells + rng.random((n, 2)))
    velocities = rng.normal(0.0, 0.3, (n, 2)) * (rng.random((n, 1)) < 0.4)
    return np.hstack([positions, velocities])


def observations(states: FloatArray) -> FloatArray:
    """What the robot observes in each state, shape (n, 36)."""
    env = MazeEnv(MAZE)
    observed = np.empty((len(states), *env.observation_space.shape), dtype=np.float32)
    for state, observation in zip(states, observed, strict=True):
        observe(env.maze, state, observation)
    return observed.astype(np.float64)
