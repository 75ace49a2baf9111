"""Searches that end with their first success."""

from __future__ import annotations

import numpy as np
import pandas as pd
from stable_baselines3.common.callbacks import BaseCallback

from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm


class UntilFound(BaseCallback):
    """Ends a search with its first success."""

    model: EvolutionaryAlgorithm

    def _on_step(self) -> bool:
        return self.model.first_success_timesteps is None


def in_words(firsts: pd.Series) -> str:
    """How many of the runs succeeded, and the median of their first successes, in timesteps."""
    median = firsts.fillna(np.inf).median() / 1e6
    when = "" if np.isinf(median) else f", {median:.2g} M"
    return f"{firsts.notna().sum()} of {len(firsts)}{when}"
