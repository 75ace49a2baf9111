"""Explorations: episodes that go on from places, and the places that they come to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Array, Float32Array, Float64Array
from curiosity_algos.evaluation.cells import VisitedCells
from curiosity_algos.evaluation.places import Place, Trail
from curiosity_algos.evaluation.rollouts import Rollouts, concatenate
from curiosity_algos.evaluation.worlds import Outcome, Worlds
from curiosity_gym.core import CoverageGrid

N_VISITS = 5
"""Places that an exploration notes, as far from each other as possible, the last at its end."""

Act = Callable[[Array, int, Array], Array]
"""`act(rows, t, observations)`: actions (k, ...) for a bonus, of explorations `rows` (k,)."""


@dataclass(frozen=True)
class Visit:
    """A place that an exploration came to.

    Attributes:
        step: The step of the exploration.
        row: The exploration.
        place: The place.
        observation: (O,) what is observed there.
        behavior: (B,)
    """

    step: int
    row: int
    place: Place
    observation: Float32Array
    behavior: Float64Array


@dataclass(frozen=True)
class Explorations:
    """What explorations came to.

    Attributes:
        rollouts: Their steps alone; returns are those of the whole episodes.
        visits: Places on the way.
        found: Of the episodes that succeeded what leads there, and the sum of the rewards.
    """

    rollouts: Rollouts
    visits: list[Visit]
    found: list[tuple[Trail, float]]


def explore(
    worlds: Worlds,
    places: Sequence[Place],
    act: Act,
    taken: Callable[[Array], Array],
    n_steps: int,
    grid: CoverageGrid | None,
) -> Explorations:
    """Go on from each of P places for at most `n_steps` steps, or until the goal is reached.

    Args:
        worlds: Take up the episodes, as many at once as there are.
        places: Where to begin.
        act: Chooses actions.
        taken: Makes the environment's actions of those.
        n_steps: Steps at most.
        grid: Cells to count; None: none.
    """
    waves = [
        _Wave(worlds, places[begin : begin + worlds.n], begin, act, taken, n_steps, grid).play()
        for begin in range(0, len(places), worlds.n)
    ]
    visits = [visit for wave in waves for visit in wave.visits]
    visits.sort(key=lambda visit: (visit.step, visit.row))  # as if there were one wave
    found = [one for wave in waves for one in wave.found]
    return Explorations(concatenate([wave.rollouts for wave in waves]), visits, found)


class _Wave:
    """Explorations side by side."""

    def __init__(
        self,
        worlds: Worlds,
        places: Sequence[Place],
        first: int,
        act: Act,
        taken: Callable[[Array], Array],
        n_steps: int,
        grid: CoverageGrid | None,
    ) -> None:
        self._worlds, self._act, self._taken = worlds, act, taken
        self._first, self._n_steps, self._grid = first, n_steps, grid
        n = len(places)
        self._observations = [worlds.restore(places)]
        self._actions: list[Array] = []
        self._steps: list[Array] = []  # the same, as the environment takes them
        self._trails = [place.trail for place in places]
        self._since = 0  # the step that these end with
        self._totals = np.array([place.total for place in places])
        self._lengths = np.zeros(n, dtype=np.int64)
        self._success = np.zeros(n, dtype=np.bool_)
        self._terminated = np.zeros(n, dtype=np.bool_)
        self._behaviors: list[Any] = [None] * n
        self._visited = VisitedCells(grid)
        self._visits: list[Visit] = []
        self._found: list[tuple[Trail, float]] = []

    def play(self) -> Explorations:
        """Step all that go on."""
        active = np.arange(len(self._trails))
        for t in range(self._n_steps):
            chosen = self._act(self._first + active, t, self._observations[-1][active])
            taken = self._taken(chosen)
            outcome = self._worlds.step(taken, active)
            self._keep(active, chosen, taken, outcome)
            active = active[~self._stops(active, outcome)]
            if not len(active):
                break
            if (t + 1) * N_VISITS // self._n_steps > t * N_VISITS // self._n_steps:
                self._visit(active, t + 1)
        return self._results()

    def _keep(self, active: Array, chosen: Array, taken: Array, outcome: Outcome) -> None:
        n = len(self._trails)
        for rows, values in ((self._actions, chosen), (self._steps, taken)):
            rows.append(np.zeros((n, *values.shape[1:]), values.dtype))
            rows[-1][active] = values
        self._observations.append(self._observations[-1].copy())
        self._observations[-1][active] = outcome.observations
        self._lengths[active] += 1
        self._terminated[active] = outcome.terminated
        for i, behavior in zip(active.tolist(), outcome.behaviors, strict=True):
            self._behaviors[i] = behavior
        self._visited.add(outcome.behaviors)

    def _stops(self, active: Array, outcome: Outcome) -> Array:
        """Count rewards; whether each ends here, at its end or at a goal that its info names."""
        self._totals[active] += outcome.rewards
        if outcome.success is None:  # as everywhere, an episode's return says then how it ended
            is_found, stops = outcome.ended & (self._totals[active] > 0.0), outcome.ended
        else:
            is_found, stops = outcome.success, outcome.ended | outcome.success
        self._success[active] |= is_found
        for i in active[is_found].tolist():
            trail = self._trails[i].then(np.stack([each[i] for each in self._steps[self._since :]]))
            self._found.append((trail, float(self._totals[i])))
        return stops

    def _taken_since(self) -> Array:
        """The actions (n, T, ...) since the trails' ends."""
        return np.stack(self._steps[self._since :], axis=1)

    def _visit(self, active: Array, t: int) -> None:
        """Note where the explorations that go on stand."""
        taken = self._taken_since()
        for i, state in zip(active.tolist(), self._worlds.states(active), strict=True):
            # A copy, as one that is kept would else keep all.
            self._trails[i] = trail = self._trails[i].then(taken[i].copy())
            place = Place(trail, float(self._totals[i]), state)
            seen = self._observations[-1][i].copy()
            self._visits.append(Visit(t, self._first + i, place, seen, self._behaviors[i]))
        self._since = t

    def _results(self) -> Explorations:
        lengths, n = self._lengths, len(self._trails)
        observations = np.stack(self._observations, axis=1)
        rollouts = Rollouts(
            returns=self._totals,
            lengths=lengths,
            success=self._success,
            terminated=self._terminated,
            behaviors=np.stack(self._behaviors),
            final_observations=observations[np.arange(n), lengths],
            observations=observations,
            actions=np.stack(self._actions, axis=1),
            visited=None if self._grid is None else self._visited.indices(),
        )
        return Explorations(rollouts, self._visits, self._found)
