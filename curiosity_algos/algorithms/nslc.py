"""NSLC: novelty search with local competition.

Lehman & Stanley 2011, "Evolving a Diversity of Virtual Creatures through Novelty Search and Local
Competition" (https://doi.org/10.1145/2001576.2001606); the paper's section 4.3.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from ribs.emitters import EmitterBase

from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.common.arrays import Float32Array, Float64Array
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer
from curiosity_algos.loops.declared import setting
from curiosity_algos.loops.quality_diversity import Fields, FieldTypes, QualityDiversity
from curiosity_algos.motivations.learned_behavior import LearnedBehavior
from curiosity_algos.motivations.novelty import BEHAVIORS, behavior_size, behaviors_of
from curiosity_algos.search.emitters import ParetoEmitter
from curiosity_gym.validation import LARGEST_COUNT, check_at_least_one, check_choice, check_whole

LEARNED = "learned"
FINAL = "final_observation"
"""The field of an elite that its learned behavior is measured from."""


class NSLC(QualityDiversity):
    """The mu best of each generation in novelty and local competition have lambda offspring.

    Novelty is the mean distance to the k nearest behaviors of archive and generation, local
    competition how many of these have a lower return. NSGA-II's ranking (fronts, then crowding)
    weighs the two.

    Further keywords are those of `QualityDiversity`.

    Args:
        n_parents: mu, at most `population_size`, lambda; None: 7, or half of lambda where that is
            less. `emitters` have their own parents.
        k: Neighbors that count; those of an `archive` are its `k_neighbors` instead.
        behavior: "final": the environment's behavior; "state": the whole final observation (the
            paper's BD_s); "learned": features of the final observation, as of `APT`. After each
            generation the elites are measured anew; an `archive` must be empty at the beginning.
        archive_size: Elites held, within 10 %; an `archive` holds its `target_size` instead.
    """

    archive: UnstructuredArchive
    archive_class = UnstructuredArchive
    n_parents: int | None = setting(None, idle_with="emitters")
    k: int = setting(10, check_at_least_one, idle_with="archive")
    behavior: str = setting("final", fixed=True)
    archive_size: int = setting(2000, check_at_least_one, idle_with="archive")

    def _check_settings(self) -> None:
        super()._check_settings()
        # Emitters of one's own choose parents themselves, and say how large a population is.
        n_most = self.population_size if self.emitters is None else LARGEST_COUNT
        check_whole(1, n_most, n_parents=self._n_parents)
        if self.emitters is None and getattr(self._own_archive, "k_neighbors", self.k) is None:
            raise ValueError("`archive` must be made with `k_neighbors`, as it is to tell novelty.")

    @property
    def _n_parents(self) -> int:
        """The number of them, mu."""
        default = max(1, min(7, self.population_size // 2))
        return default if self.n_parents is None else self.n_parents

    @property
    def _is_learned(self) -> bool:
        return self.behavior == LEARNED

    def _measure_dim(self, space: spaces.Box[Any] | None) -> int:
        if self._is_learned:
            return LearnedBehavior.n_features
        check_choice((*BEHAVIORS, LEARNED), behavior=self.behavior)
        return behavior_size(self.behavior, self.observation_space, space)

    def _check_behaviors(self, space: spaces.Box[Any] | None) -> None:
        self._measure_dim(space)  # raises where there is no such behavior
        super()._check_behaviors(space)

    def _make_search(self, seed: np.random.SeedSequence) -> None:
        if self._is_learned:
            self._check_begins_empty()
            seed, encoder_seed = seed.spawn(2)
            self._encoder = LearnedBehavior(
                self.policy.seen.space,
                self.policy.acted.space,
                seed=encoder_seed,
                device=self.device,
                n_threads=self.n_threads,
            )
        super()._make_search(seed)

    def _make_archive(self, seed: np.random.SeedSequence) -> UnstructuredArchive:
        return UnstructuredArchive(
            measure_dim=self._measure_dim(self._behavior_space),
            target_size=self.archive_size,
            k_neighbors=self.k,
            **self._archive_kwargs(seed),
        )

    def _field_types(self) -> FieldTypes:
        types = {**super()._field_types(), "behavior": ((self._n_behaviors,), np.float64)}
        if self._is_learned:
            types[FINAL] = (self.policy.seen.space.shape, np.float32)
        return types

    def _fields(self, rollouts: Rollouts) -> Fields:
        own = {FINAL: rollouts.final_observations} if self._is_learned else {}
        return {**super()._fields(rollouts), **own}

    def _summarizers(self, n_individuals: int) -> Mapping[str, Summarizer] | None:
        return self._encoder.summarizers(n_individuals) if self._is_learned else {}

    def _make_emitter(self, x0: Float32Array, seed: int) -> EmitterBase:
        return ParetoEmitter(
            self.archive,
            x0=x0,
            sigma=self.sigma,
            n_parents=self._n_parents,
            batch_size=self.population_size,
            seed=seed,
        )

    def _put_in_force(self) -> None:
        super()._put_in_force()
        if self._own_archive is None:
            self.archive.target_size, self.archive.k_neighbors = self.archive_size, self.k

    def _steer(self, emitter: Any) -> None:
        emitter.sigma, emitter.n_parents = self.sigma, self._n_parents
        emitter.batch_size = self.population_size

    def _parts(self) -> dict[str, Any]:
        return {**super()._parts(), **({"encoder": self._encoder} if self._is_learned else {})}

    def _measures(self, rollouts: Rollouts) -> Float64Array:
        if self._is_learned:
            return self._encoder.of(rollouts.final_observations)
        return behaviors_of(rollouts, self.behavior)

    def _tell(self, rollouts: Rollouts) -> Mapping[str, float]:
        losses = self._encoder.learn(rollouts, self.archive, FINAL) if self._is_learned else {}
        return {**super()._tell(rollouts), **losses}
