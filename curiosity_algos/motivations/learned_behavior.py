"""Behaviors that are learned: features in which states are as far apart as they are in time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.common.arrays import Array, Float64Array
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer, check_observations
from curiosity_algos.motivations.curiosity import CuriosityMotivation


class LearnedBehavior:
    """The features of APT's encoder, which is trained on what was seen.

    Args:
        observation_space: Box of vectors.
        action_space: One-dimensional Box, or Discrete.
        seed: Of the networks and the draws.
        device: Where the networks are, as in SB3.
        n_threads: None: as many as there are processors. Results do not depend on it.
    """

    n_features = 8

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        seed: np.random.SeedSequence,
        device: th.device | str,
        n_threads: int | None,
    ) -> None:
        self._encoder = CuriosityMotivation(
            observation_space,
            action_space,
            bonus="apt",
            # No distance is asked for, and so nothing remembered.
            bonus_kwargs={"n_features": self.n_features, "memory_size": 1},
            seed=seed,
            device=device,
            n_threads=n_threads,
        )

    def summarizers(self, n_individuals: int) -> Mapping[str, Summarizer]:
        """What `learn` reads of trajectories."""
        return self._encoder.learning(n_individuals)

    def learn(self, rollouts: Rollouts, archive: Any, field: str) -> Mapping[str, float]:
        """Train, and measure the elites by the observations in a field of theirs anew."""
        losses = self._encoder.update(rollouts)
        if len(archive):
            archive.set_measures(self.of(archive.data(field)))
        return losses

    def of(self, observations: Array) -> Float64Array:
        """Behaviors (n, n_features) of observations (n, O); ValueError unless they are finite."""
        check_observations(observations)
        bonus: Any = self._encoder.bonus
        features: Float64Array = bonus.features(observations.astype(np.float32))
        return features

    def state_dict(self) -> dict[str, Any]:
        """Everything that a resumed run needs."""
        return self._encoder.state_dict()

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        self._encoder.load_state_dict(state)
