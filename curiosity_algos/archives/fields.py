"""Fields of elites: what an archive keeps of each, and which batches it takes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt
from ribs.archives import ArrayStore

from curiosity_algos.common.arrays import Array, Float64Array
from curiosity_algos.common.randomness import generator_state, load_generator_state
from curiosity_gym.validation import check_at_least_one

Batch = dict[str, Array]
"""Arrays (n, ...) by the names of fields."""
Description = dict[str, tuple[tuple[int, ...], np.dtype[Any]]]
"""Shape and type of each field of an elite."""

COMMON = {"solution", "objective", "measures"}
"""Fields that every archive is given of its elites; it adds "index" itself."""
RESERVED = COMMON | {"index"}
"""Names that no extra field may have: fields of every archive."""
NUMBERS = "biuf"
"""Kinds of types of numbers and truth values."""
FINITE = ("solution", "objective", "measures", "behavior")
"""The policies, and what they are compared by."""


def describe(
    solution_dim: int,
    measure_dim: int,
    solution_dtype: npt.DTypeLike,
    extra_fields: Mapping[str, tuple[Any, Any]] | None,
) -> Description:
    """The fields of an archive, but for "index"; ValueError for arguments that it cannot have."""
    check_at_least_one(solution_dim=solution_dim, measure_dim=measure_dim)
    return {
        "solution": ((int(solution_dim),), _as_dtype("solution_dtype", solution_dtype)),
        "objective": ((), np.dtype(np.float64)),
        "measures": ((int(measure_dim),), np.dtype(np.float64)),
        **describe_extra({} if extra_fields is None else extra_fields),
    }


def describe_extra(extra_fields: Mapping[str, tuple[Any, Any]]) -> Description:
    """Extra fields; ValueError unless an archive, its file and `verify` can have them."""
    try:
        taken = RESERVED & extra_fields.keys()
        free = {name: field for name, field in extra_fields.items() if name not in taken}
        fields: Any = ArrayStore(free, 0).field_desc
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(
            f"`extra_fields` must hold name: (shape, dtype), got {extra_fields!r:.200}."
        ) from error
    if taken:
        raise ValueError(f"`extra_fields` must not hold {', '.join(sorted(taken))}: it is taken.")
    for _, dtype in fields.values():
        _as_dtype("extra_fields", dtype)
    _check_known(fields)
    return dict(fields)


def _as_dtype(name: str, dtype: npt.DTypeLike) -> np.dtype[Any]:
    try:
        found = np.dtype(dtype)
    except TypeError:
        found = np.dtype(object)
    if found.kind not in NUMBERS:
        raise ValueError(f"`{name}` must hold types of numbers or truth values, got {dtype!r}.")
    return found


def _check_known(fields: Description) -> None:
    shape, dtype = fields.get("seed", ((), np.dtype(np.int64)))
    if shape != () or dtype.kind not in "iu":
        raise ValueError(f"`seed` must be one whole number of each elite, got {dtype} {shape}.")
    shape, dtype = fields.get("behavior", ((0,), np.dtype(np.float64)))
    if len(shape) != 1 or dtype.kind != "f":
        raise ValueError(f"`behavior` must be a vector of floats, got {dtype} {shape}.")


def check_batch(description: Description, given: Mapping[str, npt.ArrayLike]) -> Batch:
    """The arrays of a batch of n solutions; ValueError for fields that are not as described."""
    if given.keys() != description.keys():
        expected = ", ".join(description)
        raise ValueError(f"A batch must have the fields {expected}, got {', '.join(given)}.")
    data = {name: as_array(name, given[name], dtype) for name, (_, dtype) in description.items()}
    n = len(np.atleast_1d(data["solution"]))
    for name, (shape, _) in description.items():
        wanted = (n, *shape)
        if data[name].shape != wanted:
            raise ValueError(f"`{name}` must be of shape {wanted}, got {data[name].shape}.")
        if name in FINITE and not np.isfinite(data[name]).all():
            raise ValueError(f"`{name}` must be finite.")
        if name == "seed" and (data[name] < 0).any():
            raise ValueError("`seed` must be at least 0.")
    return data


def as_array(name: str, value: npt.ArrayLike, dtype: np.dtype[Any]) -> Array:
    """An array of a type; ValueError where the value of the argument `name` is none."""
    try:
        return np.asarray(value, dtype=dtype)
    except (OverflowError, TypeError, ValueError) as error:
        raise ValueError(f"`{name}` must be an array of {dtype}: {error}.") from error


def check_elites(data: Batch, description: Description) -> None:
    """Raise ValueError unless a file's elites, with "index", are as described."""
    for name, (_, dtype) in {**description, "index": ((), np.dtype(np.int64))}.items():
        if data[name].dtype != dtype:
            raise ValueError(f"`{name}` must be of type {dtype}, got {data[name].dtype}.")
    check_batch(description, {name: array for name, array in data.items() if name != "index"})
    index = data["index"]
    if index.shape != data["objective"].shape or len(np.unique(index)) < len(index):
        raise ValueError("`index` must be another one for each elite.")


