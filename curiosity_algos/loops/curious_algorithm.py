"""The bonus and its training, which curiosity-driven algorithms share."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.loops.declared import setting
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.motivations.curiosity import CuriosityMotivation
from curiosity_gym.validation import check_at_least_one, check_keywords


class CuriousAlgorithm(EvolutionaryAlgorithm):
    """Holds the curiosity of trajectories, beside whatever search a class after it has.

    Args:
        bonus: "apt", "disagreement", "e3b", "etd", "icm", "ngu", "noveld", "ramp", "rnd", or a
            `Bonus` made for what it sees of the environment's spaces, which this then trains: the
            policy's `seen.space` and `acted.space`.
        bonus_kwargs: Keywords of a bonus that is named, see that (`learning_rate`, ...).
        n_transitions: m, transitions of each individual kept for training.
        n_updates: p, the bonus' gradient steps a generation.
        batch_size: Transitions a gradient step.
        buffer_size: Transitions kept in all, the newest.
    """

    bonus: str | Bonus = setting("apt", fixed=True)
    bonus_kwargs: dict[str, Any] | None = setting(
        None, check_keywords, convert=lambda kwargs: copy.copy(kwargs or {}), settled=True
    )
    n_transitions: int = setting(100, check_at_least_one, part="_motivation")
    n_updates: int = setting(32, check_at_least_one, part="_motivation")
    batch_size: int = setting(256, check_at_least_one, part="_motivation")
    buffer_size: int = setting(500_000, check_at_least_one, settled=True)
    _motivation: Any  # a CuriosityMotivation, which other classes declare as any motivation

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
            **{name: getattr(self, name) for name in CuriousAlgorithm._own_settings},
            seed=seed,
            device=self.device,
            n_threads=self.n_threads,
            **how_to_score,
        )
