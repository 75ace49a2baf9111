"""Curiosity-ES: the canonical evolution strategy, motivated by curiosity of whole trajectories.

Le Tolguenec et al. 2022, "Curiosity creates Diversity in Policy Search", algorithm 1.
"""

from __future__ import annotations

from typing import Unpack

import numpy as np

from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.evaluation.evaluator import AnyEnv
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.loops.curious_algorithm import BonusKeywords, CuriousAlgorithm
from curiosity_algos.loops.evolution_strategy import MotivatedKeywords, MotivatedStrategy
from curiosity_algos.motivations.curiosity import CuriosityMotivation, check_how_to_score


class _Keywords(BonusKeywords, MotivatedKeywords, total=False):
    pass


class CuriosityES(CuriousAlgorithm, MotivatedStrategy):
    """Evolves policies whose trajectories lead to what a bonus finds curious.

    Each generation samples lambda policies around the center, scores them by
    `phi z(return) + (1 - phi) z(curiosity)`, moves the center towards the best mu, and trains the
    bonus on transitions of all of them, so that what is known stops being curious.

    The default bonus, `APT`, asks how far states lie from those remembered. The paper's is the
    error of an Intrinsic Curiosity Module, summed over the trajectory:
    `CuriosityES.from_preset("paper", env)`, or for a task that the paper has not `bonus="icm",
    n_states=None, n_updates=64, batch_size=1024`.

    Further keywords are those of the bonus, see `CuriousAlgorithm`, of strategies with a
    motivation, see `MotivatedStrategy` and `EvolutionStrategy`, and of every algorithm, see
    `EvolutionaryAlgorithm`.

    Args:
        n_states: An episode's curiosity is the mean of the highest quarter of those of so many of
            its transitions, which lie evenly over it; None: the sum over all, with `gamma`.
        gamma: Discount, in [0, 1]: in that sum, curiosity of step t of T weighs `gamma^(T-1-t)`
            (eq. 10); 1 where `n_states` is a number.
    """

    def __init__(
        self,
        env: AnyEnv | None,
        policy: str | type[MlpPolicy] = "MlpPolicy",
        *,
        bonus: str | Bonus = "apt",
        n_states: int | None = 20,
        gamma: float = 1.0,
        n_updates: int = 32,
        batch_size: int = 256,
        **kwargs: Unpack[_Keywords],
    ) -> None:
        self.n_states = n_states
        self.gamma = gamma
        super().__init__(
            env, policy, bonus=bonus, n_updates=n_updates, batch_size=batch_size, **kwargs
        )

    def _check_settings(self) -> None:
        super()._check_settings()
        check_how_to_score(self.n_states, self.gamma)

    def _put_in_force(self) -> None:
        super()._put_in_force()
        self._motivation.n_states, self._motivation.gamma = self.n_states, self.gamma

    def _make_motivation(self, seed: np.random.SeedSequence) -> CuriosityMotivation:
        return self._make_curiosity(seed, n_states=self.n_states, gamma=self.gamma)
