"""Novelty of behaviors: what NS-ES adds to the canonical evolution strategy.

Lehman & Stanley 2011, "Abandoning Objectives: Evolution Through the Search for Novelty Alone"
(https://doi.org/10.1162/EVCO_a_00025); Conti et al. 2018 (https://arxiv.org/abs/1712.06560); the
paper's section 2.1.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from scipy.spatial import KDTree

from curiosity_algos.common.arrays import Float64Array, Int64Array
from curiosity_algos.common.neighbors import LARGEST, check_points, nearest_others
from curiosity_algos.evaluation.flat_spaces import FlatObservations
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer, check_observations
from curiosity_algos.state.check import check_like
from curiosity_gym.validation import check_at_least_one, check_choice

BEHAVIORS = ("final", "state")
REBUILD_SHARE = 0.03
"""Distinct behaviors since the large tree was built, as a share of it, that make it built anew."""


def behaviors_of(rollouts: Rollouts, behavior: str) -> Float64Array:
    """Behaviors compared, (P, B): "final": `info["behavior"]`; "state": the final observation."""
    if behavior == "final":
        return rollouts.behaviors
    check_observations(rollouts.final_observations)
    return rollouts.final_observations.astype(np.float64)


def behavior_size(
    behavior: str, observation_space: spaces.Space[Any], behavior_space: spaces.Box[Any] | None
) -> int:
    """B, the length of what `behaviors_of` gives; ValueError if there is no such behavior."""
    check_choice(BEHAVIORS, behavior=behavior)
    if behavior == "state":
        return FlatObservations(observation_space).size
    if behavior_space is None:
        raise ValueError(
            '`behavior="final"` needs an env with a `behavior_space`: wrap it in '
            'curiosity_gym.BehaviorWrapper, or choose `behavior="state"`.'
        )
    return behavior_space.shape[0]


class NoveltyArchive:
    """Keeps every behavior of B entries, and finds the nearest by Euclidean distance.

    Two k-d trees cover it: a large one that is seldom built, and a small one of later points,
    which every `add` builds. They hold equal behaviors once: policies stuck in the same corner
    would otherwise fill a leaf that no tree can split. From about 12 independent entries on a query
    comes to a scan of everything.
    """

    def __init__(self, n_dimensions: int) -> None:
        self.n_dimensions = n_dimensions
        self._copies = np.empty(0, dtype=np.int64)  # of each distinct behavior
        self._large = self._small = _tree(np.empty((0, n_dimensions)))

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {len(self):,} behaviors of {self.n_dimensions} entries>"

    def __len__(self) -> int:
        return int(self._copies.sum())

    def add(self, behaviors: npt.ArrayLike) -> None:
        """Take in behaviors (n, B); ValueError unless they are finite, and below 1e150 in size."""
        rows = self._checked(behaviors)
        distances, numbers = self._nearest_distinct(rows, 1, within=1.0 / LARGEST)
        is_known = (distances == 0.0).any(axis=1)
        np.add.at(self._copies, numbers[is_known].ravel(), 1)
        self._add_new(rows[~is_known])

    def _add_new(self, rows: Float64Array) -> None:
        """Append behaviors that no tree holds, each once, and count their copies."""
        new, first, copies = np.unique(rows, axis=0, return_index=True, return_counts=True)
        order = np.argsort(first)
        self._copies = np.append(self._copies, copies[order])
        recent, n_indexed = np.vstack([self._small.data, new[order]]), self._large.n
        if len(self._copies) > (1.0 + REBUILD_SHARE) * n_indexed:
            self._large, recent = _tree(np.vstack([self._large.data, recent])), recent[:0]
        self._small = _tree(recent)

    def nearest(self, behaviors: npt.ArrayLike, k: int) -> Float64Array:
        """Distances of the k nearest of the archive to each of the behaviors (n, B), ascending.

        Shape (n, min(k, len(self))). Equal behaviors are neighbors each.

        Raises:
            ValueError: If `k` is below 1, or for `behaviors` that `add` refuses.
        """
        check_at_least_one(k=k)
        queries = self._checked(behaviors)
        distances = np.empty((len(queries), min(k, len(self))))
        found, numbers = self._nearest_distinct(queries, k)
        for i, copies in enumerate(self._copies[numbers]):
            distances[i] = np.repeat(found[i], np.minimum(copies, k))[:k]
        return distances

    def _nearest_distinct(
        self, queries: Float64Array, k: int, within: float = np.inf
    ) -> tuple[Float64Array, Int64Array]:
        """Distances and numbers of the nearest distinct behaviors, up to k of them, ascending."""
        n_found = min(k, len(self._copies))
        # A sequence keeps the axis of a single neighbor; those that a tree lacks are at infinity.
        ranks = range(1, max(n_found, 1) + 1)
        large = self._large.query(queries, ranks, distance_upper_bound=within)
        small = self._small.query(queries, ranks, distance_upper_bound=within)
        distances = np.hstack([large[0], small[0]])
        numbers = np.hstack([large[1], small[1] + self._large.n])
        order = np.argsort(distances, axis=1, kind="stable")[:, :n_found]
        return np.take_along_axis(distances, order, 1), np.take_along_axis(numbers, order, 1)

    def _checked(self, behaviors: npt.ArrayLike) -> Float64Array:
        rows = np.asarray(behaviors, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != self.n_dimensions:
            raise ValueError(
                f"`behaviors` must have the shape (n, {self.n_dimensions}), got {rows.shape}."
            )
        check_points(behaviors=rows)
        return rows

    def state_dict(self) -> dict[str, Any]:
        """The distinct behaviors, how often each was added, and how many the large tree covers."""
        distinct = np.vstack([self._large.data, self._small.data])
        n_indexed = self._large.n
        return {"behaviors": distinct, "copies": self._copies.copy(), "n_indexed": n_indexed}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError for what that cannot give."""
        check_like(state, NoveltyArchive(self.n_dimensions).state_dict(), "archive")
        distinct, copies = self._checked(state["behaviors"]).copy(), state["copies"]
        if len(copies) != len(distinct) or (copies < 1).any():
            raise ValueError(f"`copies` must be {len(distinct)} whole numbers of at least 1.")
        self._copies = copies.copy()
        n = state["n_indexed"]
        self._large, self._small = _tree(distinct[:n]), _tree(distinct[n:])


