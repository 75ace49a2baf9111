"""Files of tensors and plain values, which torch reads back without running code."""

from __future__ import annotations

import io
import os
import pickle
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt
import torch as th

from curiosity_algos.common.arrays import Array
from curiosity_algos.state.atomic_file import atomic_file


def plain(value: Any) -> Any:
    """`value`, as Python's own number where it is one of numpy's, which these files do not hold."""
    return value.item() if isinstance(value, np.generic) else value


def is_plain(value: Any) -> bool:
    """Whether torch reads it back without running code: tensors and plain values."""
    if isinstance(value, Mapping):
        return all(map(is_plain, value.values()))
    if isinstance(value, list | tuple):
        return all(map(is_plain, value))
    is_leaf = isinstance(value, bool | int | float | str | th.Tensor) or value is None
    return is_leaf and not isinstance(value, np.generic)


def check_plain(state: Any, name: str) -> None:
    """Raise ValueError unless a file can hold the state of the argument `name`."""
    if not is_plain(state):
        raise ValueError(f"`{name}` must have a state of tensors and plain values.")


def fitting(name: str, saved: th.Tensor, shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """A saved tensor as an array, which shares its memory where that is the processor's.

    Raises:
        ValueError: If it is not finite, or of another shape or type.
    """
    is_alike = saved.shape == shape and saved.dtype == th.from_numpy(np.empty(0, dtype)).dtype
    if not is_alike or not th.isfinite(saved).all():
        raise ValueError(f"`{name}` must be finite, of shape {shape} and type {np.dtype(dtype)}.")
    array: Array = saved.detach().cpu().numpy()
    return array


def write_plain(path: str | os.PathLike[str], content: dict[str, Any], kind: str) -> None:
    """Write a file that appears only once it is whole, marked as one of a kind."""
    with atomic_file(path) as file:
        th.save({**content, "format": kind}, file)


def read_plain(path: str | os.PathLike[str], kind: str, *, what: str) -> dict[str, Any]:
    """Read a file of a kind, as it was written; errors call it `what`."""
    if not Path(path).is_file():
        raise FileNotFoundError(f"`path` must be a saved {what}, there is no file {path}.")
    try:  # torch's unpickler may fail at anything that is no whole zip
        is_whole = is_whole_zip(path)
        saved = th.load(path, map_location="cpu", weights_only=True) if is_whole else None
    except (zipfile.BadZipFile, OSError, RuntimeError, pickle.UnpicklingError):
        saved = None
    if not isinstance(saved, dict) or saved.get("format") != kind:
        raise ValueError(f"`path` must be a saved {what}, {path} is not a whole one.")
    return saved


def is_whole_zip(file: str | os.PathLike[str] | IO[bytes] | io.BufferedIOBase) -> bool:
    """Whether a zip, and each file of tensors in it, has all that it says, and no more than it is.

    Members are stored as they are: what unpacks to more than the file's own size is refused before
    it is read.

    Raises:
        zipfile.BadZipFile: If it is no zip at all.
    """
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        assert archive.fp is not None
        size = archive.fp.seek(0, io.SEEK_END)
        is_stored = all(member.compress_type == zipfile.ZIP_STORED for member in members)
        if not is_stored or sum(member.file_size for member in members) > size:
            return False
        if archive.testzip() is not None:
            return False
        inner = [archive.open(name) for name in archive.namelist() if name.endswith(".pth")]
        return all(map(is_whole_zip, filter(zipfile.is_zipfile, inner)))
