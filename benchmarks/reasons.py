"""A reason why NSLC differs from the paper's, tried: neighbors that are not the nearest.

`python -m benchmarks.reasons RUNS` trains NSLC with the selection of the authors' public code
(https://github.com/SuReLI/Curiosity-ES, nslc/nslc.py) into RUNS/selection=public, where
`python -m benchmarks.paper collect RUNS` finds it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch as th
import typer
from ribs.archives import ArchiveBase
from ribs.emitters import EmitterBase
from scipy.spatial.distance import cdist

from benchmarks.plan import BUDGETS, MAZES
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.training import train
from curiosity_algos.search.emitters import Batch, ParetoEmitter
from curiosity_algos.search.pareto import pareto_fronts

N_SURVIVORS, N_PARENTS, N_NEIGHBORS = 56, 7, 30


class PublicSelection(ParetoEmitter):
    """Selects among a generation and the survivors of all before it, by the first 30 of these.

    The public code sorts all by their distance, and then takes the first 30 of what it has not
    sorted: novelty is the sum of the distances to them, local competition how many are not better.
    Nothing else is remembered. Survivors are the best fronts in their order; the first 7 of them
    have offspring.
    """

    _survivors: npt.NDArray[np.float32] | None = None

    def tell(
        self,
        solution: npt.ArrayLike,
        objective: npt.ArrayLike,
        measures: npt.ArrayLike,
        add_info: Batch,
        **fields: npt.ArrayLike,
    ) -> None:
        """Let the first of the survivors become the parents."""
        solutions, returns, behaviors = map(np.asarray, (solution, objective, measures))
        if self._survivors is not None:
            solutions = np.concatenate([solutions, self._survivors])
            returns = np.concatenate([returns, self._returns])
            behaviors = np.concatenate([behaviors, self._behaviors])
        novelty = cdist(behaviors, behaviors[:N_NEIGHBORS]).sum(axis=1)
        wins = (returns[:, None] >= returns[:N_NEIGHBORS]).sum(axis=1)
        fronts = np.concatenate(pareto_fronts(np.column_stack([wins, novelty])))
        best = fronts[:N_SURVIVORS]
        self._survivors, self._returns, self._behaviors = (
            solutions[best],
            returns[best],
            behaviors[best],
        )
        self._parents = self._survivors[:N_PARENTS]


def make_emitters(
    archive: ArchiveBase, x0: npt.NDArray[np.float32], seed: int
) -> list[EmitterBase]:
    """The one emitter, with the mutations of the paper's mazes."""
    return [
        PublicSelection(
            archive,
            x0=x0,
            sigma=0.5,
            n_parents=N_PARENTS,
            batch_size=N_SURVIVORS,
            seed=seed,
        )
    ]


def main(
    runs: Path,
    env: str = MAZES[0],
    seed: int = 0,
    timesteps: float = BUDGETS["paper"].timesteps("NSLC", MAZES[0]),
) -> None:
    """Train on a maze, on one thread; a run that was interrupted goes on."""
    th.set_num_threads(1)
    settings = {"preset": "paper", "emitters": make_emitters, "n_threads": 1}
    run = RunSpec("NSLC", env, seed, timesteps, settings=settings, variant="selection=public")
    train(run, run.folder(runs))


if __name__ == "__main__":
    typer.run(main)
