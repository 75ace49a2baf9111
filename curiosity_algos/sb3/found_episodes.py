"""Episodes that a wrapper of a VecEnv saw succeed, as their starts and their actions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.common.arrays import Array
from curiosity_algos.evaluation.found import Spread, is_success, rank
from curiosity_algos.state.episodes import are_recorded


class FoundEpisodes:
    """Keeps the best successful episode and some of all others, if environments are recorded.

    Where starts are drawn, the best ten would be those that began nearest to the goal.

    Args:
        venv: The environments, each in a `RecordEpisode`; of others nothing is kept.
    """

    def __init__(self, venv: VecEnv) -> None:
        self._best: dict[str, Any] | None = None
        self._others = Spread()
        self._venv = venv
        self._is_recorded = are_recorded(venv.unwrapped)
        self._totals = np.zeros(venv.num_envs)

    @property
    def episodes(self) -> list[dict[str, Any]]:
        """The best, then the others as they came.

        Of each `total`, its return, `start`, the state of its environment's generator before its
        reset, or the seed of that, and `actions`, (T, ...).
        """
        best = [] if self._best is None else [self._best]
        return [*best, *self._others.kept]

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
            found = {"total": total, "start": episode["start"], "actions": episode["actions"]}
            if self._best is None or rank(found) < rank(self._best):
                self._best = found
            self._others.see(found)

    def end(self) -> None:
        """All open episodes end without an outcome, as by a reset."""
        self._totals[:] = 0.0

    def state_dict(self) -> dict[str, Any]:
        """The episodes, how many were seen, and the returns of the open ones so far."""
        n_seen, totals = self._others.n_seen, self._totals.copy()
        return {"episodes": self.episodes, "n_seen": n_seen, "totals": totals}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        episodes = list(state["episodes"])
        self._best = episodes[0] if episodes else None
        self._others.kept, self._others.n_seen = episodes[1:], state["n_seen"]
        self._totals[:] = state["totals"]
