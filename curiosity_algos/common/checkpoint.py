"""Atomic files, and clear errors for files that are not ours."""

from __future__ import annotations

import io
import json
import os
import pathlib
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from io import BufferedWriter
from typing import Any

import numpy as np
import torch as th
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import save_to_zip_file

TRANSITIONS = {"buffer", "replay_buffer"}
"""Names to exclude what parts have collected, ours and Stable-Baselines3's."""


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Iterator[BufferedWriter]:
    """Open a file that takes `path`'s place only once it is wholly on disk.

    Whatever happens before, a full disk or a killed process, leaves the old file as it was.
    """
    target = pathlib.Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        with open(temporary, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    _sync_folder(target.parent)


def _sync_folder(folder: pathlib.Path) -> None:
    """Make the renaming itself survive a power cut, where the system can."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def checkpoint_path(path: str | os.PathLike[str]) -> pathlib.Path:
    """`path`, with SB3's suffix `.zip` where it has none."""
    path = pathlib.Path(path)
    return path if path.suffix else path.with_suffix(".zip")


def save_model(
    model: BaseAlgorithm,
    path: str | os.PathLike[str] | io.BufferedIOBase,
    exclude: Iterable[str] | None,
    include: Iterable[str] | None,
    **extra: Any,
) -> None:
    """Save a model as Stable-Baselines3 does, but in a file that appears only once it is whole.

    Args:
        model: What is saved: its attributes, and the state of the parts it names.
        path: Of the file, or a file object; `.zip` is added where it has no suffix.
        exclude: Attributes to leave out; "buffer" leaves out the transitions of the parts.
        include: Attributes to save although they are left out by default.
        **extra: Attributes that the file is to have, whatever the model has.

    Raises:
        OSError: If it cannot be written; an older file is then as it was.
        ValueError: If the state of a user's bonus could not be read back; likewise.
    """
    names = set(exclude or ()), set(include or ())
    if isinstance(path, io.BufferedIOBase):
        _write_model(model, path, *names, extra)
        return
    with atomic_file(checkpoint_path(path)) as file:
        _write_model(model, file, *names, extra)


def _write_model(
    model: BaseAlgorithm,
    file: io.BufferedIOBase,
    exclude: set[str],
    include: set[str],
    extra: dict[str, Any],
) -> None:
    parameters = model.get_parameters()
    check_plain(parameters, "bonus")  # all else that has a state is ours, or torch's
    parts = {name.partition(".")[0] for name in parameters}
    left_out = (exclude | set(model._excluded_save_params()) | parts) - include
    data = {key: value for key, value in model.__dict__.items() if key not in left_out}
    data |= extra
    data["algorithm"] = type(model).__name__  # tells a file's reader which class to load it with
    if exclude & TRANSITIONS:
        for state in parameters.values():
            # A user's bonus may have a tensor of that name.
            if isinstance(state.get("buffer"), dict):
                del state["buffer"]
    save_to_zip_file(file, data=data, params=parameters)


def is_plain(value: Any) -> bool:
    """Whether torch reads it back without running code: tensors and plain values."""
    if isinstance(value, Mapping):
        return all(map(is_plain, value.values()))
    if isinstance(value, list | tuple):
        return all(map(is_plain, value))
    is_leaf = isinstance(value, bool | int | float | str | th.Tensor) or value is None
    return is_leaf and not isinstance(value, np.generic)


def check_plain(state: Any, name: str) -> None:
    """Check that a file can hold the state of the argument `name`.

    Raises:
        ValueError: If it cannot.
    """
    if not is_plain(state):
        raise ValueError(f"`{name}` must have a state of tensors and plain values.")


def check_is_checkpoint(
    source: str | os.PathLike[str] | io.BufferedIOBase, algorithm: str
) -> pathlib.Path | io.BufferedIOBase:
    """Check that `source` is a whole model of `algorithm`, the name of a class of this package.

    Returns:
        What to read the model from: the file's path with its suffix, or the file object.

    Raises:
        FileNotFoundError: If there is no such file.
        ValueError: If it is truncated, foreign, or of another algorithm.
    """
    if isinstance(source, io.BufferedIOBase):
        file: pathlib.Path | io.BufferedIOBase = source
        begin = source.tell()
        found = _saved_algorithm(source)
        source.seek(begin)
    else:
        path = pathlib.Path(source)
        file = path = path if path.is_file() else checkpoint_path(source)
        if not path.is_file():
            raise FileNotFoundError(f"`path` must be a saved model, there is no file {path}.")
        found = _saved_algorithm(path)
    if found != algorithm:
        what = "not a whole file of this package" if found is None else f"one of {found}"
        raise ValueError(f"`path` must be a saved {algorithm}, {file} is {what}.")
    return file


def _saved_algorithm(file: pathlib.Path | io.BufferedIOBase) -> str | None:
    """Name of the class that the file holds, or None where it is damaged or foreign."""
    try:
        with zipfile.ZipFile(file) as archive:
            if archive.testzip() is not None:
                return None
            name = json.loads(archive.read("data")).get("algorithm")
    except (zipfile.BadZipFile, AttributeError, EOFError, KeyError, OSError, ValueError):
        return None
    return name if isinstance(name, str) else None
