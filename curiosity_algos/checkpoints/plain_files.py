"""Numbers and tensors in files: which may be there, and whether they are as expected."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import numpy.typing as npt
import torch as th

from curiosity_algos.common.arrays import Array
from curiosity_algos.state.file import read, save
from curiosity_algos.state.settings import python_number as plain
from curiosity_algos.state.tree import encode

__all__ = ["check_plain", "fitting", "plain", "read_plain", "write_plain"]


def check_plain(state: Any, name: str) -> None:
    """Raise ValueError unless a file can hold the state of the argument `name`."""
    try:
        encode(state, {}, name)
    except ValueError as error:
        raise ValueError(f"`{name}` must have a state that a file can hold. {error}") from error


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
    save(path, kind, {}, content)


def read_plain(path: str | os.PathLike[str], kind: str, *, what: str) -> dict[str, Any]:
    """Read a file of a kind, as it was written."""
    return read(path, kind)[1]
