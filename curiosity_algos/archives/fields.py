"""Fields of elites: what an archive keeps of each, and which batches it takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from ribs.archives import ArrayStore

from curiosity_algos.common.arrays import Array, Float64Array
from curiosity_algos.state.check import check_keys

Batch = dict[str, Array]
"""Arrays (n, ...) by the names of fields."""
Description = dict[str, tuple[tuple[int, ...], np.dtype[Any]]]
"""Shape and type of each field of an elite."""

COMMON = {"solution", "objective", "measures"}
"""Fields that every archive is given of its elites; it adds "index" itself."""
FINITE = {*COMMON, "behavior"}
"""The policies, and what they are compared by."""


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


def describe_for_search(
    known: Description, extra_fields: Mapping[str, tuple[Any, Any]], *, is_empty: bool
) -> Description:
    """The fields of an archive that is to serve a search, which keeps some extra fields.

    An empty archive takes over those that it lacks; ValueError where it has others.
    """
    fields = describe(extra_fields)
    common = {name: field for name, field in known.items() if name in {*COMMON, "threshold"}}
    wanted = common | fields
    if not (known.keys() <= wanted.keys() if is_empty else known == wanted):
        described = ", ".join(f"{name} {dtype} {shape}" for name, (shape, dtype) in fields.items())
        raise ValueError(
            f"`archive` must keep the extra fields {described} of each elite; an empty one without "
            "extra fields is given them."
        )
    return wanted


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


def check_elites(elites: Batch, known: Description) -> None:
    """Raise ValueError unless elites of a file, with "index", are such as an archive keeps."""
    check_keys(elites, [*known, "index"], "elites")
    found = described_by(elites)
    for name in COMMON:
        if found[name][0] != known[name][0]:
            raise ValueError(f"`{name}` must be of shape {known[name][0]}, got {found[name][0]}.")
    check_batch(found, {name: elites[name] for name in found})


def behaviors_of(archive: Any) -> Float64Array:
    """(n, B): the behaviors of an archive's elites, the measures unless "behavior" is kept."""
    name = "behavior" if "behavior" in archive.field_list else "measures"
    behaviors: Float64Array = archive.data(name)
    return behaviors
