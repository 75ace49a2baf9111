"""The protocol of motivations: what evolution strategies rank by, beside reward."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from curiosity_algos.common.arrays import Float64Array
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer


class Motivation(Protocol):
    """An individual's interest beside reward."""

    def summarizers(self, n_individuals: int) -> Mapping[str, Summarizer] | None:
        """What it reads of the trajectories of so many individuals; None: all of them.

        Otherwise it gets rollouts of large populations that hold summaries alone.
        """
        return None

    def score(self, rollouts: Rollouts) -> Float64Array:
        """Intrinsic fitness of each individual, shape (P,)."""

    def update(self, rollouts: Rollouts) -> Mapping[str, float]:
        """Learn from the generation; metrics to log."""

    def state_dict(self) -> dict[str, Any]:
        """Everything that a resumed run needs."""

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
