"""The rows of `progress.csv`: the run's own, whoever else uses its logger."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from stable_baselines3.common.logger import KVWriter, filter_excluded_keys

from curiosity_algos.experiments.reading import parse_rows, read_texts
from curiosity_algos.state.atomic_file import atomic_file
from curiosity_algos.state.settings import python_number

TIMESTEPS, SECONDS = "time/total_timesteps", "time/seconds"
"""Columns of the time at which a row was logged."""
OWN = "time/fps"
"""Column that the algorithm records at each log, and callbacks never do."""

Row: TypeAlias = Mapping[str, Any]


def in_order(names: Iterable[str]) -> list[str]:
    """Columns in the order of every file: the time, and then the alphabet."""
    return sorted(set(names), key=lambda name: (name != TIMESTEPS, name != SECONDS, name))


def _writable(value: Any) -> Any:
    """A value as a row has it; a carriage return would end the row."""
    return re.sub("\r\n?", "\n", value) if isinstance(value, str) else python_number(value)


class ProgressLog(KVWriter):
    """Writes a row whenever the algorithm logs, and one when training ends.

    Timesteps, seconds and coverage are the run's own. What another callback, such as an
    `EvalCallback`, dumps in between is in the next row. The order of columns does not depend on
    when they first appear. No file is open between two rows.

    Args:
        path: File to write.
        timesteps: Rows that were logged later are dropped.
        state: Returns timesteps, seconds and coverage of the run, by column.
    """

    def __init__(self, path: Path, timesteps: int, state: Callable[[], dict[str, float]]) -> None:
        texts = read_texts(path)
        rows = parse_rows(texts, path)
        late = [i for i, row in enumerate(rows) if float(row.get(TIMESTEPS, 0)) > timesteps]
        texts = texts[: late[0]] if late else texts
        self.pending: dict[str, Any] = {}
        self._path = path
        self._state = state
        self._last: Row = rows[len(texts) - 1] if texts else {}
        self._names = in_order(name for row in texts for name in row)
        self._write_all(texts)

    def write(
        self, key_values: Row, key_excluded: Mapping[str, tuple[str, ...]], step: int = 0
    ) -> None:
        """Store what the logger dumps; write a row if the algorithm logs."""
        self.pending |= filter_excluded_keys(dict(key_values), dict(key_excluded), "csv")
        if OWN in key_values:
            self._add_row()

    def end(self, recorded: Row) -> None:
        """Write the last row, with what was recorded since, unless it is written."""
        state = {name: value for name, value in self._state().items() if name != SECONDS}
        if any(self._last.get(name) != value for name, value in state.items()):
            self.pending |= recorded
            self._add_row()

    def _add_row(self) -> None:
        loggable = (bool, int, float, str, np.number, np.bool_)  # no pictures, no videos
        row = {
            k: _writable(value) for k, value in self.pending.items() if isinstance(value, loggable)
        }
        self._last = row | self._state()
        self.pending = {}
        names = in_order([*self._names, *self._last])
        if names != self._names:
            self._names = names
            self._write_all([*read_texts(self._path), self._last])
        else:
            with open(self._path, "a", encoding="utf-8", newline="") as file:
                file.write(self._as_text([self._last]))

    def _write_all(self, rows: Iterable[Row]) -> None:
        header = self._as_text([dict(zip(self._names, self._names, strict=True))])
        with atomic_file(self._path) as file:
            file.write((header + self._as_text(rows)).encode() if self._names else b"")

    def _as_text(self, rows: Iterable[Row]) -> str:
        text = io.StringIO()
        lines = csv.writer(text, lineterminator="\n")
        lines.writerows([str(row.get(name, "")) for name in self._names] for row in rows)
        return text.getvalue()

    def close(self) -> None:
        """Do nothing: no file is open."""