def described_by(data: Batch) -> dict[str, Any]:
    """Keywords of an archive of these elites; ValueError where solutions are no rows of numbers."""
    for name, array in data.items():
        if not isinstance(array, np.ndarray):
            raise ValueError(f"`{name}` must be an array, got {array!r:.60}.")
    for name in ("solution", "measures"):
        if data[name].ndim != 2 or data[name].dtype.kind not in NUMBERS:
            raise ValueError(
                f"`{name}` must be rows of numbers, got {data[name].dtype} {data[name].shape}."
            )
    extra = {k: (a.shape[1:], a.dtype) for k, a in data.items() if k not in COMMON | {"index"}}
    n, dtype = data["solution"].shape[1], data["solution"].dtype
    return {"solution_dim": n, "solution_dtype": dtype, "extra_fields": extra}


def describe_elites(data: Batch, description: Description) -> Description:
    """A description with the types and shapes in `data`; ValueError where the fields are others."""
    expected = [*description, "index"]
    if data.keys() != set(expected):
        raise ValueError(
            f"Elites must have the fields {', '.join(expected)}, got {', '.join(data)}."
        )
    found = described_by(data)
    solution = {"solution": (description["solution"][0], found["solution_dtype"])}
    return description | solution | describe_extra(found["extra_fields"])


def nearest_elite(archive: Any, behavior: npt.ArrayLike) -> int:
    """Position of the elite whose behavior is nearest to (B,); ValueError where none can be."""
    behaviors = behaviors_of(archive)
    wanted = as_array("niche", behavior, np.dtype(np.float64))
    if not behaviors.shape[1]:
        raise ValueError("`niche` needs an env with a `behavior_space`, this one has none.")
    if wanted.shape != behaviors.shape[1:] or not np.isfinite(wanted).all():
        raise ValueError(
            f"`niche` must be finite of shape {behaviors.shape[1:]}, got {behavior!r}."
        )
    if not len(behaviors):
        raise ValueError("`niche` needs an archive with elites: learn first.")
    return int(np.argmin(np.sum((behaviors - wanted) ** 2, axis=1)))


def behaviors_of(archive: Any) -> Float64Array:
    """(n, B): the behaviors of an archive's elites, the measures unless "behavior" is kept."""
    name = "behavior" if "behavior" in archive.field_list else "measures"
    behaviors: Float64Array = archive.data(name)
    return behaviors


def check_keeps(is_kept: bool, fields: Description) -> None:
    """Raise ValueError unless an archive keeps, or can be given, the extra fields of a search."""
    if not is_kept:
        described = ", ".join(f"{name} {dtype} {shape}" for name, (shape, dtype) in fields.items())
        raise ValueError(
            f"`archive` must keep the extra fields {described} of each elite; an empty one without "
            "extra fields is given them."
        )


@contextmanager
def undo_on_error(archive: Any) -> Iterator[None]:
    """Give an archive back its attributes and the state of its draws where a block raises."""
    before, drawn = dict(vars(archive)), generator_state(archive._rng)
    try:
        yield
    except BaseException:
        vars(archive).update(before)
        load_generator_state(archive._rng, drawn)
        raise


def check_widths(net_arch: Sequence[int]) -> list[int]:
    """Hidden layers as plain integers, as a file's JSON knows no others; ValueError for others."""
    widths: list[int] = np.atleast_1d(np.asarray(net_arch)).tolist()
    for width in widths:
        check_at_least_one(net_arch=width)
    return widths


def check_finite(**values: object) -> None:
    """Raise ValueError unless every value is a finite number."""
    for name, value in values.items():
        if not (isinstance(value, Real) and math.isfinite(value)):
            raise ValueError(f"`{name}` must be a finite number, got {value!r}.")
