"""Places in episodes, and the actions that lead there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Array


@dataclass(frozen=True, eq=False)
class Trail:
    """Actions that go on where another trail ends.

    Attributes:
        before: The trail that it goes on from; None: the start.
        actions: (T, ...), as the environment takes them.
        length: Steps from the start to its end.
    """

    before: Trail | None
    actions: Array
    length: int

    def then(self, actions: Array) -> Trail:
        """The trail that goes on from here."""
        return Trail(self, actions, self.length + len(actions))

    @property
    def whole(self) -> Array:
        """All actions from the start on, (length, ...)."""
        return np.concatenate([trail.actions for trail in self.path])

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle the whole path at once: a chain of thousands is too deep."""
        return _trail_of, ([trail.actions for trail in self.path],)

    @property
    def path(self) -> list[Trail]:
        """The trails that lead here, from the start on."""
        found: list[Trail] = []
        trail: Trail | None = self
        while trail is not None:
            found.append(trail)
            trail = trail.before
        return found[::-1]


def _trail_of(parts: list[Array]) -> Trail:
    trail = Trail(None, parts[0], len(parts[0]))
    for actions in parts[1:]:
        trail = trail.then(actions)
    return trail


@dataclass(eq=False)
class Place:
    """A step of an episode, where others may go on.

    Attributes:
        trail: What leads there.
        total: Sum of the rewards on the way.
        state: Where the environment stood; None: the actions lead there again.
        times_chosen: How often episodes have gone on from there.
    """

    trail: Trail
    total: float
    state: Any = None
    times_chosen: int = 0

    @property
    def length(self) -> int:
        """Steps from the start."""
        return self.trail.length

    @property
    def actions(self) -> Array:
        """The actions from the start to there, (length, ...)."""
        return self.trail.whole


class Places:
    """Places by number.

    Args:
        no_actions: (0, ...), of the environment's type and shape of actions.
    """

    def __init__(self, no_actions: Array) -> None:
        self._start = Trail(None, no_actions, 0)
        self._places: dict[int, Place] = {}
        self._next = 0

    def __getitem__(self, number: int) -> Place:
        return self._places[number]

    def start(self) -> Place:
        """The start of all episodes."""
        return Place(self._start, 0.0)

    def add(self, places: Iterable[Place]) -> list[int]:
        """Number places, in the order given."""
        numbers = []
        for place in places:
            self._places[self._next] = place
            numbers.append(self._next)
            self._next += 1
        return numbers

    def keep(self, numbers: Iterable[int]) -> None:
        """Forget all others."""
        self._places = {number: self._places[number] for number in numbers}

    def state_dict(self) -> dict[str, Any]:
        """The places with the actions that lead there, without states of environments."""
        trails: dict[int, Trail] = {id(self._start): self._start}
        for place in self._places.values():
            trails |= {id(trail): trail for trail in place.trail.path}
        order = {key: i for i, key in enumerate(trails)}
        rows = list(trails.values())
        places = self._places.values()
        return {
            "before": np.array([-1 if t.before is None else order[id(t.before)] for t in rows]),
            "ends": np.cumsum([len(trail.actions) for trail in rows]),
            "actions": np.concatenate([trail.actions for trail in rows]),
            "numbers": np.array(list(self._places), dtype=np.int64),
            "trails": np.array([order[id(p.trail)] for p in places], dtype=np.int64),
            "totals": np.array([place.total for place in places], dtype=np.float64),
            "times_chosen": np.array([place.times_chosen for place in places], dtype=np.int64),
            "next": self._next,
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        parts = np.split(state["actions"], state["ends"][:-1])
        trails = [self._start]
        for before, actions in list(zip(state["before"], parts, strict=True))[1:]:
            # A copy's trails have roots of their own.
            trails.append((self._start if before < 0 else trails[before]).then(actions))
        columns = zip(state["trails"], state["totals"], state["times_chosen"], strict=True)
        places = [Place(trails[i], float(total), None, int(n)) for i, total, n in columns]
        self._places = dict(zip(state["numbers"].tolist(), places, strict=True))
        self._next = state["next"]
