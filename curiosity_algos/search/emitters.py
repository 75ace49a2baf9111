"""Emitters beside pyribs' own, which differ in who becomes a parent; and several held as one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from ribs.archives import ArchiveBase
from ribs.emitters import EmitterBase, GaussianEmitter
from ribs.schedulers import Scheduler

from curiosity_algos.common.arrays import Array, Float32Array
from curiosity_algos.search.pareto import pareto_best
from curiosity_algos.state.check import check_keys, check_like
from curiosity_algos.state.foreign_state import foreign_state, load_foreign_state

Batch = dict[str, Array]

TOGETHER = 64
"""Tournaments held at once: candidates are copies of elites, trajectories and all."""


class Emitters:
    """A list of pyribs' emitters on an archive, which begin at x0 (n_parameters,), with a state.

    Raises:
        ValueError: If one of them works on another archive, or needs gradients.
    """

    def __init__(self, emitters: list[Any], archive: ArchiveBase, x0: Float32Array) -> None:
        Scheduler(archive, emitters)  # raises unless they are a list, and different ones
        for emitter in emitters:
            can_emit = getattr(emitter, "batch_size", 0) and not hasattr(emitter, "batch_size_dqd")
            if not can_emit or emitter.archive is not archive:
                raise ValueError(
                    "`emitters` must return emitters made with the `archive` that it is called "
                    f"with, that have a `batch_size` and need no gradients, got {emitter!r}."
                )
        self.emitters = emitters
        self.x0 = x0

    @property
    def batch_size(self) -> int:
        """Solutions that they emit in all."""
        return sum(emitter.batch_size for emitter in self.emitters)

    def state_dict(self) -> dict[str, Any]:
        """The emitters' attributes, and where they began; TypeError where no file holds them."""
        states = {str(i): foreign_state(emitter) for i, emitter in enumerate(self.emitters)}
        return {"x0": self.x0.copy(), **states}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError unless of emitters of the same classes."""
        own = self.state_dict()
        check_keys(state, own, "emitters")
        check_like(state["x0"], own["x0"], "x0")
        self.x0 = state["x0"].copy()
        for i, emitter in enumerate(self.emitters):
            load_foreign_state(emitter, state[str(i)])


def set_mutations(emitter: GaussianEmitter, *, sigma: float, batch_size: int) -> None:
    """Let an emitter of pyribs' mutate otherwise from here on; its settings have no setter."""
    own: Any = emitter
    own._sigma = np.asarray(sigma, dtype=emitter.archive.dtypes["solution"])
    own._batch_size = batch_size
    own._noise_shape = (batch_size, emitter.solution_dim)


class TournamentEmitter(GaussianEmitter):
    """Mutates the elites that win tournaments.

    Args:
        archive: Where the elites are drawn from.
        score: Of elites, a dictionary of arrays (n, ...), to scores (n,): the highest wins.
        tournament_size: Elites drawn uniformly for each parent; 1 is MAP-Elites' own rule.
        **kwargs: As of pyribs' emitter.
    """

    def __init__(
        self,
        archive: ArchiveBase,
        *,
        score: Callable[[Batch], npt.NDArray[np.floating[Any]]],
        tournament_size: int,
        **kwargs: Any,
    ) -> None:
        super().__init__(archive, **kwargs)
        self._score = score
        self.tournament_size = tournament_size

    def ask(self) -> Float32Array:
        """Mutants (batch_size, n_parameters) of the winners; of `x0` while there are no elites."""
        if self.archive.empty:
            return super().ask()
        begins = range(0, self.batch_size, TOGETHER)
        parents = [self._winners(min(TOGETHER, self.batch_size - begin)) for begin in begins]
        return _mutate(self._rng, np.concatenate(parents), self.sigma)

    def _winners(self, n: int) -> Float32Array:
        """Those of n tournaments, (n, n_parameters)."""
        candidates = self.archive.sample_elites(self.tournament_size * n)
        scores = self._score(candidates).reshape(n, self.tournament_size)
        winners = np.arange(n) * self.tournament_size + scores.argmax(axis=1)
        return candidates["solution"][winners]  # type: ignore[no-any-return]


class ParetoEmitter(EmitterBase):
    """Mutates the best of its last generation in novelty and local competition (NSLC).

    The archive's `add` must give `novelty` and `local_competition`. `x0` (n_parameters,) is the
    parent of the first generation; later `n_parents` have `batch_size` offspring.
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
        bounds = dict.fromkeys(("bounds", "lower_bounds", "upper_bounds"))
        super().__init__(archive, solution_dim=archive.solution_dim, **bounds)
        self.x0 = x0
        self.sigma = sigma
        self.n_parents = n_parents
        self.batch_size = batch_size
        self._rng = np.random.default_rng(seed)
        self._parents = x0[None].astype(archive.dtypes["solution"])

    def ask(self) -> Float32Array:
        """Offspring (batch_size, n_parameters), the parents by turns."""
        turns = np.arange(self.batch_size) % len(self._parents)
        return _mutate(self._rng, self._parents[turns], self.sigma)

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
        self._parents = np.asarray(solution)[pareto_best(scores, self.n_parents)]


def _mutate(rng: np.random.Generator, parents: Float32Array, sigma: Any) -> Float32Array:
    return parents + rng.normal(scale=sigma, size=parents.shape).astype(parents.dtype)
