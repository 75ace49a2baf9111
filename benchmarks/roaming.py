"""How far an ant gets around, as RAMP counts it: `python -m benchmarks.roaming` trains and counts.

The measure is that of Table 1 of Le Tolguenec et al., "Exploration by Running Away from the Past"
(2024, arXiv:2411.14085): of the torso's x, y and z, 100 bins each, the cells in which any step of
the training began. Bounds, the start without noise and the position in the observation are those of
the code that its authors published; what lies out of bounds counts at the edge.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import pandas as pd
import torch as th
import typer

from benchmarks.learning import SWEEPS
from benchmarks.measure import markdown
from benchmarks.pool import run_all
from benchmarks.results import FOLDER, add_rows
from curiosity_algos import make_evaluator
from curiosity_algos.common.names import find_algorithm
from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_gym.core import CoverageGrid

ANT = "CuriosityLocomotion-Ant-v0"
ENV_KWARGS = {"reset_noise_scale": 0.0, "exclude_current_positions_from_observation": False}
GRID = CoverageGrid(
    (0, 1, 2),
    low=np.array([-50.0, -50.0, 0.0]),
    high=np.array([50.0, 50.0, 2.0]),
    n_cells=100,
)
N_ENVS = 64
"""Of the random actions."""
EVERY = 1_000_000
"""Steps between two rows of a run."""
KEYS = ["algorithm", "seed", "timesteps"]


class Counter:
    """The cells of the first steps of a training.

    Args:
        timesteps: So many steps; what comes later is not counted.
        every: Steps between two rows.

    Attributes:
        timesteps: The steps that are counted when it is full.
        visited: (100, 100, 100) bool, along x, y and z.
        rows: After each `every` steps, and at the end, the steps and the cells: of x, y and z, of
            x and y.
    """

    def __init__(self, timesteps: int, every: int = EVERY) -> None:
        self.timesteps = timesteps
        self.visited = np.zeros(GRID.shape, dtype=np.bool_)
        self.rows: list[dict[str, int]] = []
        self._ends = iter([*range(every, timesteps, every), timesteps])
        self._n_counted, self._end = 0, next(self._ends)

    @property
    def is_full(self) -> bool:
        """Whether no more steps are counted."""
        return self._n_counted == self.timesteps

    def add(self, positions: npt.NDArray[Any]) -> None:
        """Count steps by their positions (n, 3), in their order."""
        while len(positions) and not self.is_full:
            counted, positions = np.split(positions, [self._end - self._n_counted])
            self.visited.flat[GRID.cells(counted.astype(np.float64))] = True
            self._n_counted += len(counted)
            if self._n_counted == self._end:
                self._write_row()

    def _write_row(self) -> None:
        xyz, xy = int(self.visited.sum()), int(self.visited.any(axis=2).sum())
        self.rows.append({"timesteps": self._n_counted, "xyz": xyz, "xy": xy})
        self._end = next(self._ends, self._end)


class CountingEvaluator(Evaluator):
    """An evaluator, and a count of the steps of all that it plays, policy by policy."""

    def __init__(self, evaluator: Evaluator, counter: Counter) -> None:
        self.n_parameters = evaluator.n_parameters
        self._evaluator, self._counter = evaluator, counter

    def evaluate(self, parameters: npt.NDArray[np.float32], seed: int | None = None) -> Rollouts:
        """Play one episode of each policy."""
        rollouts = self._evaluator.evaluate(parameters, seed)
        positions = rollouts.trajectories[0][:, :-1, :3]
        is_played = np.arange(positions.shape[1]) < rollouts.lengths[:, None]
        self._counter.add(positions[is_played])
        return rollouts


def search(name: str, counter: Counter, seed: int, **settings: Any) -> None:
    """Train an algorithm with its defaults, but for the settings."""
    env = gym.make(ANT, env_kwargs=ENV_KWARGS)
    evaluator = CountingEvaluator(make_evaluator(env, n_threads=1), counter)
    make = partial(find_algorithm(name), env, seed=seed, evaluator=evaluator, n_threads=1)
    make(**settings).learn(counter.timesteps)


def act_at_random(counter: Counter, seed: int) -> None:
    """Take uniform actions."""
    mode: Any = "vector_entry_point"
    envs = gym.make_vec(ANT, N_ENVS, mode, env_kwargs=ENV_KWARGS, n_threads=1)
    envs.action_space.seed(seed)
    observations, _ = envs.reset(seed=seed)
    ended = np.zeros(N_ENVS, dtype=np.bool_)
    while not counter.is_full:
        counter.add(observations[~ended, :3])  # after an end there is no step but a reset
        observations, _, terminated, truncated, _ = envs.step(envs.action_space.sample())
        ended = terminated | truncated


WAYS: dict[str, Callable[[Counter, int], None]] = {
    **{name: partial(search, name) for name in SWEEPS["locomotion"]["algos"]},
    "NSLC learned": partial(search, "NSLC", behavior="learned"),
    "Uniform actions": act_at_random,
}
"""What moves the ant in each row."""


def train(name: str, seed: int, timesteps: int, runs: Path) -> None:
    """Train with one seed, unless it was done as long, and write the cells at every million."""
    path = runs / "roaming" / name / f"{seed}.csv"
    if path.exists() and (pd.read_csv(path)["timesteps"] == timesteps).any():
        return
    th.set_num_threads(1)
    counter = Counter(timesteps)
    WAYS[name](counter, seed)
    add_rows(pd.DataFrame(counter.rows).assign(algorithm=name, seed=seed), path, KEYS)


def main(
    names: Annotated[str, typer.Option(help="Rows, with commas.")] = ",".join(WAYS),
    seeds: str = "0,1,2,3,4",
    timesteps: float = 1e6,
    runs: Path = Path("runs"),
    jobs: int = 2,
    out: Annotated[Path, typer.Option(help="Where the CSV file goes.")] = FOLDER,
) -> None:
    """Train every row with every seed, and add all runs to a CSV file."""
    if unknown := sorted(set(names.split(",")) - set(WAYS)):
        raise typer.BadParameter(f"--names knows {', '.join(WAYS)}, not {', '.join(unknown)}.")
    tasks = product(names.split(","), map(int, seeds.split(",")), [int(timesteps)], [runs])
    run_all(train, tasks, jobs)
    table = pd.concat(map(pd.read_csv, (runs / "roaming").glob("*/*.csv")))
    add_rows(table, out / "roaming.csv", KEYS)


def table(values: pd.DataFrame, timesteps: int) -> str:
    """A row for each way to move: means over seeds and standard errors after so many steps.

    Shares are of the run that came to most cells, as RAMP's paper has them.
    """
    values = values[values["timesteps"] == timesteps]
    values = values.assign(share=100 * values["xyz"] / values["xyz"].max())
    groups = values.groupby("algorithm")[["xyz", "share", "xy"]].agg(["mean", "sem"])
    digits = {"xyz": 0, "share": 1, "xy": 0}
    rows = [
        [name, *(_with_error(*row[key], digits[key]) for key in digits)]
        for name, row in groups.sort_values(("xyz", "mean"), ascending=False).iterrows()
    ]
    return markdown(["", "Cells of x, y, z", "Share of the best run (%)", "Cells of x, y"], rows)


def _with_error(mean: float, error: float, digits: int) -> str:
    """A mean and its standard error; of one run alone there is none."""
    return f"{mean:,.{digits}f}" + ("" if np.isnan(error) else f" ± {error:,.{digits}f}")


def published(values: pd.DataFrame) -> str:
    """The shares that RAMP's paper published, with their standard errors, the highest first."""
    ordered = values.sort_values("mean", ascending=False).itertuples()
    rows = [[each.algorithm, f"{each.mean:g} ± {each.error:g}"] for each in ordered]
    return markdown(["Published", "Share of the best run (%)"], rows)


if __name__ == "__main__":
    typer.run(main)
