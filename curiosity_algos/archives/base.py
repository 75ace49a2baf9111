"""What every archive of elites does, whatever decides which solution enters where."""

from __future__ import annotations

import math
import os
from abc import abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Real
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt
import torch as th
from ribs.archives import ArchiveBase, ArchiveStats, ArrayStore

from curiosity_algos.archives.store import Description, EliteStore
from curiosity_algos.archives.verify import Verification, verify
from curiosity_algos.checkpoints.archive_file import FIELDS, read_archive, write_archive
from curiosity_algos.common.randomness import generator_state, load_generator_state
from curiosity_gym.validation import check_at_least_one, check_choice, check_keywords

if TYPE_CHECKING:
    from curiosity_algos.evaluation.evaluator import AnyEnv

Float64Array = npt.NDArray[np.float64]
Int64Array = npt.NDArray[np.int64]
Batch = dict[str, npt.NDArray[Any]]

RESERVED = {"solution", "objective", "measures", "index", "about", "file", "allow_pickle"}
"""Names that no extra field may have: fields of every archive, and those that its file uses."""
PLACES = ("objective", "measures", "behavior")
"""What elites are compared by."""
NOT_ADDED, IMPROVED, NEW = 0, 1, 2
"""Statuses of an insertion, as pyribs numbers them."""


