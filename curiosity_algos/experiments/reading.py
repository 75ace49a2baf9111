"""Reading the files of a run. A damaged file raises a ValueError of one sentence."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping
from pathlib import Path
from types import UnionType
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Array

JsonTypes = Mapping[str, type | UnionType]
Columns = dict[str, Array]

DESCRIPTION: JsonTypes = {
    "format": int,
    "algorithm": str,
    "env": str | None,
    "env_class?": str | None,
    "env_spec?": dict | None,
    "env_unknown?": str | None,
    "env_kwargs?": dict,
    "wrappers?": dict,
    "behavior_names?": list | None,
    "seed?": int | None,
    "settings?": dict,
    "archive?": dict | None,
}
"""Types of the fields of `run.json`; those with a question mark may be missing."""
RESULT: JsonTypes = {
    "timesteps": int,
    "total_timesteps": int,
    "n_episodes": int,
    "best_return": float | int | None,
    "first_reward_timesteps?": int | None,
    "first_success_timesteps": int | None,
    "coverage": dict,
    "seconds": float | int,
    "pending_log": dict,
    "ended": bool,
}
"""Types of the fields of `result.json`."""
FINAL_STATES = {"generation": 1, "timesteps": 1, "return": 1, "behavior": 2}
"""Dimensions of the columns of final states."""
REWARDING = {"return": 1, "generation": 1, "episode_seed": 1, "n_seen": 0}
"""Dimensions of the arrays of `rewarding.npz` and `sample.npz`."""
LARGEST = 2**63
"""Bound of the numbers of `result.json`, as of numpy's integers."""
NUMERIC = ("time/", "coverage/", "archive/qd_score", "archive/size")
"""Beginnings of the columns of `progress.csv` that must hold finite numbers."""


def damaged(path: Path) -> ValueError:
    """The error of a file that no run has written so."""
    return ValueError(f"`folder` must be that of a run, {path} is damaged.")


def check_kind(path: Path, *, is_folder: bool = False) -> None:
    """Raise the error of a damaged file if a path is not a file, or not a folder, but exists.

    A pipe would be waited for.
    """
    if path.exists() and not (path.is_dir() if is_folder else path.is_file()):
        raise damaged(path)


def read_json(path: Path, types: JsonTypes) -> dict[str, Any]:
    """A dictionary with fields of these types."""
    check_kind(path)
    try:
        fields = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise damaged(path) from error
    if not isinstance(fields, dict) or not all(_has(fields, *item) for item in types.items()):
        raise damaged(path)
    return fields


def _has(fields: dict[str, Any], name: str, kind: type | UnionType) -> bool:
    key = name.removesuffix("?")
    return isinstance(fields[key], kind) if key in fields else key != name


def read_result(path: Path) -> dict[str, Any]:
    """The fields of a `result.json`, with numbers and shares in their ranges."""
    result = read_json(path, RESULT)
    shares, logged = result["coverage"].values(), result["pending_log"].values()
    numbers = [*shares, *(value for value in result.values() if isinstance(value, int | float))]
    is_valid = (
        all(isinstance(number, int | float) and abs(number) < LARGEST for number in numbers)
        and all(isinstance(pair, list) and len(pair) == 2 for pair in logged)
        and all(0.0 <= share <= 1.0 for share in shares)
    )
    if not is_valid:
        raise damaged(path)
    return result


def read_arrays(path: Path, dimensions: Mapping[str, int]) -> Columns:
    """The arrays of a file, which must have numeric ones of these dimensions."""
    check_kind(path)
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


def read_texts(path: Path) -> list[dict[str, str]]:
    """The rows of a log as text, without empty entries; none if there is no file."""
    check_kind(path)
    try:
        content = path.read_bytes() if path.is_file() else b""
        complete = content[: content.rfind(b"\n") + 1].decode()  # a kill may leave half a row
        rows = csv.DictReader(io.StringIO(complete, newline=""))
        return [{name: text for name, text in row.items() if text} for row in rows]
    except (ValueError, csv.Error) as error:
        raise damaged(path) from error


def read_rows(path: Path) -> list[dict[str, float | str]]:
    """The rows of a log as numbers and text, without empty entries; none if there is no file."""
    return parse_rows(read_texts(path), path)


def parse_rows(texts: list[dict[str, str]], path: Path) -> list[dict[str, float | str]]:
    """The rows of `read_texts` with their numbers parsed; those without a point are integers."""
    try:
        # Surplus entries are a list, with the name None.
        return [{name: _entry(name, text) for name, text in row.items()} for row in texts]
    except (AttributeError, ValueError) as error:
        raise damaged(path) from error


def _entry(name: str, text: str) -> float | str:
    """A number, or a text in a column of the user's own."""
    is_numeric = name.startswith(NUMERIC)
    try:
        number = float(text)
    except ValueError:
        if is_numeric:
            raise
        return text
    if is_numeric and not math.isfinite(number):
        raise ValueError(f"{name} is {number}.")
    return int(text) if text.isdecimal() else number
