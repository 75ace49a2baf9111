"""The best episodes that a wrapper of a VecEnv saw succeed, as their starts and their actions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.common.arrays import Array
from curiosity_algos.state.episodes import are_recorded

N_FOUND = 10
"""Episodes that are kept."""


def is_success(info: Mapping[str, Any], total: float) -> bool:
    """Whether an episode succeeded, by its last info, or else by its return."""
    return bool(info.get("is_success", total > 0.0))


class FoundEpisodes:
    """Keeps the ten successful episodes of the highest returns, if environments are recorded.

    Args:
        venv: The environments, each in a `RecordEpisode`; of others nothing is kept.

    Attributes:
        episodes: The best first: of each `total`, its return, `start`, the seed of its reset or the
            state of its environment's generator before it, and `actions`.
    """

    def __init__(self, venv: VecEnv) -> None:
        self._venv = venv
        self._is_recorded = are_recorded(venv.unwrapped)
        self._totals = np.zeros(venv.num_envs)
        self.episodes: list[dict[str, Any]] = []

    def see(self, rewards: Array, dones: Array, infos: Sequence[Mapping[str, Any]]) -> None:
        """See a step of every environment."""
        self._totals += rewards
        for i in np.flatnonzero(dones).tolist():
            if self._is_recorded and is_success(infos[i], self._totals[i]):
                self._add(i, float(self._totals[i]))
        self._totals[dones] = 0.0

    def _add(self, i: int, total: float) -> None:
        if len(self.episodes) == N_FOUND and total <= self.episodes[-1]["total"]:
            return
        episode = self._venv.env_method("last_episode", indices=i)[0]
        if episode is None or episode["options"] is not None:
            return
        kept = {"total": total, "start": episode["start"], "actions": episode["actions"]}
        self.episodes = sorted([*self.episodes, kept], key=lambda each: -each["total"])[:N_FOUND]

    def end(self) -> None:
        """All open episodes end without an outcome, as by a reset."""
        self._totals[:] = 0.0

    def state_dict(self) -> dict[str, Any]:
        """The episodes, and the returns of the open ones so far."""
        return {"episodes": self.episodes, "totals": self._totals.copy()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        self.episodes, self._totals[:] = list(state["episodes"]), state["totals"]