class EliteArchive(ArchiveBase):
    """Elites in arrays that grow with their number, behind the interface of pyribs' archives.

    pyribs' emitters and schedulers work on it unchanged. A subclass says which elites a batch
    replaces (`_insert`), and what tells elites apart (`_identities`).

    Args:
        solution_dim: Length of a parameter vector.
        measure_dim: Length of a behavior.
        qd_score_offset: Subtracted from every objective in the QD-score, for objectives below 0.
        seed: Of `sample_elites`.
        solution_dtype: Of the solutions; objectives and measures are float64.
        extra_fields: Name: (shape, dtype) of what is kept of each elite beside solution, objective
            and measures. "seed" (the episode's) is what `verify` resets with, and "behavior" what
            it compares where the measures are something else.
        net_arch: Hidden layers of the policies that the solutions are, for `verify`; None: the
            default ones.

    Raises:
        ValueError: If a name in `extra_fields` is taken, or its type holds no numbers.
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
        check_at_least_one(solution_dim=solution_dim)
        check_keywords(extra_fields=extra_fields)
        super().__init__(solution_dim=solution_dim, objective_dim=(), measure_dim=measure_dim)
        if not is_finite(qd_score_offset):
            raise ValueError(f"`qd_score_offset` must be a finite number, got {qd_score_offset!r}.")
        self.qd_score_offset = float(qd_score_offset)
        self.net_arch = None if net_arch is None else _checked_widths(net_arch)
        self._rng = np.random.default_rng(seed)
        self._own_fields = _checked_fields(extra_fields or {})
        self._description: Description = {
            "solution": (_as_shape(solution_dim), np.dtype(solution_dtype)),
            "objective": ((), np.dtype(np.float64)),
            "measures": (_as_shape(measure_dim), np.dtype(np.float64)),
            **self._own_fields,
        }
        self._begin()

    def _begin(self) -> None:
        """Hold nothing."""
        self._store = EliteStore(dict(self._description))
        self._objective_sum = np.float64(0.0)
        self._best_slot = 0

    # -- what an archive writes -----------------------------------------------------------------

    @abstractmethod
    def _insert(self, data: Batch) -> Batch:
        """Take a checked batch in; (n,) `status`, `value`, ... of its solutions, as `add`."""

    @abstractmethod
    def _identities(self, slots: Int64Array) -> Int64Array:
        """The field "index" of the elites in these slots."""

    @property
    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """Keywords of this kind of archive, as JSON can hold them; those of any are not named."""

    @property
    @abstractmethod
    def cells(self) -> int:
        """Number of elites that it could hold."""

    # -- pyribs' interface ----------------------------------------------------------------------

    @property
    def field_list(self) -> list[str]:
        """Names of what is kept of each elite."""
        return [*self._description, "index"]

    @property
    def dtypes(self) -> dict[str, np.dtype[Any]]:
        """Data type of each field."""
        kept = {name: dtype for name, (_, dtype) in self._description.items()}
        return {**kept, "index": np.dtype(np.int64)}

    @property
    def empty(self) -> bool:
        """Whether it holds no elite."""
        return len(self) == 0

    def __len__(self) -> int:
        """Number of elites."""
        return len(self._store)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Each elite as a dictionary."""
        for slot in range(len(self)):
            yield self._elite(slot)

    @property
    def stats(self) -> ArchiveStats:
        """Number of elites, coverage, QD-score (also per cell), best and mean objective."""
        n = len(self)
        qd_score = self._objective_sum - np.float64(n) * self.qd_score_offset
        return ArchiveStats(
            num_elites=n,
            coverage=np.float64(n / self.cells if n else 0.0),
            qd_score=qd_score,
            norm_qd_score=np.float64(qd_score / self.cells if n else 0.0),
            obj_max=self._best_objective if n else None,
            obj_mean=self._objective_sum / n if n else None,
        )

    @property
    def best_elite(self) -> dict[str, Any] | None:
        """The elite of the highest objective, the first of them; None where there is none."""
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
            `status` (n,): 0 not added, 1 took an elite's place, 2 new; `value` (n,): the objective,
            less that of the elite before.

        Raises:
            ValueError: If a field is missing, unknown, of another shape, or not finite.
        """
        given = {"solution": solution, "objective": objective, "measures": measures, **fields}
        return self._insert(self._checked(given))

    def add_single(
        self,
        solution: npt.ArrayLike,
        objective: npt.ArrayLike,
        measures: npt.ArrayLike,
        **fields: npt.ArrayLike,
    ) -> dict[str, Any]:
        """Offer one solution; as `add`, without the leading dimension."""
        given = {"solution": solution, "objective": objective, "measures": measures, **fields}
        info = self.add(**{name: np.asarray(value)[None] for name, value in given.items()})
        return {name: values[0] for name, values in info.items()}

    def data(
        self, fields: str | Collection[str] | None = None, return_type: str | None = None
    ) -> Any:
        """The elites, in the order in which their places were first taken.

        Args:
            fields: A name: that array; several, or None for all: a dictionary of arrays.
            return_type: "dict", "tuple" or "pandas" for another container; a table of pandas holds
                no fields of matrices.

        Raises:
            ValueError: If there is no such field or return type.
        """
        return self._read(None, fields, return_type)

    def sample_elites(self, n: int | np.integer[Any], replace: bool = True) -> Batch:
        """Elites drawn uniformly, a dictionary of arrays (n, ...).

        Raises:
            IndexError: If there are none.
            ValueError: If there are fewer than n, and none may be drawn twice.
        """
        if self.empty:
            raise IndexError("The archive holds no elites to sample.")
        slots = self._rng.choice(len(self), size=n, replace=replace)
        elites: Batch = self._read(slots)
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

        Args:
            extra_fields: See `EliteArchive`; an empty archive takes them over, in place of those
                of an earlier search.
            net_arch: See `EliteArchive`.
            seed: Of `sample_elites` from now on.

        Raises:
            ValueError: If the archive was made with fields that the search does not keep, or holds
                elites with others than it keeps.
        """
        fields = _checked_fields(extra_fields)
        common = {k: v for k, v in self._description.items() if k in FIELDS}
        is_same = self._description == common | fields
        if not (self._own_fields.keys() <= fields.keys() if self.empty else is_same):
            described = ", ".join(f"{name} {shape}" for name, (shape, _) in fields.items())
            raise ValueError(
                f"`archive` must keep the extra fields {described} of each elite; an empty one "
                "without extra fields is given them."
            )
        if self.empty:
            self._description = common | fields
            self._begin()
        self.net_arch = list(net_arch)
        self._rng = np.random.default_rng(seed)

    @contextmanager
    def unchanged_on_error(self) -> Iterator[None]:
        """Undo what a block that raises did by `prepare`, `clear` and `load_state_dict`."""
        before, drawn = dict(vars(self)), generator_state(self._rng)  # the rest they replace
        try:
            yield
        except BaseException:
            vars(self).update(before)
            load_generator_state(self._rng, drawn)
            raise

    # -- policies -------------------------------------------------------------------------------

    @property
    def behaviors(self) -> Float64Array:
        """(n, B): the elites' behaviors, the measures unless a field "behavior" is kept."""
        name = "behavior" if "behavior" in self._description else "measures"
        behaviors: Float64Array = self.data(name)
        return behaviors

    def nearest(self, behavior: npt.ArrayLike) -> npt.NDArray[Any]:
        """The solution whose behavior is nearest to `behavior` (B,), in Euclidean distance.

        Raises:
            ValueError: If `behavior` is not finite of that shape, or the archive is empty.
        """
        behaviors = self.behaviors
        wanted = _as_array("niche", behavior, np.dtype(np.float64))
        if not behaviors.shape[1]:
            raise ValueError("`niche` needs an env with a `behavior_space`, this one has none.")
        if wanted.shape != behaviors.shape[1:] or not np.isfinite(wanted).all():
            raise ValueError(
                f"`niche` must be finite of shape {behaviors.shape[1:]}, got {behavior!r}."
            )
        if self.empty:
            raise ValueError("`niche` needs an archive with elites: learn first.")
        slots = np.array([np.argmin(np.sum((behaviors - wanted) ** 2, axis=1))])
        solution: npt.NDArray[Any] = self._store.get("solution", slots)[0]
        return solution

    def verify(self, env: AnyEnv, n_threads: int | None = None) -> Verification:
        """Play every elite again, and compare its return and behavior with those kept.

        See `curiosity_algos.archives.verify.verify`.
        """
        return verify(self, env, n_threads)

    # -- files and checkpoints ------------------------------------------------------------------

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all elites to one file, see `curiosity_algos.checkpoints.archive_file`.

        Raises:
            OSError: If it cannot be written; an older file is then as it was.
        """
        write_archive(path, type(self).__name__, self._saved_settings(), self.data())

    def _saved_settings(self) -> dict[str, Any]:
        """Keywords that make the archive anew, as JSON can hold them."""
        common = {"qd_score_offset": self.qd_score_offset, "net_arch": self.net_arch}
        return {**common, **self.settings}

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote.

        Raises:
            FileNotFoundError: If there is no such file.
            ValueError: If it holds no archive of this class.
        """
        settings, data = read_archive(path, cls.__name__)
        try:
            return cls._restored(settings, data)
        except (OverflowError, TypeError, ValueError) as error:
            raise ValueError(f"`path` must hold a whole {cls.__name__}: {error}") from error

    @classmethod
    def _restored(cls, settings: dict[str, Any], data: Batch) -> Self:
        """The archive of a file, every entry of which is checked."""
        _check_matrices(data)
        archive = cls(
            **settings,
            solution_dim=data["solution"].shape[1],
            solution_dtype=data["solution"].dtype,
            extra_fields={k: (a.shape[1:], a.dtype) for k, a in data.items() if k not in FIELDS},
        )
        if archive._saved_settings() != settings:  # such as text for hidden layers
            raise ValueError(f"Its settings must be like {archive._saved_settings()}.")
        archive._check_elites(data)
        archive._put(data)
        return archive

    def _check_elites(self, data: Batch) -> None:
        """Raise ValueError unless these could be the elites of an archive of this description."""
        for name, dtype in self.dtypes.items():
            if data[name].dtype != dtype:
                raise ValueError(f"`{name}` must be of type {dtype}, got {data[name].dtype}.")
        self._checked({name: array for name, array in data.items() if name != "index"})
        index = data["index"]
        if index.shape != data["objective"].shape or len(np.unique(index)) < len(index):
            raise ValueError("`index` must be another one for each elite.")

    def state_dict(self) -> dict[str, Any]:
        """Elites and the state of `sample_elites`, for exact resume."""
        return {
            "elites": {name: th.from_numpy(array) for name, array in self.data().items()},
            "objective_sum": float(self._objective_sum),
            "best_slot": self._best_slot,
            "rng": generator_state(self._rng),
        }

    def load_state_dict(self, state: Mapping[str, Any], strict: bool = True) -> None:
        """Take over what `state_dict` gave.

        Raises:
            ValueError: If that was no archive with these fields; nothing has changed then.
        """
        elites = {name: tensor.cpu().numpy() for name, tensor in state["elites"].items()}
        with self.unchanged_on_error():
            self._description = self._described(elites)
            self._check_elites(elites)
            _check_summary(state["objective_sum"], state["best_slot"], len(elites["objective"]))
            self._put(elites)
            # As it was added up: another order of the sum may have other last bits.
            self._objective_sum = np.float64(state["objective_sum"])
            self._best_slot = state["best_slot"]
            load_generator_state(self._rng, state["rng"])

    def _described(self, data: Batch) -> Description:
        """The description with the solutions' type and the extra fields' shapes as in `data`."""
        if data.keys() != set(self.field_list):
            raise ValueError(
                f"Elites must have the fields {', '.join(self.field_list)}, got {', '.join(data)}."
            )
        _check_matrices(data)
        extra = {k: (a.shape[1:], a.dtype) for k, a in data.items() if k not in FIELDS}
        shape, _ = self._description["solution"]
        solution = {"solution": (shape, data["solution"].dtype)}
        return self._description | solution | _checked_fields(extra)

    def _put(self, data: Mapping[str, npt.NDArray[Any]]) -> None:
        """Hold these elites, all fields with "index", instead of what was held."""
        n = len(data["objective"])
        self._description = {k: (data[k].shape[1:], data[k].dtype) for k in self._description}
        self._begin()
        if n:
            self._store.put(np.arange(n), {name: data[name] for name in self._description})
            self._objective_sum = np.float64(data["objective"].sum())
            self._best_slot = int(np.argmax(data["objective"]))

    # -- inside ---------------------------------------------------------------------------------

    def _write(self, slots: Int64Array, data: Batch) -> None:
        """Put elites into their slots, and keep the sum and the best up to date."""
        objective, n = data["objective"], len(self)
        is_old = slots < n
        before = np.zeros(len(slots))
        before[is_old] = self._store.get("objective", slots[is_old])
        best = self._best_objective if n else -np.inf
        self._store.put(slots, data)
        self._objective_sum = self._objective_sum + np.sum(objective - before)
        if objective.max() > best:
            self._best_slot = int(slots[np.argmax(objective)])

    @property
    def _best_objective(self) -> Any:
        return self._store.get("objective", np.array([self._best_slot]))[0]

    def _read(
        self,
        slots: Int64Array | None,
        fields: str | Collection[str] | None = None,
        return_type: str | None = None,
    ) -> Any:
        """As `data`, of the elites in some slots; None: of all."""
        if isinstance(fields, str) and return_type is None:
            return self._column(slots, fields)
        return_type = return_type or "dict"
        check_choice(("dict", "tuple", "pandas"), return_type=return_type)
        fields = [fields] if isinstance(fields, str) else fields
        names = self.field_list if fields is None else list(fields)
        columns = [self._column(slots, name) for name in names]
        if return_type == "tuple":
            return tuple(columns)
        elites = dict(zip(names, columns, strict=True))
        return _table(elites) if return_type == "pandas" else elites

    def _column(self, slots: Int64Array | None, name: str) -> npt.NDArray[Any]:
        if name != "index":
            return self._store.get(name, slots)
        return self._identities(np.arange(len(self)) if slots is None else slots)

    def _elite(self, slot: int) -> dict[str, Any]:
        return {name: values[0] for name, values in self._read(np.array([slot])).items()}

    def _checked(self, given: Mapping[str, npt.ArrayLike]) -> Batch:
        if given.keys() != self._description.keys():
            expected = ", ".join(self._description)
            raise ValueError(f"A batch must have the fields {expected}, got {', '.join(given)}.")
        data = {
            name: _as_array(name, given[name], dtype)
            for name, (_, dtype) in self._description.items()
        }
        n = len(np.atleast_1d(data["solution"]))
        for name, (shape, _) in self._description.items():
            wanted = (n, *shape)
            if data[name].shape != wanted:
                raise ValueError(f"`{name}` must be of shape {wanted}, got {data[name].shape}.")
            if name in PLACES and not np.isfinite(data[name]).all():
                raise ValueError(f"`{name}` must be finite.")
            if name == "seed" and (data[name] < 0).any():
                raise ValueError("`seed` must be at least 0.")
        return data


