"""Ends a search with its first success."""

from __future__ import annotations

from stable_baselines3.common.callbacks import BaseCallback

from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm


class UntilFound(BaseCallback):
    """Ends a search with its first success."""

    model: EvolutionaryAlgorithm

    def _on_step(self) -> bool:
        return self.model.first_success_timesteps is None