def _tree(rows: Float64Array) -> KDTree:
    # Splits at midpoints: built in half the time, and final observations are found faster.
    return KDTree(rows, balanced_tree=False)


class NoveltyMotivation:
    """Scores an individual by its mean distance to the nearest behaviors seen before.

    Every individual enters the archive after it was scored, so that none meets itself. The first
    generation, which has no past, is compared with itself. `behavior` is "final" or "state", see
    `behaviors_of`.
    """

    def __init__(self, n_dimensions: int, *, k: int, behavior: str) -> None:
        self.k = k
        self.behavior = behavior
        self.archive = NoveltyArchive(n_dimensions)

    def summarizers(self, n_individuals: int) -> dict[str, Summarizer]:
        """Nothing: behaviors are no part of trajectories."""
        return {}

    def score(self, rollouts: Rollouts) -> Float64Array:
        """Novelty of each individual, shape (P,)."""
        behaviors = behaviors_of(rollouts, self.behavior)
        if len(self.archive):
            distances = self.archive.nearest(behaviors, self.k)
        elif len(behaviors) > 1:
            n = len(behaviors)
            distances, _ = nearest_others(behaviors, n, min(self.k, n - 1))
        else:
            distances = np.zeros((1, 1))
        novelty: Float64Array = distances.mean(axis=1)
        return novelty

    def update(self, rollouts: Rollouts) -> dict[str, float]:
        """Remember the generation; the archive's size."""
        self.archive.add(behaviors_of(rollouts, self.behavior))
        return {"archive/size": len(self.archive)}

    def state_dict(self) -> dict[str, Any]:
        return {"archive": self.archive.state_dict()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        self.archive.load_state_dict(state["archive"])
