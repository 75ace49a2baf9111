"""Curiosity-MAP-Elites: MAP-Elites whose parents are the elites of the most curious trajectories.

The paper's discussion names the combination of curiosity and MAP-Elites as future work.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from ribs.emitters import EmitterBase

from curiosity_algos.algorithms.map_elites import MAPElites
from curiosity_algos.bonuses.base import Bonus, check_needs_no_episodes
from curiosity_algos.bonuses.transitions import draw_transitions, flat
from curiosity_algos.common.arrays import Float32Array, Float64Array
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer
from curiosity_algos.loops.curious_algorithm import CuriousAlgorithm
from curiosity_algos.loops.declared import setting
from curiosity_algos.loops.quality_diversity import Fields, FieldTypes
from curiosity_algos.search.emitters import TournamentEmitter
from curiosity_gym.validation import check_at_least_one, check_positive

KEPT = "kept"
"""Name of what is read of trajectories."""
TRANSITION = ("observations", "actions", "next_observations")
"""Names of its three parts in the archive."""


class CuriosityMAPElites(CuriousAlgorithm, MAPElites):
    """MAP-Elites' archive decides who is kept, curiosity who has offspring.

    Each parent is the winner of a tournament of elites drawn uniformly: the one whose trajectory
    the bonus, as it is now, finds most curious. The bonus learns from every generation, as in
    `CuriosityES`, so that what is known stops having offspring.

    An elite's curiosity is the sum over its trajectory (eq. 10, with a gamma of 1), estimated from
    `n_kept` transitions that are drawn at random: the highest of them, as `CuriosityES` takes,
    would depend on the draw.

    Further keywords are those of `CuriousAlgorithm` (the bonus) and `MAPElites`.

    Args:
        sigma: Standard deviation of mutations, above 0; `emitters` have their own.
        tournament_size: Elites drawn for each parent; with 1 all are as likely, as in MAP-Elites.
            `emitters` choose parents of their own.
        n_kept: Transitions kept of each elite, from which its curiosity is estimated.
    """

    bonus: str | Bonus = setting("icm", fixed=True)
    n_updates: int = setting(64, check_at_least_one, part="_motivation")
    batch_size: int = setting(1024, check_at_least_one, part="_motivation")
    sigma: float = setting(0.1, check_positive, idle_with="emitters")
    tournament_size: int = setting(32, check_at_least_one, idle_with="emitters")
    n_kept: int = setting(32, check_at_least_one, fixed=True)

    def _make_search(self, seed: np.random.SeedSequence) -> None:
        curiosity_seed, draws_seed, search_seed = seed.spawn(3)
        self._motivation = self._make_curiosity(curiosity_seed)
        check_needs_no_episodes(self._motivation.bonus, "an archive of elites")
        self._draws = np.random.default_rng(draws_seed)
        super()._make_search(search_seed)

    def _field_types(self) -> FieldTypes:
        states = ((self.n_kept, *self.policy.seen.space.shape), np.float32)
        actions = self.policy.acted.space
        dtype = np.int64 if isinstance(actions, spaces.Discrete) else np.float32
        return {
            **super()._field_types(),
            "observations": states,
            "actions": ((self.n_kept, *(actions.shape or ())), dtype),
            "next_observations": states,
            "length": ((), np.int64),
        }

    def _make_emitter(self, x0: Float32Array, seed: int) -> EmitterBase:
        return TournamentEmitter(
            self.archive,
            score=self._score,
            tournament_size=self.tournament_size,
            sigma=self.sigma,
            x0=x0,
            batch_size=self.population_size,
            seed=seed,
        )

    def _parts(self) -> dict[str, Any]:
        own = {"motivation": self._motivation, "curiosity": self._draws}
        return {**super()._parts(), **own}

    def _steer(self, emitter: Any) -> None:
        super()._steer(emitter)
        emitter.tournament_size = self.tournament_size

    def _summarizers(self, n_individuals: int) -> Mapping[str, Summarizer] | None:
        learned = self._motivation.learning(n_individuals)
        return {**learned, **self._kept(n_individuals)}

    def _kept(self, n_individuals: int) -> dict[str, Summarizer]:
        """Reads `n_kept` transitions of each trajectory, drawn uniformly with replacement."""
        return {KEPT: draw_transitions(self._draws, n_individuals, self.n_kept)}

    def _fields(self, rollouts: Rollouts) -> Fields:
        drawn = dict(zip(TRANSITION, rollouts.summary(KEPT, self._kept), strict=True))
        return {**super()._fields(rollouts), **drawn, "length": rollouts.lengths}

    def _score(self, elites: Fields) -> Float64Array:
        """Estimated sum of the curiosity of each elite's transitions, (n,), by the bonus as it is.

        A score kept from the time of the episode would stay high where all has long been learned.
        """
        with single_torch_thread():
            curiosity = self._motivation.bonus.score(*(flat(elites[name]) for name in TRANSITION))
        means = curiosity.reshape(-1, self.n_kept).mean(axis=1, dtype=np.float64)
        scores: Float64Array = elites["length"] * means
        return scores

    def _tell(self, rollouts: Rollouts) -> Mapping[str, float]:
        metrics = super()._tell(rollouts)
        return {**metrics, **self._motivation.update(rollouts)}
