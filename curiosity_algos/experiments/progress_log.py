"""The rows of `progress.csv`: the run's own, whoever else uses its logger."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from stable_baselines3.common.logger import KVWriter, filter_excluded_keys

from curiosity_algos.experiments.run_folder import read_log
from curiosity_algos.state.atomic_file import atomic_file
from curiosity_algos.state.settings import python_number

TIMESTEPS, SECONDS = "time/total_timesteps", "time/seconds"
"""Columns of the time at which a row was logged."""
OWN = "time/fps"
"""Column that the algorithm records at each log, and callbacks never do."""

Row = Mapping[str, str]


def _in_order(names: Iterable[str]) -> list[str]:
    """Columns in the order of every file: the time, and then the alphabet."""
    return sorted(set(names), key=lambda name: (name != TIMESTEPS, name != SECONDS, name))


def _texts(values: Mapping[str, Any]) -> dict[str, str]:
    """Numbers and texts, in one line each, without pictures and videos."""
    loggable = (bool, int, float, str, np.number, np.bool_)
    return {
        name: " ".join(str(python_number(value)).splitlines())
        for name, value in values.items()
        if isinstance(value, loggable)
    }


class ProgressLog(KVWriter):
    """Writes a row whenever the algorithm logs, and one when training ends.

    Timesteps, seconds and coverage are the run's own. What another callback, such as an
    `EvalCallback`, dumps in between is in the next row. The order of columns does not depend on
    when they first appear. No file is open between two rows.
    Rows after `timesteps` are dropped.
    """

    def __init__(self, path: Path, timesteps: int, state: Callable[[], dict[str, float]]) -> None:
        self.pending: dict[str, Any] = {}
        self._path = path
        self._state = state
        rows = read_log(path)
        if len(rows):
            rows = rows[pd.to_numeric(rows[TIMESTEPS], errors="coerce") <= timesteps]
        self._last: Row = dict(rows.iloc[-1]) if len(rows) else {}
        self._names = _in_order(rows.columns[(rows != "").any()])
        self._write_all(rows.to_dict("records"))

    def write(
        self,
        key_values: Mapping[str, Any],
        key_excluded: Mapping[str, tuple[str, ...]],
        step: int = 0,
    ) -> None:
        """Store what the logger dumps; write a row if the algorithm logs."""
        self.pending |= filter_excluded_keys(dict(key_values), dict(key_excluded), "csv")
        if OWN in key_values:
            self._add_row()

    def end(self, recorded: Mapping[str, Any]) -> None:
        """Write the last row, with what was recorded since, unless it is written."""
        state = _texts({name: value for name, value in self._state().items() if name != SECONDS})
        if not state.items() <= dict(self._last).items():
            self.pending |= recorded
            self._add_row()

    def _add_row(self) -> None:
        self._last = _texts(self.pending | self._state())
        self.pending = {}
        names = _in_order([*self._names, *self._last])
        if names != self._names:
            self._names = names
            self._write_all([*read_log(self._path).to_dict("records"), self._last])
        else:
            with open(self._path, "a", encoding="utf-8", newline="") as file:
                file.write(self._as_text([self._last]))

    def _write_all(self, rows: Iterable[Any]) -> None:
        header = dict(zip(self._names, self._names, strict=True))
        with atomic_file(self._path) as file:
            file.write(self._as_text([header, *rows]).encode() if self._names else b"")

    def _as_text(self, rows: Iterable[Row]) -> str:
        text = io.StringIO()
        lines = csv.writer(text, lineterminator="\n")
        lines.writerows([row.get(name, "") for name in self._names] for row in rows)
        return text.getvalue()

    def close(self) -> None:
        """Do nothing: no file is open."""
