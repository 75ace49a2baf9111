"""The curiosity of an archive's elites now, from a few transitions kept of each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from curiosity_algos.bonuses.base import Bonus, check_needs_no_episodes
from curiosity_algos.bonuses.transitions import draw_transitions, flat
from curiosity_algos.common.arrays import Array, Float64Array
from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer

KEPT = "kept"
"""Name of what is read of trajectories."""

Batch = dict[str, Array]


class EliteCuriosity:
    """Estimates the curiosity of whole trajectories that only samples are kept of.

    A score kept from the time of the episode would stay high where all has long been learned; these
    are asked of the bonus as it is now. `n_transitions` of each trajectory are kept, drawn
    uniformly with replacement.
    """

    def __init__(self, bonus: Bonus, n_transitions: int, seed: np.random.SeedSequence) -> None:
        check_needs_no_episodes(bonus, "an archive of elites")
        self.bonus = bonus
        self.n_transitions = n_transitions
        self._rng = np.random.default_rng(seed)

    def summarizers(self, n_individuals: int) -> dict[str, Summarizer]:
        """A summarizer for `fields`, of trajectories of so many individuals; drawn now."""
        return {KEPT: draw_transitions(self._rng, n_individuals, self.n_transitions)}

    def fields(self, rollouts: Rollouts) -> Batch:
        """Transitions of each individual: observations (P, n, O), actions, ..., length (P,)."""
        drawn = rollouts.summary(KEPT, self.summarizers)
        names = ("observations", "actions", "next_observations")
        return {**dict(zip(names, drawn, strict=True)), "length": rollouts.lengths}

    def score(self, elites: Batch) -> Float64Array:
        """Estimated sum of the curiosity of each elite's transitions, (n,)."""
        with single_torch_thread():
            curiosity = self.bonus.score(
                flat(elites["observations"]),
                flat(elites["actions"]),
                flat(elites["next_observations"]),
            )
        means = curiosity.reshape(-1, self.n_transitions).mean(axis=1, dtype=np.float64)
        scores: Float64Array = elites["length"] * means
        return scores

    def state_dict(self) -> dict[str, Any]:
        """The state of the draws; the bonus' own is its motivation's."""
        return {"rng": generator_state(self._rng)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        load_generator_state(self._rng, state["rng"])
