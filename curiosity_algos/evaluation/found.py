"""Episodes that succeeded, as their starts and their actions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Array
from curiosity_algos.state.check import check_like

N_FOUND = 10
"""Episodes that are learned from, at most."""


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
        return not is_full or (-total, length) < rank(self.episodes[-1])

    def add(self, total: float, start: Any, actions: Array) -> None:
        """Take in an episode, in place of the worst of ten if it is better."""
        kept = {"total": total, "start": start, "actions": actions}
        self.episodes = sorted([*self.episodes, kept], key=rank)[:N_FOUND]

    def clear(self) -> None:
        """Forget all episodes."""
        self.episodes = []

    def state_dict(self) -> dict[str, Any]:
        """The episodes."""
        return {"episodes": list(self.episodes)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        self.episodes = list(state["episodes"])


def rank(episode: Mapping[str, Any]) -> tuple[float, int]:
    """The lower, the better the episode: its return counts, and of equal ones its length."""
    return -episode["total"], len(episode["actions"])


class Spread:
    """Keeps up to nineteen of the things that it sees, evenly spread over all, without chance.

    Attributes:
        kept: Those that are kept, in the order in which they came.
        n_seen: The number of those that were seen.
    """

    def __init__(self) -> None:
        self.kept: list[Any] = []
        self.n_seen = 0

    def see(self, thing: Any) -> None:
        """See one more."""
        stride = _stride(self.n_seen + 1)
        if stride > _stride(self.n_seen):
            self.kept = self.kept[::2]
        if self.n_seen % stride == 0:
            self.kept.append(thing)
        self.n_seen += 1


class FoundPolicies(Spread):
    """Policies of generations that came to the goal, each with the seed of its episode.

    A generation has one start: where starts are drawn, they succeeded from different ones.

    Args:
        n_parameters: Of a policy.
    """

    def __init__(self, n_parameters: int) -> None:
        super().__init__()
        self._n_parameters = n_parameters

    def state_dict(self) -> dict[str, Any]:
        """The parameters (n, n_parameters), the seeds (n,), and the number of those seen."""
        parameters = np.reshape([each for each, _ in self.kept], (-1, self._n_parameters))
        seeds = np.array([seed for _, seed in self.kept], dtype=np.int64)
        found = {"parameters": parameters.astype(np.float32), "seeds": seeds}
        return {**found, "n_seen": self.n_seen}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError for what that cannot give."""
        check_like(state, FoundPolicies(self._n_parameters).state_dict(), "found")
        seeds = state["seeds"].tolist()
        if len(seeds) != len(state["parameters"]) or min(seeds, default=0) < 0:
            raise ValueError("`found` must be policies, each with a seed.")
        self.kept = list(zip(state["parameters"].copy(), seeds, strict=True))
        self.n_seen = state["n_seen"]


def _stride(n: int) -> int:
    """From one of n things that is kept to the next: a power of two."""
    stride = 1
    while n > stride * (2 * N_FOUND - 1):
        stride *= 2
    return stride
