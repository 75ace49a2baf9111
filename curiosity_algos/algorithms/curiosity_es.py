"""Curiosity-ES: the canonical evolution strategy, motivated by curiosity of whole trajectories.

Le Tolguenec et al. 2022, "Curiosity creates Diversity in Policy Search", algorithm 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.bonuses.make import check_bonus_choice
from curiosity_algos.evaluation.evaluator import AnyEnv
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.loops.evolution_strategy import MotivatedStrategy
from curiosity_algos.motivations.curiosity import (
    CuriosityMotivation,
    check_how_to_score,
    make_motivation,
)
from curiosity_gym.validation import check_at_least_one


class CuriosityES(MotivatedStrategy):
    """Evolves policies whose trajectories lead to what a bonus finds curious.

    Each generation samples lambda policies around the center, scores them by
    `phi z(return) + (1 - phi) z(curiosity)`, moves the center towards the best mu, and trains the
    bonus on transitions of all of them, so that what is known stops being curious.

    The default bonus, `APT`, asks how far states lie from those remembered. The paper's is the
    error of an Intrinsic Curiosity Module, summed over the trajectory: `preset="paper"`, or for a
    task that the paper has not `bonus="icm", n_states=None, n_updates=64, batch_size=1024`.

    Args:
        bonus: "apt", "icm", "rnd", or a `Bonus` made for the environment's spaces, which this then
            trains.
        bonus_kwargs: Of a bonus that is named, see `APT`, `ICM` and `RND` (`learning_rate`, ...).
        n_states: An episode's curiosity is the mean of the highest quarter of those of so many of
            its transitions, which lie evenly over it; None: the sum over all, with `gamma`.
        gamma: In [0, 1]: in that sum, curiosity of step t of T weighs `gamma^(T-1-t)` (eq. 10); 1
            where `n_states` is a number.
        n_transitions: m, transitions of each individual kept for training.
        n_updates: p, the bonus' gradient steps a generation.
        batch_size: Transitions a gradient step.
        buffer_size: Transitions kept in all, the newest.
    """

    def __init__(
        self,
        env: AnyEnv | None,
        policy: str | type[MlpPolicy] = "MlpPolicy",
        *,
        bonus: str | Bonus = "apt",
        bonus_kwargs: dict[str, Any] | None = None,
        n_states: int | None = 20,
        gamma: float = 1.0,
        n_transitions: int = 100,
        n_updates: int = 32,
        batch_size: int = 256,
        buffer_size: int = 500_000,
        **kwargs: Any,
    ) -> None:
        self.gamma = gamma
        self.bonus = bonus
        self.bonus_kwargs = dict(bonus_kwargs or {})
        self.n_states = n_states
        self.n_transitions = n_transitions
        self.n_updates = n_updates
        self.batch_size = batch_size
        self.buffer_size = buffer_size
        super().__init__(env, policy, **kwargs)

    @property
    def trained_bonus(self) -> Bonus:
        """The bonus as trained so far; `bonus` is the argument that it was made by."""
        assert isinstance(self._motivation, CuriosityMotivation)
        return self._motivation.bonus

    def _check_settings(self) -> None:
        super()._check_settings()
        check_how_to_score(self.n_states, self.gamma)
        check_at_least_one(n_transitions=self.n_transitions, n_updates=self.n_updates)
        check_at_least_one(batch_size=self.batch_size, buffer_size=self.buffer_size)
        check_bonus_choice(self.bonus, self.bonus_kwargs)

    def _make_motivation(self, seed: np.random.SeedSequence) -> CuriosityMotivation:
        return make_motivation(
            self.observation_space,
            self.action_space,
            bonus=self.bonus,
            bonus_kwargs=self.bonus_kwargs,
            gamma=self.gamma,
            n_states=self.n_states,
            n_transitions=self.n_transitions,
            n_updates=self.n_updates,
            batch_size=self.batch_size,
            buffer_size=self.buffer_size,
            seed=seed,
            device=self.device,
            n_threads=self.n_threads,
        )
