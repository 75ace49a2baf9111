"""The file of whatever has settings and a state: arrays, and one entry of JSON.

It is an `.npz`: `numpy.load(path)["policy/flat"]` is the array at `state["policy"]["flat"]`. Its
entry `about.json` holds the kind, the settings, and the state's tree with the names of its arrays.
"""

from __future__ import annotations

import io
import json
import math
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np

from curiosity_algos.common.arrays import Array
from curiosity_algos.state.atomic_file import atomic_file
from curiosity_algos.state.tree import NUMBERS, Arrays, State, decode, encode

ABOUT = "about.json"

StateFile = str | os.PathLike[str] | io.BufferedIOBase
"""A path, or an open file."""


def save(file: StateFile, kind: str, settings: Mapping[str, Any], state: State) -> None:
    """Write the settings and the state, both trees, of a kind of thing such as a class.

    A file at a path appears only once it is wholly on disk.

    Raises:
        ValueError: If a tree holds something else; nothing is written then.
        OSError: If it cannot be written; an older file is then as it was.
    """
    arrays: Arrays = {}
    trees = {"settings": encode(settings, arrays, "settings"), "state": encode(state, arrays)}
    about = json.dumps({"kind": kind, **trees})
    if isinstance(file, io.BufferedIOBase):
        _write(file, about, arrays)
        return
    with atomic_file(file) as opened:
        _write(opened, about, arrays)


def _write(file: IO[bytes] | io.BufferedIOBase, about: str, arrays: Arrays) -> None:
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(zipfile.ZipInfo(ABOUT), about)
        for name, array in arrays.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, version=(1, 0), allow_pickle=False)


def read(file: StateFile, kind: str) -> tuple[dict[str, Any], State]:
    """Settings and state that `save` wrote; no code in the file runs.

    Raises:
        FileNotFoundError: If there is no such file.
        ValueError: If it is no whole file of this kind.
    """
    if not isinstance(file, io.BufferedIOBase) and not Path(file).is_file():
        raise FileNotFoundError(f"`path` must be a saved {kind}, there is no file {file}.")
    try:
        about, arrays = _members(file)
        written = about["kind"]
        settings, state = decode(about["settings"], arrays), decode(about["state"], arrays)
        if arrays or not (isinstance(settings, dict) and isinstance(state, dict)):
            raise ValueError("It has more, or less, than settings and state.")
    except Exception as error:  # zip files, JSON and arrays fail in more ways than can be named
        raise ValueError(f"`path` must be a saved {kind}, {file} is not a whole one.") from error
    if written != kind:
        raise ValueError(f"`path` must be a saved {kind}, {file} is one of {written!r:.60}.")
    return settings, state


def _members(file: StateFile) -> tuple[Any, Arrays]:
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        assert archive.fp is not None
        size = archive.fp.seek(0, io.SEEK_END)
        if sum(member.file_size for member in members) > size:  # before any is unpacked
            raise ValueError("It unpacks to more than it is.")
        arrays = {m.filename: archive.read(m) for m in members}  # checks their sums
    about = json.loads(arrays.pop(ABOUT))
    return about, {name.removesuffix(".npy"): _array(content) for name, content in arrays.items()}


def _array(content: bytes) -> Array:
    """The array of a `.npy` file; no more memory is taken than that has bytes."""
    stream = io.BytesIO(content)
    if np.lib.format.read_magic(stream) != (1, 0):
        raise ValueError("It has arrays of another version of numpy's format.")
    shape, _, dtype = np.lib.format.read_array_header_1_0(stream)
    n_bytes = math.prod(shape) * dtype.itemsize
    if dtype.kind not in NUMBERS or n_bytes != len(content) - stream.tell():
        raise ValueError(f"It has an array of {dtype} and {shape} in {len(content)} bytes.")
    stream.seek(0)
    array: Array = np.lib.format.read_array(stream, allow_pickle=False)
    return array.astype(dtype.newbyteorder("="), copy=False)
