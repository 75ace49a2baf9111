"""Runs as pandas' tables."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import pandas as pd

from curiosity_algos.experiments.reading import read_rows
from curiosity_algos.experiments.run_folder import RunFolder

StrPath: TypeAlias = str | os.PathLike[str]
KEYS = ("algorithm", "env", "seed")
NOT_SHOWN = {
    *("run", "env_spec", "env_unknown", "behavior_names", "archive"),
    *("pending_log", "ended"),
}


def find_runs(folders: StrPath | Iterable[StrPath]) -> list[Path]:
    """The folders of runs in folders and what is in these, in their order; each run once.

    Raises:
        FileNotFoundError: If there is none in one of the folders.
    """
    if isinstance(folders, str | os.PathLike):
        folders = [folders]
    found: dict[Path, Path] = {}
    for folder in folders:
        runs = sorted(_runs_in(folder))
        if not runs:
            raise FileNotFoundError(f"`folders` must hold runs, there is no run.json in {folder}.")
        for run in runs:
            found.setdefault(run.resolve(), run)
    if not found:
        raise FileNotFoundError("`folders` must hold runs, there is no folder in it.")
    return list(found.values())


def _runs_in(folder: StrPath) -> Iterator[Path]:
    """The folders of runs, behind links, too, of which those that lead back are not followed."""
    seen = set()
    # Which passes over folders that vanish, as checkpoints do while a run goes on.
    for path, inner, files in os.walk(folder, followlinks=True):
        if "run.json" in files:
            yield Path(path)
        if (real := os.path.realpath(path)) in seen:
            inner.clear()
        seen.add(real)


def load_runs(folders: StrPath | Iterable[StrPath]) -> pd.DataFrame:
    """A row for each run in a folder or in several, and in folders in them.

    Returns:
        `run`, its folder; `algorithm`, `env`, `seed` and what else `run.json` says of it, its
        settings as `settings.sigma`; what it has come to at its last checkpoint: `timesteps`,
        `best_return`, `first_reward_timesteps` and `first_success_timesteps` (NaN: never),
        `coverage.reachable`, `seconds`.

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If a run is of another format, or damaged.
    """
    rows = [_row(path) for path in find_runs(folders)]
    runs = pd.json_normalize(rows)
    firsts = {"first_reward_timesteps", "first_success_timesteps"}
    for name in {*firsts, "best_return"} & set(runs.columns):
        runs[name] = runs[name].astype(float)  # None: NaN
    return runs


def _row(path: Path) -> dict[str, Any]:
    run = RunFolder(path)
    fields = run.describe() | run.result()
    # Some are for the programs that make the environment and go on with the run.
    return {"run": str(path)} | {k: v for k, v in fields.items() if k not in NOT_SHOWN}


def load_progress(folders: StrPath | Iterable[StrPath]) -> pd.DataFrame:
    """A row for each log of each run in folders: its columns, `run`, `algorithm`, `env`, `seed`.

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If a run is of another format, or damaged.
    """
    return pd.concat([_progress(path) for path in find_runs(folders)], ignore_index=True)


def _progress(path: Path) -> pd.DataFrame:
    run = RunFolder(path)
    described = run.describe()
    table = pd.DataFrame(read_rows(run.progress))
    # Where a row lacks an entry, its column would be of floats, and of integers elsewhere.
    table = table.astype(dict.fromkeys(table.select_dtypes("integer"), float))
    for i, name in enumerate(KEYS):
        table.insert(i, name, described.get(name))
    table.insert(0, "run", str(path))
    return table


def load_final_states(folder: StrPath) -> dict[str, npt.NDArray[np.generic]]:
    """The ends of every episode of one run, in their order.

    Returns:
        `generation`, `timesteps` (after its generation), `return`, `length`, `success` and
        `curiosity` (NaN where the algorithm has none), (n,); `behavior`, (n, B).

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If it is of another format, or damaged.
    """
    run = RunFolder(folder)
    run.describe()
    return run.final_states()