def _table(elites: Batch) -> Any:
    """A table of pandas, as pyribs' archives give it."""
    n = len(next(iter(elites.values())))
    kept = {name: array for name, array in elites.items() if name != "index"}
    store = ArrayStore({name: (array.shape[1:], array.dtype) for name, array in kept.items()}, n)
    store.add(np.arange(n), dict(kept))
    table: Any = store.retrieve(np.arange(n), list(elites), "pandas")[1]
    if "index" in elites:
        table["index"] = elites["index"]  # the store's own is the slot
    return table


def _checked_fields(extra_fields: Mapping[str, tuple[Any, Any]]) -> Description:
    """The description of extra fields that neither an archive nor its file has already."""
    fields = {name: (_as_shape(shape), np.dtype(d)) for name, (shape, d) in extra_fields.items()}
    taken = RESERVED & fields.keys()
    if taken:
        raise ValueError(f"`extra_fields` must not hold {', '.join(sorted(taken))}: it is taken.")
    if any(dtype.kind not in "biuf" for _, dtype in fields.values()):
        raise ValueError("`extra_fields` must hold types of numbers or truth values.")
    _check_known(fields)
    return fields


def _check_known(fields: Description) -> None:
    """Raise ValueError where `verify` could not use a field that it knows."""
    shape, dtype = fields.get("seed", ((), np.dtype(np.int64)))
    if shape != () or dtype.kind not in "iu":
        raise ValueError(f"`seed` must be one whole number of each elite, got {dtype} {shape}.")
    shape, dtype = fields.get("behavior", ((0,), np.dtype(np.float64)))
    if len(shape) != 1 or dtype.kind != "f":
        raise ValueError(f"`behavior` must be a vector of floats, got {dtype} {shape}.")


