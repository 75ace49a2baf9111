"""Action noise whose draws belong to the run."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from stable_baselines3.common.noise import ActionNoise

NOISE = 0.1
"""Standard deviation of the action noise, in halves of the action space."""


class GaussianActionNoise(ActionNoise):
    """Independent normal noise from a generator of its own.

    Args:
        n_actions: Entries of an action.
        seed: Where the draws begin.
    """

    def __init__(self, n_actions: int, seed: np.random.SeedSequence) -> None:
        super().__init__()
        self._n_actions = n_actions
        self._rng = np.random.default_rng(seed)

    def __call__(self) -> npt.NDArray[np.float32]:
        """The noise of one step."""
        return self._rng.normal(0.0, NOISE, self._n_actions).astype(np.float32)
