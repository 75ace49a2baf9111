"""Emitters beside pyribs' own: who becomes a parent decides what a search is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from ribs.archives import ArchiveBase
from ribs.emitters import EmitterBase, GaussianEmitter

from curiosity_algos.search.pareto import pareto_best

Batch = dict[str, npt.NDArray[Any]]
Float32Array = npt.NDArray[np.float32]


class TournamentEmitter(GaussianEmitter):
    """Mutates the elites that win tournaments.

    Args:
        archive: Where the elites are drawn from.
        score: Of elites, a dictionary of arrays (n, ...), to scores (n,): the highest wins.
        tournament_size: Elites drawn uniformly for each parent; 1 is MAP-Elites' own rule.
        sigma: Standard deviation of the mutations.
        x0: (n_parameters,) parent while there are no elites.
        batch_size: Mutants in all.
        seed: Of the mutations.
    """

    def __init__(
        self,
        archive: ArchiveBase,
        *,
        score: Callable[[Batch], npt.NDArray[np.floating[Any]]],
        tournament_size: int,
        sigma: float,
        x0: Float32Array,
        batch_size: int,
        seed: int,
    ) -> None:
        super().__init__(archive, sigma=sigma, x0=x0, batch_size=batch_size, seed=seed)
        self._score = score
        self._tournament_size = tournament_size

    def ask(self) -> Float32Array:
        """Mutants (batch_size, n_parameters) of the winners; of `x0` while there are no elites."""
        if self.archive.empty:
            first: Float32Array = super().ask()
            return first
        candidates = self.archive.sample_elites(self._tournament_size * self.batch_size)
        scores = self._score(candidates).reshape(self.batch_size, self._tournament_size)
        winners = np.arange(self.batch_size) * self._tournament_size + scores.argmax(axis=1)
        return _mutate(self._rng, candidates["solution"][winners], self.sigma)


class ParetoEmitter(EmitterBase):
    """Mutates the best of its last generation in novelty and local competition (NSLC).

    The archive's `add` must give `novelty` and `local_competition`.

    Args:
        archive: What the generations are added to.
        x0: (n_parameters,) parent of the first generation.
        sigma: Standard deviation of the mutations.
        n_parents: mu, the individuals that have offspring.
        batch_size: lambda, their offspring in all.
        seed: Of the mutations.
    """

    def __init__(
        self,
        archive: ArchiveBase,
        *,
        x0: Float32Array,
        sigma: float,
        n_parents: int,
        batch_size: int,
        seed: int,
    ) -> None:
        super().__init__(
            archive,
            solution_dim=archive.solution_dim,
            bounds=None,
            lower_bounds=None,
            upper_bounds=None,
        )
        self.x0 = x0
        self._sigma = sigma
        self._n_parents = n_parents
        self._batch_size = batch_size
        self._rng = np.random.default_rng(seed)
        self._parents = x0[None].astype(archive.dtypes["solution"])

    def ask(self) -> Float32Array:
        """Offspring (batch_size, n_parameters), the parents by turns."""
        turns = np.arange(self._batch_size) % len(self._parents)
        return _mutate(self._rng, self._parents[turns], self._sigma)

    def tell(
        self,
        solution: npt.ArrayLike,
        objective: npt.ArrayLike,
        measures: npt.ArrayLike,
        add_info: Batch,
        **fields: npt.ArrayLike,
    ) -> None:
        """Let the best of the batch become the parents."""
        scores = np.stack([add_info["novelty"], add_info["local_competition"]], axis=1)
        self._parents = np.asarray(solution)[pareto_best(scores, self._n_parents)]


def _mutate(rng: np.random.Generator, parents: Float32Array, sigma: Any) -> Float32Array:
    return parents + rng.normal(scale=sigma, size=parents.shape).astype(parents.dtype)
