"""Bonuses that ask what an episode has seen, and what they remember of episodes under way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.common.arrays import Array, Float32Array, Mask


class Episodes(Protocol):
    """What a bonus remembers of episodes side by side, each from its beginning."""

    def score(self, observations: Array, actions: Array, next_observations: Any) -> Float32Array:
        """Bonus (n,) of a step of each episode, which is then remembered."""

    def end(self, dones: Mask) -> None:
        """Forget the episodes (n,) that have ended: with the next step others begin."""

    def state_dict(self) -> dict[str, Any]:
        """What is remembered, as tensors and plain values."""

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError if it is of other episodes."""


@runtime_checkable
class EpisodicBonus(Bonus, Protocol):
    """A bonus of a step in its episode: of a transition alone it has none.

    `score` raises ValueError, `score_trajectory` takes an episode from its beginning.
    """

    def episodes(self, n: int) -> Episodes:
        """A memory for n episodes side by side, none of which has begun."""


def refuse_transitions(
    bonus: Bonus, observations: Array, actions: Array, next_observations: Any
) -> Float32Array:
    """Raise ValueError: a transition alone has no bonus, see `episodes`."""
    raise ValueError(
        f"`bonus` must be asked for whole episodes: {bonus.name} remembers each of them."
    )


def check_needs_no_episodes(bonus: Bonus, holder: str) -> None:
    """Raise ValueError unless transitions that come in no order can be scored."""
    if isinstance(bonus, EpisodicBonus):
        raise ValueError(
            f"`bonus` must be one of single transitions in {holder}, {bonus.name} asks what an "
            "episode has seen before."
        )


def episodes_of(bonus: Bonus, n: int) -> Episodes | None:
    """A memory for n episodes side by side, if the bonus has any."""
    return bonus.episodes(n) if isinstance(bonus, EpisodicBonus) else None
