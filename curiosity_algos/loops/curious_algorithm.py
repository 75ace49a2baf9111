"""The bonus, and its training, that algorithms share which are drawn to the curious."""

from __future__ import annotations

from typing import Any, TypedDict

import numpy as np

from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.evaluation.evaluator import AnyEnv
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.motivations.curiosity import CuriosityMotivation
from curiosity_gym.validation import check_at_least_one, check_keywords


class BonusKeywords(TypedDict, total=False):
    """Keywords of a bonus and its training that have one default, see `CuriousAlgorithm`."""

    bonus_kwargs: dict[str, Any] | None
    n_transitions: int
    buffer_size: int


class CuriousAlgorithm(EvolutionaryAlgorithm):
    """Holds the curiosity of trajectories, beside whatever search a class after it has.

    Args:
        bonus: "apt", "disagreement", "e3b", "icm", "ngu", "noveld", "ramp", "rnd", or a `Bonus`
            made for what it sees of the environment's spaces, which this then trains: the policy's
            `seen.space` and `acted.space`.
        bonus_kwargs: Keywords of a bonus that is named, see that (`learning_rate`, ...).
        n_transitions: m, transitions of each individual kept for training.
        n_updates: p, the bonus' gradient steps a generation.
        batch_size: Transitions a gradient step.
        buffer_size: Transitions kept in all, the newest.
    """

    _motivation: Any  # a CuriosityMotivation, which other classes declare as any motivation

    def __init__(
        self,
        env: AnyEnv | None,
        policy: str | type[MlpPolicy] = "MlpPolicy",
        *,
        bonus: str | Bonus,
        bonus_kwargs: dict[str, Any] | None = None,
        n_transitions: int = 100,
        n_updates: int,
        batch_size: int,
        buffer_size: int = 500_000,
        **kwargs: Any,  # those of the class after it
    ) -> None:
        check_keywords(bonus_kwargs=bonus_kwargs)
        self.bonus = bonus
        self.bonus_kwargs = dict(bonus_kwargs or {})
        self.n_transitions = n_transitions
        self.n_updates = n_updates
        self.batch_size = batch_size
        self.buffer_size = buffer_size
        super().__init__(env, policy, **kwargs)

    def _check_settings(self) -> None:
        super()._check_settings()
        check_at_least_one(n_transitions=self.n_transitions, n_updates=self.n_updates)
        check_at_least_one(batch_size=self.batch_size)

    def _settings_of_parts(self) -> set[str]:
        return super()._settings_of_parts() | {"bonus", "bonus_kwargs", "buffer_size"}

    def _put_in_force(self) -> None:
        super()._put_in_force()
        for name in ("n_transitions", "n_updates", "batch_size"):
            setattr(self._motivation, name, getattr(self, name))

    @property
    def trained_bonus(self) -> Bonus:
        """The bonus as trained so far; `bonus` is the argument that it was made by."""
        bonus: Bonus = self._motivation.bonus
        return bonus

    def _make_curiosity(
        self, seed: np.random.SeedSequence, **how_to_score: Any
    ) -> CuriosityMotivation:
        """Make the bonus and its buffer, and check their settings."""
        return CuriosityMotivation(
            self.policy.seen.space,
            self.policy.acted.space,
            bonus=self.bonus,
            bonus_kwargs=self.bonus_kwargs,
            n_transitions=self.n_transitions,
            n_updates=self.n_updates,
            batch_size=self.batch_size,
            buffer_size=self.buffer_size,
            seed=seed,
            device=self.device,
            n_threads=self.n_threads,
            **how_to_score,
        )
