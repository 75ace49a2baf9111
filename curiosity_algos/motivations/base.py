"""The protocol of motivations: what evolution strategies rank by, beside reward."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from curiosity_algos.common.arrays import Float64Array
from curiosity_algos.evaluation.rollouts import Rollouts


class Motivation(Protocol):
    """An individual's interest beside reward.

    One that also has `summarizers`, a `MakeSummarizers`, says what it needs of trajectories: of
    large populations it gets rollouts that hold summaries alone.
    """

    def score(self, rollouts: Rollouts) -> Float64Array:
        """Intrinsic fitness of each individual, shape (P,)."""

    def update(self, rollouts: Rollouts) -> Mapping[str, float]:
        """Learn from the generation; metrics to log."""

    def state_dict(self) -> dict[str, Any]:
        """Everything that a resumed run needs."""

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
