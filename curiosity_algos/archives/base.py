"""The base of archives of elites, whatever decides which solution enters where."""

from __future__ import annotations

import operator
import os
from abc import abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from ribs.archives import ArchiveBase, ArchiveStats, ArrayStore

from curiosity_algos.archives.verify import Verification, behaviors_of, verify
from curiosity_algos.common.arrays import Array, Int64Array
from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.evaluation.evaluator import AnyEnv
from curiosity_algos.state.check import check_keys, check_like
from curiosity_algos.state.file import read, save
from curiosity_gym.validation import check_at_least_one, check_seed, check_whole

NOT_ADDED, IMPROVED, NEW = 0, 1, 2
"""Statuses of an insertion, as pyribs numbers them."""
FIRST_CAPACITY = 64
Batch = dict[str, Array]
"""Arrays (n, ...) by the names of fields."""
Description = dict[str, tuple[tuple[int, ...], np.dtype[Any]]]
"""Shape and type of each field of an elite."""

COMMON = {"solution", "objective", "measures"}
"""Fields that every archive is given of its elites; it adds "index" itself."""
FINITE = {*COMMON, "behavior"}
"""The policies, and what they are compared by."""


class EliteArchive(ArchiveBase):
    """Elites in arrays that grow with their number, behind the interface of pyribs' archives.

    A subclass says which elites a batch replaces (`_insert`), and what tells elites apart
    (`_identities`).

    Args:
        solution_dim: Length of a parameter vector.
        measure_dim: Length of a behavior.
        qd_score_offset: Subtracted from every objective in the QD-score, for objectives below 0.
        seed: Of `sample_elites`.
        solution_dtype: Of the solutions; objectives and measures are float64.
        extra_fields: Name: (shape, dtype) of what is kept of each elite beside solution, objective
            and measures. `verify` resets with "seed", and compares "behavior" where there is one.
        net_arch: Hidden layers of the policies, for `verify`; None: the default ones.

    Raises:
        ValueError: If an argument is out of its range, or `extra_fields` are no such fields.
    """

    def __init__(
        self,
        *,
        solution_dim: int,
        measure_dim: int,
        qd_score_offset: float = 0.0,
        seed: int | np.random.SeedSequence | None = None,
        solution_dtype: npt.DTypeLike = np.float64,
        extra_fields: Mapping[str, tuple[Any, Any]] | None = None,
        net_arch: Sequence[int] | None = None,
    ) -> None:
        check_at_least_one(solution_dim=solution_dim, measure_dim=measure_dim)
        if not isinstance(seed, np.random.SeedSequence):
            check_seed(seed)
        self._description = {
            "solution": ((int(solution_dim),), np.dtype(solution_dtype)),
            "objective": ((), np.dtype(np.float64)),
            "measures": ((int(measure_dim),), np.dtype(np.float64)),
            **describe({} if extra_fields is None else extra_fields),
        }
        super().__init__(solution_dim=solution_dim, objective_dim=(), measure_dim=measure_dim)
        self.qd_score_offset = float(qd_score_offset)
        self.net_arch = None if net_arch is None else [*map(operator.index, net_arch)]
        self._rng = np.random.default_rng(seed)
        self._begin()

    def _begin(self) -> None:
        """Clear the elites, which are in slots 0, 1, 2, ... of pyribs' store."""
        self._elites = ArrayStore({**self._description}, 0)  # a file's shapes take no memory yet
        self._objective_sum, self._best_slot = np.float64(0.0), 0

    @abstractmethod
    def _insert(self, data: Batch) -> Batch:
        """Take a checked batch in; (n,) `status`, `value`, ... of its solutions, as `add`."""

    @abstractmethod
    def _identities(self, slots: Int64Array) -> Int64Array:
        """The field "index" of the elites in these slots."""

    @property
    def settings(self) -> dict[str, Any]:
        """Keywords that decide who is kept and what the elites score, as JSON can hold them."""
        return {"qd_score_offset": self.qd_score_offset}

    @property
    @abstractmethod
    def cells(self) -> int:
        """Number of elites that it could hold."""

    @property
    def field_list(self) -> list[str]:
        """Names of what is kept of each elite."""
        return [*self._description, "index"]

    @property
    def dtypes(self) -> dict[str, np.dtype[Any]]:
        """Data type of each field."""
        return {**self._elites.dtypes, "index": np.dtype(np.int64)}

    @property
    def empty(self) -> bool:
        """Whether it holds no elite."""
        return len(self) == 0

    def __repr__(self) -> str:
        best = "" if self.empty else f", best objective {self.stats.obj_max:.3f}"
        return f"<{type(self).__name__}: {len(self):,} elites{best}>"

    def __len__(self) -> int:
        """Number of elites."""
        return len(self._elites)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Each elite as a dictionary."""
        for slot in range(len(self)):
            yield self._elite(slot)

    @property
    def stats(self) -> ArchiveStats:
        """Number of elites, coverage, QD-score (also per cell), best and mean objective."""
        n, objective_sum = len(self), self._objective_sum
        qd_score = objective_sum - np.float64(n) * self.qd_score_offset
        return ArchiveStats(
            num_elites=n,
            coverage=np.float64(n / self.cells if n else 0.0),
            qd_score=qd_score,
            norm_qd_score=np.float64(qd_score / self.cells if n else 0.0),
            obj_max=self._column("objective")[self._best_slot] if n else None,
            obj_mean=objective_sum / n if n else None,
        )

    @property
    def best_elite(self) -> dict[str, Any] | None:
        """The elite of the highest objective, of equals the first; None where there is none."""
        return None if self.empty else self._elite(self._best_slot)

    def add(
        self,
        solution: npt.ArrayLike,
        objective: npt.ArrayLike,
        measures: npt.ArrayLike,
        **fields: npt.ArrayLike,
    ) -> Batch:
        """Offer a batch of n solutions.

        Args:
            solution: (n, solution_dim)
            objective: (n,)
            measures: (n, measure_dim)
            **fields: (n, ...) each of `extra_fields`.

        Returns:
            `status` (n,), 0 if not added, 1 if it took an elite's place, 2 if new; and `value`
            (n,), the objective less that of the elite before.

        Raises:
            ValueError: If a field is missing, unknown, of another shape, or not finite.
        """
        batch = {"solution": solution, "objective": objective, "measures": measures, **fields}
        return self._insert(check_batch(self._description, batch))

    def data(
        self, fields: str | Collection[str] | None = None, return_type: str | None = None
    ) -> Any:
        """The elites, in the order in which their places were first taken.

        Args:
            fields: A name: that array; several, or None for all: a dictionary of arrays.
            return_type: "dict", "tuple" or "pandas", a table without fields of matrices.

        Raises:
            ValueError: If there is no such field or return type.
        """
        return self._read(np.arange(len(self)), fields, return_type)

    def sample_elites(self, n: int | np.integer[Any], replace: bool = True) -> Batch:
        """Elites drawn uniformly, a dictionary of arrays (n, ...).

        Raises:
            IndexError: If there are none.
            ValueError: If there are fewer than n, and none may be drawn twice.
        """
        if self.empty:
            raise IndexError("The archive holds no elites to sample.")
        elites: Batch = self._read(self._rng.choice(len(self), size=n, replace=replace))
        return elites

    def clear(self) -> None:
        """Forget all elites."""
        self._begin()

    def reshape_field(self, name: str, shape: tuple[int, ...]) -> None:
        """Give a field of an empty archive another shape, known from its first elites on."""
        assert self.empty
        self._description[name] = (shape, self._description[name][1])
        self._begin()

    def prepare(
        self,
        extra_fields: Mapping[str, tuple[Any, Any]],
        net_arch: Sequence[int],
        seed: np.random.SeedSequence,
    ) -> None:
        """Serve a search that keeps these fields of policies with these hidden layers.

        An empty archive takes over the fields that it lacks; ValueError if it has others.
        """
        known, fields, is_empty = self._description, describe(extra_fields), self.empty
        wanted = {name: known[name] for name in ("solution", "objective", "measures")} | fields
        if not (known.keys() <= wanted.keys() if is_empty else known == wanted):
            described = ", ".join(
                f"{name} {kind} {shape}" for name, (shape, kind) in fields.items()
            )
            raise ValueError(
                f"`archive` must keep the extra fields {described} of each elite; an empty one "
                "without extra fields is given them."
            )
        self._description = wanted
        if is_empty:
            self._begin()
        self.net_arch = [*net_arch]
        self._rng = np.random.default_rng(seed)

    def nearest(self, behavior: npt.ArrayLike) -> Array:
        """The solution whose behavior is nearest to `behavior` (B,), in Euclidean distance.

        Raises:
            ValueError: If `behavior` is not finite of that shape, or there are no elites.
        """
        behaviors, wanted = behaviors_of(self), np.asarray(behavior, dtype=np.float64)
        if wanted.shape != behaviors.shape[1:] or not np.isfinite(wanted).all() or not wanted.size:
            shape = behaviors.shape[1:]
            raise ValueError(
                f"`niche` must be a finite behavior of shape {shape}, got {behavior!r}."
            )
        if self.empty:
            raise ValueError("`niche` needs an archive with elites: learn first.")
        nearest = np.argmin(np.sum((behaviors - wanted) ** 2, axis=1))
        solution: Array = self._column("solution")[nearest].copy()
        return solution

    def verify(self, env: AnyEnv, n_threads: int | None = None) -> Verification:
        """Play every elite again, see `curiosity_algos.archives.verify.verify`."""
        return verify(self, env, n_threads)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all elites to one `.npz`: `numpy.load(path)` gives the arrays of `data`.

        Raises:
            OSError: If it cannot be written; an older file is then as it was.
        """
        save(_npz(path), type(self).__name__, self._saved_settings(), self.data())

    def _saved_settings(self) -> dict[str, Any]:
        """Keywords that make the archive anew, as JSON can hold them."""
        fields = self._description
        extra = {k: [list(s), t.name] for k, (s, t) in fields.items() if k not in COMMON}
        return {
            "solution_dim": fields["solution"][0][0],
            "solution_dtype": fields["solution"][1].name,
            "extra_fields": extra,
            "net_arch": self.net_arch,
            **self.settings,
        }

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote.

        Raises:
            FileNotFoundError: If there is no such file.
            ValueError: If it holds no archive of this class.
        """
        settings, data = read(_npz(path), cls.__name__)
        try:
            archive = cls(**settings)
            archive._restore(data)
        except (AttributeError, LookupError, OverflowError, TypeError, ValueError) as error:
            raise ValueError(f"`path` must hold a whole {cls.__name__}: {error}") from error
        return archive

    def state_dict(self) -> dict[str, Any]:
        """Elites and the state of `sample_elites`, for exact resume."""
        return {
            "elites": self.data(),
            "objective_sum": float(self._objective_sum),
            "best_slot": self._best_slot,
            "rng": generator_state(self._rng),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError if that was of other fields."""
        self._restore(state["elites"])
        check_like(state["objective_sum"], 0.0, "objective_sum")
        check_whole(0, max(len(self) - 1, 0), best_slot=state["best_slot"])
        # A sum's last bits follow from the order of adding up.
        self._objective_sum = np.float64(state["objective_sum"])
        self._best_slot = state["best_slot"]
        load_generator_state(self._rng, state["rng"])

    def _restore(self, data: Batch) -> None:
        """Take over the elites of a file; ValueError unless they are as described."""
        check_keys(data, [*self._description, "index"], "elites")
        described = described_by(data)
        for name in COMMON:
            shape, wanted = described[name][0], self._description[name][0]
            if shape != wanted:
                raise ValueError(f"`{name}` must be of shape {wanted}, got {shape}.")
        check_batch(described, {name: data[name] for name in described})
        self._put(data)

    def _put(self, data: Mapping[str, Array]) -> None:
        """Take over these elites, all fields with "index", in place of those before."""
        self._description = described_by({**data})
        self._begin()
        if n := len(data["objective"]):
            self._write(np.arange(n), {name: data[name] for name in self._description})

    def _column(self, name: str) -> Array:
        """A field (n, ...) of all elites, not copied, which holds until the next `_write`."""
        values: Array = self._elites._fields[name][: len(self)]
        return values

    def _write(self, slots: Int64Array, rows: Batch) -> None:
        """Put at least one elite, arrays (n, ...) by field, into slots (n,), no two the same."""
        objective, n, needed = rows["objective"], len(self), int(slots.max()) + 1
        is_old = slots < n
        before = np.zeros(len(slots))
        before[is_old] = self._column("objective")[slots[is_old]]
        best = self._column("objective")[self._best_slot] if n else -np.inf
        if needed > self._elites.capacity:
            self._elites.resize(max(needed, 2 * self._elites.capacity, FIRST_CAPACITY))
        self._elites.add(slots, dict(rows))
        self._objective_sum = self._objective_sum + np.sum(objective - before)
        if objective.max() > best:
            self._best_slot = int(slots[np.argmax(objective)])

    def _read(
        self,
        slots: Int64Array,
        fields: str | Collection[str] | None = None,
        return_type: str | None = None,
    ) -> Any:
        """The `data` of the elites in some slots; pyribs' store takes these for "index"."""
        if fields == "index" and return_type is None:
            return self._identities(slots)
        container: Any = "dict" if return_type == "tuple" else return_type
        data: Any = self._elites.retrieve(slots, fields, container)[1]
        if not isinstance(data, np.ndarray) and "index" in data:
            data["index"] = self._identities(slots)
        return tuple(data.values()) if return_type == "tuple" else data

    def _elite(self, slot: int) -> dict[str, Any]:
        return {name: values[0] for name, values in self._read(np.array([slot])).items()}


