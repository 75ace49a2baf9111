"""What a report is about: runs by environment, and what their folders say."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from curiosity_algos.experiments.labels import label_runs
from curiosity_algos.experiments.loading import load_runs_of
from curiosity_algos.experiments.progress_log import TIMESTEPS
from curiosity_algos.experiments.reading import read_rows
from curiosity_algos.experiments.run_folder import RunFolder

Float64 = npt.NDArray[np.float64]
LOGGED = {"timesteps": TIMESTEPS, "seconds": "time/seconds", "coverage": "coverage/reachable"}
"""Name of a curve: its column in `progress.csv`."""


@dataclass(frozen=True, eq=False)
class Run:
    """One run.

    Attributes:
        folder: Where it is.
        label: What it is called, together with the other seeds of the same settings.
        seed: What tells it from these.
        description: Of `run.json`.
        result: Of its last checkpoint; empty before the first.
    """

    folder: RunFolder
    label: str
    seed: str
    description: dict[str, Any]
    result: dict[str, Any]

    @property
    def has_begun(self) -> bool:
        """Whether an episode has ended by the last checkpoint."""
        return bool(self.result.get("n_episodes"))

    @property
    def has_ended(self) -> bool:
        """Whether all timesteps that were asked for are done."""
        return self.has_begun and self.result["timesteps"] >= self.result["total_timesteps"]

    @property
    def coverage(self) -> float | None:
        """Share of the reachable cells in which episodes ended; None where nothing is counted."""
        share: float | None = self.result["coverage"].get("reachable")
        return share

    @property
    def best_return(self) -> float:
        """Of all episodes; 0 before the first."""
        return float(self.result["best_return"] or 0.0)

    @cached_property
    def episodes(self) -> dict[str, npt.NDArray[Any]]:
        """Columns of the final states by the last checkpoint.

        `generation`, `timesteps`, `return`, and `behavior`, its first two entries (n, 2) or fewer.

        Raises:
            ValueError: If they are damaged, or not all there.
        """
        columns, n = self.folder.final_states(), self.result["n_episodes"]
        if len(columns.get("return", ())) < n:
            raise ValueError(
                f"`folder` must be that of a run, final states of {self.folder.path} are missing."
            )
        names = ("generation", "timesteps", "return", "behavior")
        kept = {name: columns[name][:n] for name in names}
        return kept | {"behavior": kept["behavior"][:, :2].copy()}

    @cached_property
    def log(self) -> dict[str, Float64]:
        """Columns (n,) of the rows that were logged by the last checkpoint.

        `timesteps`, `seconds`, `coverage` (NaN where nothing is counted) and `best_return` so far.
        """
        rows = pd.DataFrame(read_rows(self.folder.progress)).reindex(columns=[*LOGGED.values()])
        table = rows.set_axis([*LOGGED], axis=1).apply(pd.to_numeric, errors="coerce")
        table["coverage"] = table["coverage"].ffill()
        table = table.dropna(subset=["timesteps", "seconds"])
        table = table[table["timesteps"] <= self.result["timesteps"]]
        columns = {name: table[name].to_numpy(dtype=np.float64) for name in LOGGED}
        return columns | {"best_return": self._best_return_at(columns["timesteps"])}

    def _best_return_at(self, timesteps: Float64) -> Float64:
        returns = np.nan_to_num(self.episodes["return"])
        begin = min([0.0, *returns[:1]])  # below 0 no return is the first's
        best = np.concatenate([[begin], np.maximum.accumulate(returns)])
        return best[np.searchsorted(self.episodes["timesteps"], timesteps, side="right")]

    def seconds_at(self, timesteps: float) -> float:
        """Seconds of training after so many timesteps, between two rows of the log linearly."""
        x, y = (np.r_[0.0, self.log[axis], self.result[axis]] for axis in ("timesteps", "seconds"))
        return float(np.interp(timesteps, x, y))


@dataclass(frozen=True, eq=False)
class Environment:
    """One environment, the runs on it that have begun, and the names of those that have not."""

    title: str
    runs: list[Run]
    not_begun: list[str]

    @property
    def labels(self) -> list[str]:
        """Of the runs, each once, sorted."""
        return sorted({run.label for run in self.runs})

    def of(self, label: str) -> list[Run]:
        """The runs of a label."""
        return [run for run in self.runs if run.label == label]


def collect(folders: Iterable[str | os.PathLike[str]]) -> list[Environment]:
    """The runs in folders, by environment; a run that is found twice counts once.

    Raises:
        FileNotFoundError: If there is no run in one of the folders.
        ValueError: If a run is of another format, or damaged.
    """
    table = load_runs_of(folders)
    found = [RunFolder(run) for run in table["run"]]
    descriptions = [folder.describe() for folder in found]
    table["env"] = _titles(descriptions)
    # Of each environment alone: what tells runs apart elsewhere is of no interest here.
    labels = pd.concat([label_runs(rows) for _, rows in table.groupby("env")])
    table["label"] = labels
    runs = [
        Run(folder, label, seed, description, folder.result())
        for folder, label, seed, description in zip(
            found, table["label"], _seeds(table), descriptions, strict=True
        )
    ]
    by_title: dict[str, list[Run]] = {title: [] for title in sorted(table["env"])}
    for title, run in zip(table["env"], runs, strict=True):
        by_title[title].append(run)
    return [_environment(title, its) for title, its in by_title.items()]


def _environment(title: str, runs: list[Run]) -> Environment:
    begun = [run for run in runs if run.has_begun]
    return Environment(title, begun, [str(run.folder.path) for run in runs if not run.has_begun])


def _titles(descriptions: list[dict[str, Any]]) -> list[str]:
    """The environment of each run, with those keywords that tell it from others of its name."""
    names = [str(each["env"] or each.get("env_class")) for each in descriptions]
    keywords = [_keywords(each) for each in descriptions]
    by_name: dict[str, list[dict[str, str]]] = {name: [] for name in names}
    for name, own in zip(names, keywords, strict=True):
        by_name[name].append(own)
    return [
        ", ".join([name, *_telling(own, by_name[name])])
        for name, own in zip(names, keywords, strict=True)
    ]


def _keywords(description: dict[str, Any]) -> dict[str, str]:
    """What an environment was made with, as text."""
    given = description.get("env_kwargs", {}) | description.get("wrappers", {})
    return {name: json.dumps(value, sort_keys=True).strip('"') for name, value in given.items()}


def _telling(own: dict[str, str], others: list[dict[str, str]]) -> list[str]:
    """The keywords in which environments differ, with their own values."""
    names = sorted({name for each in others for name in each})
    return [
        f"{name} {own.get(name, 'not given')}"
        for name in names
        if len({each.get(name) for each in others}) > 1
    ]


def _seeds(table: pd.DataFrame) -> list[str]:
    """The seed of each run, numbered where runs of one label share it."""
    seeds = table["seed"].map(str) if "seed" in table else pd.Series("unknown", table.index)
    count = seeds.groupby([table["env"], table["label"], seeds]).cumcount()
    return [seed if i == 0 else f"{seed} ({i + 1})" for seed, i in zip(seeds, count, strict=True)]
