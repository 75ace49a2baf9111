"""The file of an archive: one `.npz` that numpy alone can read.

`numpy.load(path)` gives these arrays, row i of each being elite i:

- `solution` (n, n_parameters): the policies' flat parameter vectors;
- `objective` (n,): their returns;
- `measures` (n, B): what places them in the archive;
- `index` (n,): their cells;
- every extra field of the archive, such as `seed` (n,), the seed of the episode that was played;
- `about` (): JSON with `format`, `archive` (the class) and `settings` (its keywords: of a grid
  `dims` and `ranges`, of policies `net_arch`).
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from curiosity_algos.checkpoints.plain_files import is_whole_zip
from curiosity_algos.common.arrays import Array
from curiosity_algos.state.atomic_file import atomic_file

FORMAT = "curiosity archive 1"
FIELDS = {"solution", "objective", "measures", "index"}
"""Kept of every elite."""


def archive_path(path: str | os.PathLike[str]) -> Path:
    """`path`, with the suffix `.npz` where it has none."""
    path = Path(path)
    return path if path.suffix else path.with_suffix(".npz")


def write_archive(
    path: str | os.PathLike[str], kind: str, settings: Mapping[str, Any], data: Mapping[str, Array]
) -> None:
    """Write elites; the file takes the place of an older one only once it is wholly on disk."""
    about = json.dumps({"format": FORMAT, "archive": kind, "settings": settings})
    with atomic_file(archive_path(path)) as file:
        np.savez(file, about=np.array(about), **data)  # type: ignore[arg-type]


def read_archive(
    path: str | os.PathLike[str], kind: str
) -> tuple[dict[str, Any], dict[str, Array]]:
    """Settings and elites, as they are, of a file that says that it holds an archive of a class."""
    path = archive_path(path)
    if not path.is_file():
        raise FileNotFoundError(f"`path` must be a saved archive, there is no file {path}.")
    try:
        is_stored = is_whole_zip(path)  # and unpacks to no more than it is
        with np.load(path) as file:
            data = dict(file) if is_stored else {}
        about = json.loads(str(data.pop("about")))
        is_ours = about["format"] == FORMAT and isinstance(about["settings"], dict)
        is_whole = data.keys() >= FIELDS and all(isinstance(a, np.ndarray) for a in data.values())
        found = about["archive"] if is_ours and is_whole else None
    except Exception:  # zip files, numpy's headers and JSON fail in more ways than can be named
        found = None
    if found != kind:
        what = "not a whole file of this package" if found is None else f"one of {found}"
        raise ValueError(f"`path` must be a saved {kind}, {path} is {what}.")
    return about["settings"], data
