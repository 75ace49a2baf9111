"""What runs have left in their folders, for those who only read it; pandas' tables of many."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

import pandas as pd

from curiosity_algos.common.arrays import Array
from curiosity_algos.experiments.run_folder import RunFolder, read_final_states, read_log

StrPath: TypeAlias = str | os.PathLike[str]
KEYS = ("algorithm", "env", "seed")
FOR_PROGRAMS = {
    *("run", "env_spec", "env_unknown", "behavior_names", "archive"),
    *("pending_log", "in_force", "ended"),
}
"""Fields that make the environment again or continue the run: tables leave them out."""


class Run:
    """A run that is read: each of its files once, when it is first asked for.

    Another `Run` of the folder reads what has been written since.

    Args:
        path: Folder of the run.

    Raises:
        FileNotFoundError: When an attribute is read, if there is no run.
        ValueError: Likewise, if the run is of another format, or a file is damaged.
    """

    def __init__(self, path: StrPath) -> None:
        self.folder = RunFolder(path)

    def __str__(self) -> str:
        return str(self.folder.path)

    @cached_property
    def description(self) -> dict[str, Any]:
        """The fields of `run.json`."""
        return self.folder.describe()

    @cached_property
    def result(self) -> dict[str, Any]:
        """The fields of `result.json` in the last checkpoint; empty before the first."""
        return self.folder.result()

    @cached_property
    def progress(self) -> pd.DataFrame:
        """The rows of `progress.csv`, in columns of floats or of texts."""
        return read_log(self.folder.progress).apply(_as_numbers)

    @cached_property
    def final_states(self) -> dict[str, Array]:
        """The columns of the final states, an entry for each episode; empty before the first."""
        _ = self.description  # raises where there is no run
        return read_final_states(self.folder.final_state_files())

    def forget_final_states(self) -> None:
        """Free the memory of the final states: they are read again when they are asked for."""
        vars(self).pop("final_states", None)


def _as_numbers(texts: pd.Series) -> pd.Series:
    texts = texts.where(texts != "")  # a row may lack an entry
    try:
        return texts.astype(float)
    except ValueError:
        return texts


def find_runs(folders: StrPath | Iterable[StrPath]) -> list[Path]:
    """The folders of runs in folders and below, in order; each run once, and one in each folder."""
    folders = [folders] if isinstance(folders, str | os.PathLike) else list(folders)
    paths: dict[Path, Path] = {}
    for folder in folders:
        runs = sorted(_holders(folder))
        if not runs:
            raise FileNotFoundError(f"`folders` must hold runs, there is no run.json in {folder}.")
        for run in runs:
            paths.setdefault(run.resolve(), run)
    if not paths:
        raise FileNotFoundError("`folders` must hold runs, there is no folder in it.")
    return list(paths.values())


def _holders(folder: StrPath) -> Iterator[Path]:
    """The folders in a folder that have a `run.json`; links lead nowhere twice."""
    seen: set[str] = set()
    # `os.walk` passes over folders that vanish, as checkpoints do while a run goes on.
    for path, below, files in os.walk(folder, followlinks=True):
        below.sort()
        if (real := os.path.realpath(path)) in seen:
            below.clear()
        elif "run.json" in files:
            yield Path(path)
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
    return tabulate([Run(path) for path in find_runs(folders)])


def tabulate(runs: list[Run]) -> pd.DataFrame:
    """The table of `load_runs`."""
    rows = []
    for run in runs:
        fields = run.description | run.result
        columns = {name: value for name, value in fields.items() if name not in FOR_PROGRAMS}
        rows.append({"run": str(run), **columns})
    table = pd.json_normalize(rows)
    firsts = {"first_reward_timesteps", "first_success_timesteps"}
    for name in {*firsts, "best_return"} & set(table.columns):
        table[name] = table[name].astype(float)  # None: NaN
    return table


def load_progress(folders: StrPath | Iterable[StrPath]) -> pd.DataFrame:
    """A row for each log of each run in folders: its columns, `run`, `algorithm`, `env`, `seed`.

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If a run is of another format, or damaged.
    """
    tables = []
    for run in map(Run, find_runs(folders)):
        keys = {name: run.description.get(name) for name in KEYS}
        tables.append(run.progress.assign(run=str(run), **keys))
    return pd.concat(tables, ignore_index=True)


def load_final_states(folder: StrPath) -> dict[str, Array]:
    """The ends of every episode of one run, in their order.

    Returns:
        `generation`, `timesteps` (after its generation), `return`, `length`, `success` and
        `curiosity` (NaN where the algorithm has none), (n,); `behavior`, (n, B).

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If it is of another format, or damaged.
    """
    return Run(folder).final_states
