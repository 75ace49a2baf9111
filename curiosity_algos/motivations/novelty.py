"""Novelty of behaviors: what NS-ES adds to the canonical evolution strategy.

Lehman & Stanley 2011, "Abandoning Objectives"; Conti et al. 2018
(https://arxiv.org/abs/1712.06560); the paper's section 2.1.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces

from curiosity_algos.common.arrays import Float64Array
from curiosity_algos.common.neighbors import nearest_others
from curiosity_algos.evaluation.flat_spaces import FlatObservations
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer, check_observations
from curiosity_algos.motivations.novelty_archive import NoveltyArchive
from curiosity_gym.validation import check_choice

BEHAVIORS = ("final", "state")


def behaviors_of(rollouts: Rollouts, behavior: str) -> Float64Array:
    """Behaviors compared, (P, B): "final": `info["behavior"]`; "state": the final observation."""
    if behavior == "final":
        return rollouts.behaviors
    check_observations(rollouts.final_observations)
    return rollouts.final_observations.astype(np.float64)


def behavior_size(
    behavior: str, observation_space: spaces.Space[Any], behavior_space: spaces.Box[Any] | None
) -> int:
    """B, the length of what `behaviors_of` gives.

    Raises:
        ValueError: If `behavior` is neither "final" nor "state", or there is no such behavior.
    """
    check_choice(BEHAVIORS, behavior=behavior)
    if behavior == "state":
        return FlatObservations(observation_space).size
    if behavior_space is None:
        raise ValueError(
            '`behavior="final"` needs an env with a `behavior_space`: wrap it in '
            'curiosity_gym.BehaviorWrapper, or choose `behavior="state"`.'
        )
    return behavior_space.shape[0]


class NoveltyMotivation:
    """Scores an individual by its mean distance to the nearest behaviors seen before.

    Every individual enters the archive after it was scored, so that none meets itself. The first
    generation, which has no past, is compared with itself.

    Args:
        n_dimensions: B, length of a behavior.
        k: Neighbors that count, at least 1; fewer while the archive is smaller.
        behavior: "final" or "state", see `behaviors_of`.
    """

    def __init__(self, n_dimensions: int, *, k: int, behavior: str) -> None:
        self.k = k
        self.behavior = behavior
        self.archive = NoveltyArchive(n_dimensions)

    def summarizers(self, n_individuals: int) -> dict[str, Summarizer]:
        """Nothing: behaviors are no part of trajectories."""
        return {}

    def score(self, rollouts: Rollouts) -> Float64Array:
        """Novelty of each individual, shape (P,)."""
        behaviors = behaviors_of(rollouts, self.behavior)
        if len(self.archive):
            distances = self.archive.nearest(behaviors, self.k)
        elif len(behaviors) > 1:
            n = len(behaviors)
            distances, _ = nearest_others(behaviors, n, min(self.k, n - 1))
        else:
            distances = np.zeros((1, 1))
        novelty: Float64Array = distances.mean(axis=1)
        return novelty

    def update(self, rollouts: Rollouts) -> dict[str, float]:
        """Remember the generation; the archive's size."""
        self.archive.add(behaviors_of(rollouts, self.behavior))
        return {"archive/size": len(self.archive)}

    def state_dict(self) -> dict[str, Any]:
        """The archive."""
        return {"archive": self.archive.state_dict()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        self.archive.load_state_dict(state["archive"])
