"""The files of a run, which numpy, pandas and any reader of JSON and CSV can open.

    run.json            what the run is: algorithm, environment, every setting, versions, machine
    progress.csv        a row for each log
    final_states/*.npz  of each individual its generation, return, length, success, curiosity and
                        the behavior that its episode ended with
    checkpoints/N/      after N timesteps: model.zip, result.json, rewarding.npz, best_policy.npz
    best_trajectory.npz an episode of the best policy

Nothing that is written is written again but `progress.csv`, where a new column appears. A
checkpoint appears at once and whole, and what was written after the last one is dropped when a run
goes on from there. One process at a time trains in a folder: it holds `lock`.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
from stable_baselines3.common.logger import CSVOutputFormat

from curiosity_algos.checkpoints.atomic_file import atomic_file
from curiosity_algos.experiments.locks import lock_file

FORMAT = 1
TIMESTEPS = "time/total_timesteps"
"""The column of `progress.csv` that says when a row was logged."""


class RunFolder:
    """Where the files of one run are.

    Args:
        path: Of the folder; it need not be there yet.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.progress = self.path / "progress.csv"
        self.best_trajectory = self.path / "best_trajectory.npz"
        self._description = self.path / "run.json"
        self._final_states = self.path / "final_states"
        self._checkpoints = self.path / "checkpoints"
        self._lock = self.path / "lock"

    def is_empty(self) -> bool:
        """Whether a run can begin here."""
        return not self.path.exists() or all(path == self._lock for path in self.path.iterdir())

    def lock(self) -> BinaryIO:
        """Hold the folder until the file that this gives is closed, or its process ends.

        Raises:
            ValueError: If another process trains in the folder.
        """
        self.path.mkdir(parents=True, exist_ok=True)
        file = open(self._lock, "ab")  # noqa: SIM115  whoever asked closes it
        try:
            lock_file(file)
        except OSError as error:
            file.close()
            raise ValueError(f"`folder` must not be at work: {self.path} is.") from error
        return file

    # -- what the run is ------------------------------------------------------------------------

    def begin(self, description: Mapping[str, Any]) -> None:
        """Write what the run is."""
        with atomic_file(self._description) as file:
            file.write(json.dumps({"format": FORMAT, **description}, indent=2).encode())

    def describe(self) -> dict[str, Any]:
        """What the run is.

        Raises:
            FileNotFoundError: If there is no run here.
            ValueError: If it was written in another format, or its description is damaged.
        """
        if not self._description.is_file():
            raise FileNotFoundError(
                f"`folder` must be that of a run, there is none in {self.path}."
            )
        try:
            described = json.loads(self._description.read_text())
        except ValueError:
            described = None
        if not isinstance(described, dict) or not described.keys() >= {
            "format",
            "algorithm",
            "env",
        }:
            raise ValueError(f"`folder` must be that of a run, {self._description} is damaged.")
        if described.pop("format") != FORMAT:
            raise ValueError(
                f"`folder` must hold a run of format {FORMAT}, {self.path} was written by another "
                "version of curiosity-search."
            )
        return described

    # -- checkpoints ----------------------------------------------------------------------------

    @property
    def checkpoint(self) -> Path | None:
        """The folder of the last checkpoint, or None before the first."""
        return max(self._all_checkpoints(), default=None, key=lambda path: int(path.name))

    def _all_checkpoints(self) -> list[Path]:
        if not self._checkpoints.is_dir():
            return []
        return [path for path in self._checkpoints.iterdir() if path.name.isdecimal()]

    def commit(self, timesteps: int, write: Callable[[Path], None]) -> None:
        """Replace the last checkpoint by one that `write` fills a folder with."""
        older = self._all_checkpoints()
        target = self._checkpoints / f"{timesteps}"
        if target in older:
            return
        unfinished = self._checkpoints / "unfinished"
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir(parents=True)
        write(unfinished)
        os.replace(unfinished, target)
        for path in older:
            shutil.rmtree(path)

    def result(self) -> dict[str, Any]:
        """What the run has come to at its last checkpoint; empty before the first."""
        if self.checkpoint is None:
            return {}
        path = self.checkpoint / "result.json"
        try:
            result: dict[str, Any] = json.loads(path.read_text())
        except (OSError, ValueError) as error:
            raise ValueError(f"`folder` must be that of a run, {path} is damaged.") from error
        return result

    # -- final states ---------------------------------------------------------------------------

    def add_final_states(self, first: int, columns: Mapping[str, npt.NDArray[Any]]) -> None:
        """Write those of the episodes from number `first` on."""
        write_arrays(self._final_states / f"{first:010}.npz", columns)

    def final_states(self) -> dict[str, npt.NDArray[Any]]:
        """Every column with an entry for each episode; empty before the first checkpoint."""
        parts = [_read_arrays(path) for path in self._final_state_files()]
        return {name: np.concatenate([part[name] for part in parts]) for name in (parts or [{}])[0]}

    def _final_state_files(self) -> list[Path]:
        return sorted(self._final_states.glob("[0-9]*.npz"))

    # -- the best policy's episode --------------------------------------------------------------

    def trajectory(self) -> dict[str, npt.NDArray[Any]]:
        """Every column of `best_trajectory.npz`; empty before `learn` has ended.

        Raises:
            ValueError: If the file is damaged.
        """
        return _read_arrays(self.best_trajectory) if self.best_trajectory.is_file() else {}

    # -- going on -------------------------------------------------------------------------------

    def drop_after(self, n_episodes: int) -> None:
        """Remove final states that were written after the last checkpoint."""
        for path in self._final_state_files():
            if int(path.stem) >= n_episodes:
                path.unlink()

    def open_progress(self, timesteps: int) -> CSVOutputFormat:
        """The log, its rows up to `timesteps` kept."""
        rows = read_rows(self.progress)
        late = [i for i, row in enumerate(rows) if float(row.get(TIMESTEPS, 0)) > timesteps]
        rows = rows[: late[0]] if late else rows
        unfinished = self.progress.with_name("progress.csv.unfinished")
        log = CSVOutputFormat(str(unfinished))
        for row in rows:
            log.write(row, dict.fromkeys(row, ()))
        os.replace(unfinished, self.progress)
        return log


def write_arrays(path: Path, arrays: Mapping[str, Any]) -> None:
    """Write a file for `numpy.load` that appears only once it is whole."""
    with atomic_file(path) as file:
        np.savez(file, **arrays)


def _read_arrays(path: Path) -> dict[str, npt.NDArray[Any]]:
    try:
        return dict(np.load(path))
    except (OSError, EOFError, ValueError, zipfile.BadZipFile) as error:
        raise ValueError(f"`folder` must be that of a run, {path} is damaged.") from error


def read_rows(path: Path) -> list[dict[str, float | str]]:
    """The rows of a log without empty entries, numbers and text; none where there is no file.

    Raises:
        ValueError: If the file is damaged.
    """
    try:
        lines = path.read_text().splitlines(keepends=True) if path.is_file() else []
        whole = [line for line in lines if line.endswith("\n")]  # a kill may leave half of the last
        rows = list(csv.DictReader(whole))
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"`folder` must be that of a run, {path} is damaged.") from error
    return [{k: _number(v) for k, v in row.items() if v} for row in rows]


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
