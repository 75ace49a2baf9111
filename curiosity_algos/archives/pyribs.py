"""pyribs' own grids as parts of a model: their elites in its file, their draws by its seed.

`GridArchive` and `CVTArchive` have no `state_dict`, and keep the fields that they were made with.
What is read and set here beside pyribs' interface are the attributes that both have in ribs 0.12.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from ribs.archives import ArrayStore, CVTArchive, GridArchive

from curiosity_algos.archives.base import EliteArchive
from curiosity_algos.archives.fields import (
    COMMON,
    Batch,
    check_elites,
    describe_for_search,
    described_by,
    nearest_elite,
)
from curiosity_algos.common.arrays import Array
from curiosity_algos.common.randomness import generator_state, load_generator_state

PyribsArchive = GridArchive | CVTArchive


class PyribsPart:
    """What a model asks of an archive of pyribs' beside pyribs' interface."""

    net_arch: Sequence[int] | None = None
    """pyribs' archives do not know what their solutions are."""

    def __init__(self, archive: PyribsArchive) -> None:
        self.archive: Any = archive  # whose private attributes are read and set here

    @property
    def settings(self) -> dict[str, Any]:
        """What decides who is kept, as JSON can hold it; centroids by their hash."""
        archive = self.archive
        if isinstance(archive, CVTArchive):
            centroids = np.ascontiguousarray(archive.centroids).tobytes()
            cells: dict[str, Any] = {"centroids": hashlib.sha256(centroids).hexdigest()[:16]}
        else:
            bounds = np.stack([archive.lower_bounds, archive.upper_bounds], axis=1)
            cells = {"dims": archive.dims.tolist(), "ranges": bounds.tolist()}
            cells["epsilon"] = float(archive.epsilon)
        names = ("learning_rate", "threshold_min", "qd_score_offset")
        types = {name: str(archive.dtypes[name]) for name in sorted(COMMON)}
        return {**cells, **{name: float(getattr(archive, name)) for name in names}, "dtypes": types}

    def prepare(
        self,
        extra_fields: Mapping[str, tuple[Any, Any]],
        net_arch: Sequence[int],
        seed: np.random.SeedSequence,
    ) -> None:
        """Serve a search that keeps these fields, as `EliteArchive.prepare` does."""
        archive = self.archive
        known, is_empty = dict(archive._store.field_desc), archive.empty
        fields = describe_for_search(known, extra_fields, is_empty=is_empty)
        if is_empty:
            archive._store = ArrayStore({**fields}, archive.cells)
        archive._rng = np.random.default_rng(seed)

    def nearest(self, behavior: npt.ArrayLike) -> Array:
        """The solution whose behavior is nearest to `behavior`, as `EliteArchive.nearest`."""
        index = self.archive.data("index")[nearest_elite(self.archive, behavior)]
        return self.archive._store.retrieve([index], "solution")[1][0]  # type: ignore[no-any-return]

    def state_dict(self) -> dict[str, Any]:
        """Elites in the order of their draws, their thresholds, the best, and the draws' state."""
        archive = self.archive
        return {
            "elites": {**archive.data(), "index": archive.data("index").astype(np.int64)},
            "objective_sum": np.array(archive._objective_sum),
            "best_elite": {k: np.array(value) for k, value in (archive.best_elite or {}).items()},
            "rng": generator_state(archive._rng),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError if that was of another archive."""
        elites, archive = state["elites"], self.archive
        check_elites(elites, dict(archive._store.field_desc))
        index = elites["index"]
        if not np.array_equal(archive.index_of(elites["measures"]), index):
            raise ValueError("The elites must be of the same archive, they lie in other cells.")
        fields = described_by(elites)
        store: Any = ArrayStore({**fields}, archive.cells)
        store.add(index, {name: elites[name] for name in fields})
        store._props["occupied_list"][: len(index)] = index  # `add` sorts, draws count in order
        archive._store = store
        self._sum_up(state["objective_sum"][()], state["best_elite"])
        load_generator_state(archive._rng, state["rng"])

    def _sum_up(self, objective_sum: Any, best: Batch) -> None:
        """Bring the statistics to a sum, whose last bits follow from the order of adding up."""
        archive = self.archive
        archive._stats_reset()
        if best:
            archive._best_elite = {name: value[()] for name, value in best.items()}
            archive._stats = replace(archive._stats, obj_max=archive._best_elite["objective"])
            archive._stats_update(objective_sum, archive._store.occupied_list[0])


def archive_part(archive: EliteArchive | PyribsArchive) -> EliteArchive | PyribsPart:
    """What a model asks of an archive beside pyribs' interface; those of this package have it."""
    return archive if isinstance(archive, EliteArchive) else PyribsPart(archive)


def archive_settings(archive: EliteArchive | PyribsArchive) -> dict[str, Any]:
    """What decides who is kept and what the elites score, as JSON can hold it."""
    offset = {"qd_score_offset": float(archive.qd_score_offset)}
    return {**archive_part(archive).settings, **offset}
