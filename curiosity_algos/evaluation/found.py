"""Episodes that succeeded, as their starts and their actions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from curiosity_algos.common.arrays import Array

N_FOUND = 10
"""Episodes that are kept."""


def is_success(info: Mapping[str, Any], total: float) -> bool:
    """Whether an episode succeeded, by its last info, or else by its return."""
    return bool(info.get("is_success", total > 0.0))


class BestEpisodes:
    """Keeps the ten successful episodes of the highest returns, of equals the shortest.

    Attributes:
        episodes: The best first: of each `total`, its return, `start`, the seed of its reset or the
            state of its environment's generator before it, and `actions`, (T, ...).
    """

    def __init__(self) -> None:
        self.episodes: list[dict[str, Any]] = []

    def takes(self, total: float, length: int) -> bool:
        """Whether an episode of this return and length is among the best."""
        is_full = len(self.episodes) == N_FOUND
        return not is_full or (-total, length) < _rank(self.episodes[-1])

    def add(self, total: float, start: Any, actions: Array) -> None:
        """Take in an episode, in place of the worst of ten if it is better."""
        kept = {"total": total, "start": start, "actions": actions}
        self.episodes = sorted([*self.episodes, kept], key=_rank)[:N_FOUND]

    def clear(self) -> None:
        """Forget all episodes."""
        self.episodes = []

    def state_dict(self) -> dict[str, Any]:
        """The episodes."""
        return {"episodes": list(self.episodes)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        self.episodes = list(state["episodes"])


def _rank(episode: Mapping[str, Any]) -> tuple[float, int]:
    return -episode["total"], len(episode["actions"])
