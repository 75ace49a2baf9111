"""Reads the files of a run: whatever is damaged in them is one sentence, a ValueError."""

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

Fields = Mapping[str, type | UnionType]
Columns = dict[str, Array]

DESCRIPTION: Fields = {
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
"""Fields of `run.json` that are read; those with a question mark may be missing."""
RESULT: Fields = {
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
"""Fields of `result.json` that are read."""
FINAL_STATES = {"generation": 1, "timesteps": 1, "return": 1, "behavior": 2}
"""Columns of final states that are read, and their dimensions."""
REWARDING = {"return": 1, "generation": 1, "episode_seed": 1, "n_seen": 0}
"""Arrays of `rewarding.npz` and `sample.npz` that are read."""
LARGEST = 2**63
"""Numbers of `result.json` are smaller, as numpy's integers are."""
READ = ("time/", "coverage/", "archive/qd_score", "archive/size")
"""Beginnings of the columns of `progress.csv` that are read: they hold numbers."""


def damaged(path: Path) -> ValueError:
    """The error of a file that a run would not have written."""
    return ValueError(f"`folder` must be that of a run, {path} is damaged.")


def check_kind(path: Path, *, is_folder: bool = False) -> None:
    """Raise the error of a damaged file where a path is there, and no file or no folder.

    Whoever opens a pipe waits for ever.
    """
    if path.exists() and not (path.is_dir() if is_folder else path.is_file()):
        raise damaged(path)


def read_json(path: Path, fields: Fields) -> dict[str, Any]:
    """A dictionary with fields of these types."""
    check_kind(path)
    try:
        read = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise damaged(path) from error
    if not isinstance(read, dict) or not all(_has(read, *field) for field in fields.items()):
        raise damaged(path)
    return read


def _has(read: dict[str, Any], name: str, kind: type | UnionType) -> bool:
    plain = name.removesuffix("?")
    return isinstance(read[plain], kind) if plain in read else plain != name


def read_result(path: Path) -> dict[str, Any]:
    """The fields of a `result.json`, whose numbers and shares are such as a run comes to."""
    read = read_json(path, RESULT)
    shares = read["coverage"].values()
    numbers = [*shares, *(each for each in read.values() if isinstance(each, int | float))]
    is_sound = all(isinstance(each, int | float) and abs(each) < LARGEST for each in numbers)
    logged = [each for each in read["pending_log"].values() if isinstance(each, list)]
    are_pairs = len(logged) == len(read["pending_log"]) and all(len(each) == 2 for each in logged)
    if not is_sound or not are_pairs or not all(0.0 <= share <= 1.0 for share in shares):
        raise damaged(path)
    return read


def read_arrays(path: Path, dimensions: Mapping[str, int]) -> Columns:
    """The arrays of a file, those with so many dimensions among them, which hold numbers."""
    check_kind(path)
    try:
        with np.load(path) as file:
            arrays = dict(file)
    except Exception as error:  # whatever numpy, zipfile and zlib make of it
        raise damaged(path) from error
    found = {name: each.ndim for name, each in arrays.items() if each.dtype.kind in "biuf"}
    if not found.items() >= dimensions.items():
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
    """The rows of a log without empty entries, as they are written; none where there is no file."""
    check_kind(path)
    try:
        read = path.read_bytes() if path.is_file() else b""
        whole = read[: read.rfind(b"\n") + 1].decode()  # a kill may leave half of the last
        rows = csv.DictReader(io.StringIO(whole, newline=""))
        return [{name: text for name, text in row.items() if text} for row in rows]
    except (ValueError, csv.Error) as error:
        raise damaged(path) from error


def read_rows(path: Path) -> list[dict[str, float | str]]:
    """The rows of a log without empty entries, numbers and text; none where there is no file.

    Whole numbers without a point are integers.
    """
    return parse_rows(read_texts(path), path)


def parse_rows(texts: list[dict[str, str]], path: Path) -> list[dict[str, float | str]]:
    """What `read_rows` gives of the rows that `read_texts` has read of a path."""
    try:
        # Surplus entries are a list, with the name None.
        return [{name: _entry(name, text) for name, text in row.items()} for row in texts]
    except (AttributeError, ValueError) as error:
        raise damaged(path) from error


def _entry(name: str, text: str) -> float | str:
    """A number, or text in a column of the user's own."""
    is_read = name.startswith(READ)
    try:
        number = float(text)
    except ValueError:
        if is_read:
            raise
        return text
    if is_read and not math.isfinite(number):
        raise ValueError(f"{name} is {number}.")
    return int(text) if text.isdecimal() else number
