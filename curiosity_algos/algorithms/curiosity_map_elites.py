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
from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer
from curiosity_algos.loops.curious_algorithm import CuriousAlgorithm
from curiosity_algos.loops.declared import setting
from curiosity_algos.loops.quality_diversity import Fields, FieldTypes
from curiosity_algos.motivations.elites import EliteCuriosity
from curiosity_algos.search.emitters import TournamentEmitter
from curiosity_gym.validation import check_at_least_one, check_positive


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

    bonus: str | Bonus = setting("icm", settled=True)
    n_updates: int = setting(64, check_at_least_one, part="_motivation")
    batch_size: int = setting(1024, check_at_least_one, part="_motivation")
    sigma: float = setting(0.1, check_positive, idle_with="emitters")
    tournament_size: int = setting(32, check_at_least_one, idle_with="emitters")
    n_kept: int = setting(32, check_at_least_one, fixed=True)

    def _make_search(self, seed: np.random.SeedSequence) -> None:
        curiosity_seed, draws_seed, search_seed = seed.spawn(3)
        self._motivation = self._make_curiosity(curiosity_seed)
        self._curiosity = EliteCuriosity(self._motivation.bonus, self.n_kept, draws_seed)
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
            score=self._curiosity.score,
            tournament_size=self.tournament_size,
            sigma=self.sigma,
            x0=x0,
            batch_size=self.population_size,
            seed=seed,
        )

    def _parts(self) -> dict[str, Any]:
        own = {"motivation": self._motivation, "curiosity": self._curiosity}
        return {**super()._parts(), **own}

    def _steer(self, emitter: Any) -> None:
        super()._steer(emitter)
        emitter.tournament_size = self.tournament_size

    def _summarizers(self, n_individuals: int) -> Mapping[str, Summarizer] | None:
        learned = self._motivation.learning(n_individuals)
        return {**learned, **self._curiosity.summarizers(n_individuals)}

    def _fields(self, rollouts: Rollouts) -> Fields:
        return {**super()._fields(rollouts), **self._curiosity.fields(rollouts)}

    def _tell(self, rollouts: Rollouts) -> Mapping[str, float]:
        metrics = super()._tell(rollouts)
        return {**metrics, **self._motivation.update(rollouts)}
