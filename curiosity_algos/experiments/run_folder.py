"""The files of a run. numpy, pandas and any reader of JSON and CSV can open them.

    run.json            what the run is: algorithm, environment, every setting, versions, machine
    progress.csv        a row for each log
    final_states/*.npz  of each episode its generation, return, length, success, curiosity and the
                        behavior at its end
    checkpoints/N/      after N timesteps: model.zip, result.json, rewarding.npz, sample.npz,
                        best_policy.npz
    error.txt           the traceback of the error that ended the last training by the command
    demonstrations.npz  the episodes that a run of `curiosity robustify` begins along

No file is written twice, but `progress.csv` when a new column appears. A checkpoint appears at once
and whole. A run that goes on from it drops what was written later. One process and thread at a time
trains in a folder and locks `lock`. A damaged file raises a ValueError of one sentence.
"""

from __future__ import annotations

import io
import json
import math
import os
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from threading import Thread, current_thread
from types import UnionType
from typing import Any, TypeVar
from weakref import WeakValueDictionary

import numpy as np
import pandas as pd
from filelock import FileLock, Timeout

from curiosity_algos.common.arrays import Array
from curiosity_algos.state.atomic_file import atomic_file, sync_folder

Columns = dict[str, Array]
JsonTypes = Mapping[str, type | UnionType]

DESCRIPTION: JsonTypes = {
    **{"format": int, "algorithm": str, "seed": int | None},
    **dict.fromkeys(("env", "env_class"), str | None),
    **dict.fromkeys(("archive", "vec_env"), dict | None),
    "behavior_names": list | None,
}
"""Types of the fields of `run.json` that are read; those of None may be missing."""
RESULT: JsonTypes = {
    **dict.fromkeys(("timesteps", "total_timesteps", "n_episodes"), int),
    "best_return": float | int | None,
    **dict.fromkeys(("first_reward_timesteps", "first_success_timesteps"), int | None),
    "seconds": float,
    **dict.fromkeys(("coverage", "pending_log"), dict),
    "starts": dict | None,
    "ended": bool,
}
"""The same of `result.json`."""
FINAL_STATES = {"generation": 1, "timesteps": 1, "return": 1, "behavior": 2}
"""Dimensions of the columns of final states."""
REWARDING = {"return": 1, "generation": 1, "episode_seed": 1, "n_seen": 0}
"""Dimensions of the arrays of `rewarding.npz` and `sample.npz`."""
LARGEST = 2**63
"""Bound of the whole numbers of `result.json`, as of numpy's."""
RUN_FORMAT = 1
_LOCKS: WeakValueDictionary[tuple[Path, Thread], FileLock] = WeakValueDictionary()
"""The locks of this process, by folder and thread."""
_Read = TypeVar("_Read")


