"""Curiosity-ES: the canonical evolution strategy, motivated by curiosity of whole trajectories.

Le Tolguenec et al. 2022, "Curiosity creates Diversity in Policy Search", algorithm 1.
"""

from __future__ import annotations

import numpy as np

from curiosity_algos.loops.curious_algorithm import CuriousAlgorithm
from curiosity_algos.loops.declared import or_none, setting
from curiosity_algos.loops.evolution_strategy import MotivatedStrategy
from curiosity_algos.motivations.curiosity import CuriosityMotivation, check_how_to_score
from curiosity_gym.validation import check_at_least_one, check_share


class CuriosityES(CuriousAlgorithm, MotivatedStrategy):
    """Evolves policies whose trajectories lead to what a bonus finds curious.

    Each generation samples lambda policies around the center, scores them by
    `phi z(return) + (1 - phi) z(curiosity)`, moves the center towards the best mu, and trains the
    bonus on transitions of all of them, so that what is known stops being curious.

    The default bonus, `APT`, asks how far states lie from those remembered. The paper's is the
    error of an Intrinsic Curiosity Module, summed over the trajectory: `bonus="icm", n_states=None,
    n_updates=64, batch_size=1024`.

    Further keywords are those of `CuriousAlgorithm` (the bonus) and `MotivatedStrategy`.

    Args:
        n_states: An episode's curiosity is the mean of the highest quarter of those of so many of
            its transitions, which lie evenly over it; None: the sum over all, with `gamma`.
        gamma: Discount, in [0, 1]: in that sum, curiosity of step t of T weighs `gamma^(T-1-t)`
            (eq. 10); 1 where `n_states` is a number.
    """

    n_states: int | None = setting(20, or_none(check_at_least_one), part="_motivation")
    gamma: float = setting(1.0, check_share, part="_motivation")

    def _check_settings(self) -> None:
        super()._check_settings()
        check_how_to_score(self.n_states, self.gamma)

    def _make_motivation(self, seed: np.random.SeedSequence) -> CuriosityMotivation:
        return self._make_curiosity(seed, n_states=self.n_states, gamma=self.gamma)
