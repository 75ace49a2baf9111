"""The best episodes that a wrapper of a VecEnv saw succeed, as their starts and their actions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.common.arrays import Array
from curiosity_algos.evaluation.found import BestEpisodes, is_success
from curiosity_algos.state.episodes import are_recorded


class FoundEpisodes(BestEpisodes):
    """Keeps the ten successful episodes of the highest returns, if environments are recorded.

    Args:
        venv: The environments, each in a `RecordEpisode`; of others nothing is kept.
    """

    def __init__(self, venv: VecEnv) -> None:
        super().__init__()
        self._venv = venv
        self._is_recorded = are_recorded(venv.unwrapped)
        self._totals = np.zeros(venv.num_envs)

    def see(self, rewards: Array, dones: Array, infos: Sequence[Mapping[str, Any]]) -> None:
        """See a step of every environment."""
        self._totals += rewards
        for i in np.flatnonzero(dones).tolist():
            if self._is_recorded and is_success(infos[i], self._totals[i]):
                self._keep(i, float(self._totals[i]))
        self._totals[dones] = 0.0

    def _keep(self, i: int, total: float) -> None:
        episode = self._venv.env_method("last_episode", indices=i)[0]
        if episode is not None and episode["options"] is None:
            self.add(total, episode["start"], episode["actions"])

    def end(self) -> None:
        """All open episodes end without an outcome, as by a reset."""
        self._totals[:] = 0.0

    def state_dict(self) -> dict[str, Any]:
        """The episodes, and the returns of the open ones so far."""
        return {**super().state_dict(), "totals": self._totals.copy()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        super().load_state_dict(state)
        self._totals[:] = state["totals"]
