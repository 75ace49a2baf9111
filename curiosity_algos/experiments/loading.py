"""Runs as pandas' tables."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from curiosity_algos.experiments.run import Run, StrPath

KEYS = ("algorithm", "env", "seed")
FOR_PROGRAMS = {
    *("run", "env_spec", "env_unknown", "behavior_names", "archive"),
    *("pending_log", "in_force", "ended"),
}
"""Fields that make the environment again or continue the run: tables leave them out."""


def find_runs(folders: StrPath | Iterable[StrPath]) -> list[Path]:
    """The folders of runs in folders and below, in order; each run once.

    Raises:
        FileNotFoundError: If there is none in one of the folders.
    """
    folders = [folders] if isinstance(folders, str | os.PathLike) else list(folders)
    paths: dict[Path, Path] = {}
    for folder in folders:
        # `os.walk` passes over folders that vanish, as checkpoints do while a run goes on.
        walk = os.walk(folder, followlinks=True)
        runs = sorted(Path(path) for path, _, files in walk if "run.json" in files)
        if not runs:
            raise FileNotFoundError(f"`folders` must hold runs, there is no run.json in {folder}.")
        for run in runs:
            paths.setdefault(run.resolve(), run)
    if not paths:
        raise FileNotFoundError("`folders` must hold runs, there is no folder in it.")
    return list(paths.values())


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
        table = run.progress.copy()
        keys = {"run": str(run)} | {name: run.description.get(name) for name in KEYS}
        for i, (name, value) in enumerate(keys.items()):
            table.insert(i, name, value)
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def load_final_states(folder: StrPath) -> dict[str, npt.NDArray[np.generic]]:
    """The ends of every episode of one run, in their order.

    Returns:
        `generation`, `timesteps` (after its generation), `return`, `length`, `success` and
        `curiosity` (NaN where the algorithm has none), (n,); `behavior`, (n, B).

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If it is of another format, or damaged.
    """
    return Run(folder).final_states