def _npz(path: str | os.PathLike[str]) -> Path:
    """`path`, with the suffix `.npz` where it has none."""
    return Path(path) if Path(path).suffix else Path(path).with_suffix(".npz")


def describe(extra_fields: Mapping[str, tuple[Any, Any]]) -> Description:
    """Extra fields as an archive keeps them; ValueError unless it and its file can have them."""
    try:
        fields: Any = ArrayStore(dict(extra_fields), 0).field_desc
        if COMMON & fields.keys() or any(dtype.kind not in "biuf" for _, dtype in fields.values()):
            raise ValueError
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(
            "`extra_fields` must hold name: (shape, dtype) of numbers, beside solution, objective, "
            f"measures and index, got {extra_fields!r:.200}."
        ) from error
    return dict(fields)


def described_by(elites: Batch) -> Description:
    """The fields of elites, but for "index"."""
    return {k: (array.shape[1:], array.dtype) for k, array in elites.items() if k != "index"}


def check_batch(description: Description, batch: Mapping[str, npt.ArrayLike]) -> Batch:
    """The arrays of a batch of n solutions; ValueError for fields that are not as described."""
    check_keys(batch, description, "batch")
    data = {name: np.asarray(batch[name], dtype) for name, (_, dtype) in description.items()}
    n = len(np.atleast_1d(data["solution"]))
    for name, (shape, _) in description.items():
        wanted = (n, *shape)
        if data[name].shape != wanted:
            raise ValueError(f"`{name}` must be of shape {wanted}, got {data[name].shape}.")
        if name in FINITE and not np.isfinite(data[name]).all():
            raise ValueError(f"`{name}` must be finite.")
    return data