class RunFolder:
    """The files of one run.

    Args:
        path: Path of the folder, which need not exist yet.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.progress = self.path / "progress.csv"
        self.error = self.path / "error.txt"
        self.demonstrations = self.path / "demonstrations.npz"
        self._description = self.path / "run.json"
        self._final_states = self.path / "final_states"
        self._checkpoints = self.path / "checkpoints"
        self._lock = self.path / "lock"

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.path}>"

    def is_empty(self) -> bool:
        """Whether a run can begin here; what is there before its first file does not count."""
        paths = self.path.iterdir() if self.path.exists() else ()
        half = tuple(f".{path.name}." for path in (self._description, self.demonstrations))
        ignored = self._lock, self.error, self.demonstrations
        return all(path in ignored or path.name.startswith(half) for path in paths)

    def lock(self) -> FileLock:
        """Lock the folder until `release`, or until the lock or the process is gone.

        A thread takes over its own lock and those of threads that have ended: in a notebook the
        traceback of a failed training still refers to its lock.

        Raises:
            ValueError: If another process or thread trains in the folder, or it cannot be locked.
        """
        path, here = self.path.resolve(), current_thread()
        for (locked, thread), lock in list(_LOCKS.items()):
            if locked == path and (thread is here or not thread.is_alive()):
                lock.release()
        # A soft lock would outlive a process that is killed.
        lock = FileLock(self._lock, timeout=0, thread_local=False, fallback_to_soft=False)
        try:
            path.mkdir(parents=True, exist_ok=True)
            lock.acquire()
        except Timeout as error:
            raise ValueError(f"`folder` must not be at work: {self.path} is.") from error
        except OSError as error:
            raise ValueError(
                f"`folder` must be writable, on a file system with locks: {self.path} ({error})."
            ) from error
        _LOCKS[path, here] = lock
        return lock

    def begin(self, description: Mapping[str, Any]) -> None:
        """Write the description of the run."""
        write_json(self._description, {"format": RUN_FORMAT, **description})

    def describe(self) -> dict[str, Any]:
        """The fields of `run.json`, without its format.

        Raises:
            FileNotFoundError: If there is no run here.
            ValueError: If it was written in another format, or its description is damaged.
        """
        if not self._description.exists():
            raise FileNotFoundError(
                f"`folder` must be that of a run, there is none in {self.path}."
            )
        described = read_json(self._description, DESCRIPTION)
        if described.pop("format") != RUN_FORMAT:
            raise ValueError(
                f"`folder` must hold a run of format {RUN_FORMAT}, {self.path} was written by "
                "another version of curiosity-search."
            )
        return described

    @property
    def checkpoint(self) -> Path | None:
        """The folder of the last checkpoint, or None before the first."""
        return max(self._all_checkpoints(), default=None, key=lambda path: int(path.name))

    def read(self, read: Callable[[Path], _Read]) -> _Read:
        """What a function returns for the folder of the last checkpoint.

        If training replaces the checkpoint meanwhile, the function reads the next one.

        Raises:
            ValueError: If there is no checkpoint yet.
        """
        while True:
            checkpoint = self.checkpoint
            if checkpoint is None:
                raise ValueError(f"`run` must have a checkpoint: {self.path} has none yet.")
            try:
                return read(checkpoint)
            except Exception:  # whatever a reader makes of files that vanish
                if self.checkpoint == checkpoint:
                    raise

    def _all_checkpoints(self) -> list[Path]:
        _check_kind(self._checkpoints, is_folder=True)
        return [path for path in self._checkpoints.glob("*") if path.name.isdecimal()]

    def commit(self, timesteps: int, write: Callable[[Path], None]) -> None:
        """Replace the last checkpoint by a new one, whose folder `write` fills."""
        older = self._all_checkpoints()
        target = self._checkpoints / f"{timesteps}"
        if target in older:
            return
        unfinished = self._checkpoints / "unfinished"
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir(parents=True)
        write(unfinished)
        os.replace(unfinished, target)
        sync_folder(self._checkpoints)
        for path in older:  # the next commit removes what cannot be removed while it is read
            shutil.rmtree(path, ignore_errors=True)

    def result(self) -> dict[str, Any]:
        """The fields of `result.json` in the last checkpoint; empty before the first."""
        if self.checkpoint is None:
            return {}
        return self.read(lambda checkpoint: _read_result(checkpoint / "result.json"))

    def note(self, **fields: Any) -> None:
        """Add fields to the result of the last checkpoint."""
        assert self.checkpoint is not None
        write_json(self.checkpoint / "result.json", self.result() | fields)

    def add_final_states(self, first: int, columns: Mapping[str, Array]) -> None:
        """Write the final states of episodes; `first` is the number of the first episode."""
        write_arrays(self._final_states / f"{first:010}.npz", columns)

    def n_entries(self) -> int | None:
        """Number of entries of a behavior; None without final states."""
        newest = read_final_states(self.final_state_files()[-1:])
        return newest["behavior"].shape[1] if newest else None

    def final_state_files(self) -> list[Path]:
        """The files of final states, in the order of episodes."""
        _check_kind(self._final_states, is_folder=True)
        files = self._final_states.glob("*.npz")
        return sorted(path for path in files if path.stem.isdecimal())

    def drop_after(self, n_episodes: int) -> None:
        """Remove final states that were written after the last checkpoint."""
        for path in self.final_state_files():
            if int(path.stem) >= n_episodes:
                path.unlink()


def write_json(path: Path, fields: Mapping[str, Any]) -> None:
    """Write a file of JSON, which appears once it is whole."""
    with atomic_file(path) as file:
        file.write(json.dumps(fields, indent=2).encode())


def write_arrays(path: Path, arrays: Mapping[str, Any]) -> None:
    """Write a file for `numpy.load`, which appears once it is whole."""
    with atomic_file(path) as file:
        np.savez(file, **arrays)


def damaged(path: Path) -> ValueError:
    """The error of a file that no run wrote in this form."""
    return ValueError(f"`folder` must be that of a run, {path} is damaged.")


def _check_kind(path: Path, *, is_folder: bool = False) -> None:
    """Raise the error of a damaged file for a folder in its place, or a pipe, which would wait."""
    if path.exists() and not (path.is_dir() if is_folder else path.is_file()):
        raise damaged(path)


def read_json(path: Path, types: JsonTypes) -> dict[str, Any]:
    """A dictionary with fields of these types."""
    _check_kind(path)
    try:
        fields: dict[str, Any] = json.loads(path.read_text())
        is_valid = all(isinstance(fields.get(name), kind) for name, kind in types.items())
    except (OSError, ValueError, AttributeError, RecursionError) as error:
        raise damaged(path) from error
    if not is_valid:
        raise damaged(path)
    return fields


def _read_result(path: Path) -> dict[str, Any]:
    """The fields of a `result.json`, whose numbers and shares are in their ranges."""
    result = read_json(path, RESULT)
    shares, logged = result["coverage"].values(), result["pending_log"].values()
    is_valid = (
        all(_is_bounded(value) for value in result.values() if isinstance(value, int | float))
        and all(isinstance(share, int | float) and 0.0 <= share <= 1.0 for share in shares)
        and all(isinstance(pair, list) and len(pair) == 2 for pair in logged)
    )
    if not is_valid:
        raise damaged(path)
    return result


def _is_bounded(number: float) -> bool:
    return math.isfinite(number) if isinstance(number, float) else abs(number) < LARGEST


def read_arrays(path: Path, dimensions: Mapping[str, int]) -> Columns:
    """The arrays of a file, which must have numeric ones of these dimensions."""
    _check_kind(path)
    try:
        with np.load(path) as file:
            arrays = dict(file)
    except Exception as error:  # whatever numpy, zipfile and zlib make of it
        raise damaged(path) from error
    numeric = {name: array.ndim for name, array in arrays.items() if array.dtype.kind in "biuf"}
    if not numeric.items() >= dimensions.items():
        raise damaged(path)
    return arrays


def read_final_states(paths: list[Path]) -> Columns:
    """The columns of several files, one after another."""
    parts: list[Columns] = []
    shapes: set[tuple[tuple[str, tuple[int, ...]], ...]] = set()
    for path in paths:
        part = read_arrays(path, FINAL_STATES)
        shapes.add(tuple((name, part[name].shape[1:]) for name in sorted(part)))
        if len(shapes) > 1 or len({column.shape[:1] for column in part.values()}) > 1:
            raise damaged(path)
        parts.append(part)
    return {name: np.concatenate([part[name] for part in parts]) for name in (parts or [{}])[0]}


def read_log(path: Path) -> pd.DataFrame:
    """The whole rows of a log as text; none if there is no file."""
    _check_kind(path)
    try:
        content = path.read_bytes() if path.exists() else b""
        whole = content[: content.rfind(b"\n") + 1]  # a kill may leave half a row
        if not whole:
            return pd.DataFrame()
        return pd.read_csv(io.BytesIO(whole), dtype=str, keep_default_na=False)
    except (OSError, ValueError) as error:
        raise damaged(path) from error
