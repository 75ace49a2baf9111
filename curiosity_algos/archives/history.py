"""The statistics of an archive, generation by generation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from ribs.archives import ArchiveStats

from curiosity_algos.common.arrays import Float64Array
from curiosity_algos.state.check import check_like
from curiosity_gym.validation import check_choice

COLUMNS = ("timesteps", "size", "coverage", "qd_score", "best")


class ArchiveHistory:
    """The statistics of an archive after each generation.

    Columns: `timesteps` of all generations so far, `size` (elites), `coverage` (share of the cells
    that are taken; 1 where there are none), `qd_score` (sum of the objectives), `best` (objective).
    """

    def __init__(self) -> None:
        self._rows: list[list[float]] = []

    def record(self, timesteps: int, stats: ArchiveStats) -> None:
        """Append the statistics of an archive after a generation of `timesteps`."""
        before = self._rows[-1][0] if self._rows else 0.0
        values = before + timesteps, stats.num_elites, stats.coverage, stats.qd_score, stats.obj_max
        self._rows.append(np.array(values, dtype=np.float64).tolist())

    def __getitem__(self, column: str) -> Float64Array:
        """A column, one value for each generation; ValueError if there is no such column."""
        check_choice(COLUMNS, column=column)
        return self._table()[:, COLUMNS.index(column)]

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {len(self):,} generations of {', '.join(COLUMNS)}>"

    def __len__(self) -> int:
        """Number of generations."""
        return len(self._rows)

    def _table(self) -> Float64Array:
        return np.array(self._rows, dtype=np.float64).reshape(-1, len(COLUMNS))

    def state_dict(self) -> dict[str, Any]:
        """All rows."""
        return {"table": self._table()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError for what that cannot give."""
        known = np.full((0, len(COLUMNS)), np.nan)
        check_like({"table": state["table"][:, :-1]}, {"table": known[:, :-1]}, "history")
        self._rows = state["table"].tolist()
