"""A behavior that nobody defines: features of the final state that tell what follows what."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.apt import APT
from curiosity_algos.common.arrays import Array, Float64Array
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer, check_observations
from curiosity_algos.motivations.curiosity import CuriosityMotivation

N_FEATURES = 8


class LearnedBehavior:
    """Where an episode ended, in the features of `APT`: near is what one comes to in few steps.

    The encoder learns from the transitions of all individuals, as the bonus of CuriosityES does.
    What it gives for the same observation changes as it learns: who keeps behaviors measures them
    anew.

    Args:
        observation_space: One-dimensional Box.
        action_space: One-dimensional Box, or Discrete.
        seed: Of the initial weights and all draws.
        device: Where the networks are.
        n_threads: As in `CuriosityMotivation`.
    """

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        seed: np.random.SeedSequence,
        device: th.device | str,
        n_threads: int | None,
    ) -> None:
        self._curiosity = CuriosityMotivation(
            observation_space,
            action_space,
            bonus="apt",
            bonus_kwargs={"n_features": N_FEATURES, "memory_size": 1},  # no distance is asked for
            seed=seed,
            device=device,
            n_threads=n_threads,
        )

    def summarizers(self, n_individuals: int) -> dict[str, Summarizer]:
        """What `update` needs of trajectories."""
        return self._curiosity.learning(n_individuals)

    def update(self, rollouts: Rollouts) -> dict[str, float]:
        """Learn from the transitions of a generation; the mean loss."""
        return self._curiosity.update(rollouts)

    def measures(self, observations: Array) -> Float64Array:
        """Behaviors (n, 8) of final observations (n, O)."""
        check_observations(observations)
        bonus = self._curiosity.bonus
        assert isinstance(bonus, APT)
        return bonus.features(observations.astype(np.float32))

    def state_dict(self) -> dict[str, Any]:
        """The encoder, and what it is trained on."""
        return self._curiosity.state_dict()

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> None:
        """Take over what `state_dict` gave."""
        self._curiosity.load_state_dict(state)
