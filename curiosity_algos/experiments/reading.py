"""Reading the files of a run. A damaged file raises a ValueError of one sentence."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from types import UnionType
from typing import Any

import numpy as np
import pandas as pd

from curiosity_algos.common.arrays import Array

Columns = dict[str, Array]
JsonTypes = Mapping[str, type | UnionType]

DESCRIPTION: JsonTypes = {"format": int, "algorithm": str}
"""Types of fields that `run.json` must have."""
RESULT: JsonTypes = {
    **dict.fromkeys(("timesteps", "total_timesteps", "n_episodes"), int),
    "best_return": float | int | None,
    "first_success_timesteps": int | None,
    "seconds": float,
    **dict.fromkeys(("coverage", "pending_log"), dict),
    "ended": bool,
}
"""The same of `result.json`."""
FINAL_STATES = {"generation": 1, "timesteps": 1, "return": 1, "behavior": 2}
"""Dimensions of the columns of final states."""
REWARDING = {"return": 1, "generation": 1, "episode_seed": 1, "n_seen": 0}
"""Dimensions of the arrays of `rewarding.npz` and `sample.npz`."""


def damaged(path: Path) -> ValueError:
    """The error of a file that no run wrote in this form."""
    return ValueError(f"`folder` must be that of a run, {path} is damaged.")


def _check_no_pipe(path: Path) -> None:
    """Raise the error of a damaged file for a pipe, which would be waited for."""
    if path.exists() and not path.is_file():
        raise damaged(path)


def read_json(path: Path, types: JsonTypes) -> dict[str, Any]:
    """A dictionary with fields of these types."""
    _check_no_pipe(path)
    try:
        fields: dict[str, Any] = json.loads(path.read_text())
        is_valid = all(isinstance(fields[name], kind) for name, kind in types.items())
    except (OSError, ValueError, LookupError, TypeError, RecursionError) as error:
        raise damaged(path) from error
    if not is_valid:
        raise damaged(path)
    return fields


def read_arrays(path: Path, dimensions: Mapping[str, int]) -> Columns:
    """The arrays of a file, which must have numeric ones of these dimensions."""
    _check_no_pipe(path)
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
    _check_no_pipe(path)
    try:
        content = path.read_bytes() if path.exists() else b""
        whole = content[: content.rfind(b"\n") + 1]  # a kill may leave half a row
        if not whole:
            return pd.DataFrame()
        return pd.read_csv(io.BytesIO(whole), dtype=str, keep_default_na=False)
    except (OSError, ValueError) as error:
        raise damaged(path) from error