def _check_matrices(data: Batch) -> None:
    """Raise ValueError unless solutions and measures are rows of numbers."""
    for name in ("solution", "measures"):
        if data[name].ndim != 2 or data[name].dtype.kind not in "biuf":
            raise ValueError(
                f"`{name}` must be rows of numbers, got {data[name].dtype} {data[name].shape}."
            )


def _check_summary(objective_sum: Any, best_slot: Any, n: int) -> None:
    """Raise ValueError unless n elites could have this sum, and their best in this slot."""
    if not is_finite(objective_sum):
        raise ValueError(f"`objective_sum` must be a finite number, got {objective_sum!r}.")
    if not (isinstance(best_slot, int) and 0 <= best_slot < max(n, 1)):
        raise ValueError(f"`best_slot` must be that of one of {n} elites, got {best_slot!r}.")


def is_finite(value: Any) -> bool:
    """Whether it is a finite real number."""
    return isinstance(value, Real) and math.isfinite(value)


def _checked_widths(net_arch: Sequence[int]) -> list[int]:
    """Hidden layers as plain integers: the file's JSON knows no others."""
    widths: list[int] = np.atleast_1d(np.asarray(net_arch)).tolist()
    for width in widths:
        check_at_least_one(net_arch=width)
    return widths


def _as_shape(shape: int | Sequence[int]) -> tuple[int, ...]:
    return tuple(np.atleast_1d(np.array(shape, dtype=np.int64)).tolist())


def _as_array(name: str, value: npt.ArrayLike, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    try:
        return np.asarray(value, dtype=dtype)
    except (OverflowError, TypeError, ValueError) as error:
        raise ValueError(f"`{name}` must be an array of {dtype}: {error}.") from error
