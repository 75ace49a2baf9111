"""Runs side by side, and their curves, for the figures and the report.

Functions that read a run raise FileNotFoundError if there is none, ValueError if it is damaged or
has no such curve.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import pandas as pd

from curiosity_algos.common.arrays import Array, Float64Array
from curiosity_algos.experiments.labels import label_runs, setting_text
from curiosity_algos.experiments.loading import Run, StrPath, find_runs, tabulate
from curiosity_algos.experiments.progress_log import SECONDS, TIMESTEPS
from curiosity_algos.experiments.statistics import Survival, survival

Points: TypeAlias = tuple[Float64Array, Float64Array]
"""Timesteps or seconds (n,), and the value from then on (n,)."""
Measure: TypeAlias = Callable[[Run], Points]
"""Reads a curve of a run."""
QD_SCORE, SIZE = "archive/qd_score", "archive/size"
"""Columns of the log."""
CELLS = {"dims", "centroids"}
"""Settings of archives that say which cells they have."""


def load_compared(folders: StrPath | Iterable[StrPath]) -> pd.DataFrame:
    """`load_runs`, named for comparison.

    Returns:
        A row for each run. `env` has the keywords in which environments of one name differ, `label`
        the settings in which runs of one algorithm differ. `has_begun`: an episode has ended by the
        last checkpoint. `is_repeated`: another run of the label has the same seed, and is as long
        or longer, so that the two are not independent. `files` has the `Run` that reads its files.
    """
    files = [Run(path) for path in find_runs(folders)]
    runs = tabulate(files).assign(files=files)
    names = runs["env"].fillna(runs.get("env_class", "unknown"))
    keywords = runs.filter(regex=r"^(env_kwargs|wrappers)\.").map(setting_text)
    runs["env"] = with_differences(names, keywords)
    has_begun = runs["n_episodes"] > 0 if "n_episodes" in runs else False
    runs = runs.assign(label=label_runs(runs), has_begun=has_begun)
    return runs.assign(is_repeated=_is_repeated(runs))


def _is_repeated(runs: pd.DataFrame) -> pd.Series:
    """Of runs alike, all but the longest; runs without a seed are never alike."""
    known = runs.reindex(columns=["timesteps", "env", "label", "seed"])
    known = known[runs["has_begun"] & known["seed"].notna()]
    known = known.sort_values("timesteps", ascending=False, kind="stable")
    repeated = known.duplicated(["env", "label", "seed"])
    return repeated.reindex(runs.index, fill_value=False)


def left_out(runs: pd.DataFrame) -> list[str]:
    """Sentences that name those of `load_compared` of which no figure is drawn."""
    reasons = {
        "no episode has ended": runs[~runs["has_begun"]],
        "a seed counts once, and is that of another run": runs[runs["is_repeated"]],
    }
    return [
        f"Left out, as {reason}: {', '.join(rows['run'])}."
        for reason, rows in reasons.items()
        if len(rows)
    ]


def with_differences(names: pd.Series, texts: pd.DataFrame) -> pd.Series:
    """Names, followed by the columns in which rows of one name differ: `A, k 5`."""
    titles = names.copy()
    for _, rows in texts.groupby(names):
        for column in rows.columns[rows.nunique() > 1]:
            titles[rows.index] += f", {column.split('.', 1)[-1]} " + rows[column]
    return titles


def first_of(runs: pd.DataFrame) -> str | None:
    """The event whose first time measures runs on one environment: "success" or "reward".

    It is the reward, a return above 0, where some run had one and none a success. None: returns
    differ from 0 and none was above, as on a task of costs.
    """
    for event in ("success", "reward"):
        if first_timesteps(runs, event).notna().any():
            return event
    return None if runs["best_return"].fillna(0.0).any() else "success"


def first_timesteps(runs: pd.DataFrame, event: str) -> pd.Series:
    """Timesteps of the first "success" or "reward" of each run; NaN: never, or not known."""
    column = f"first_{event}_timesteps"
    return runs.reindex(columns=[column])[column].astype(float)


def times_to_first(runs: pd.DataFrame, event: str, x: str = "timesteps") -> Survival:
    """Kaplan-Meier estimate of how long runs go without an event, in "timesteps" or "seconds"."""
    times = np.c_[first_timesteps(runs, event), runs["timesteps"].to_numpy(dtype=np.float64)]
    if x == "seconds":
        times = np.array([in_seconds(*row) for row in zip(runs["files"], times, strict=True)])
    return survival(times[:, 0], times[:, 1])


def read_curves(runs: pd.DataFrame, measure: Measure, x: str = "timesteps") -> list[Points]:
    """The curve of each run over its "timesteps" or "seconds"."""
    curves = [measure(run) for run in runs["files"]]
    if x == "timesteps":
        return curves
    pairs = zip(runs["files"], curves, strict=True)
    return [(in_seconds(run, timesteps), values) for run, (timesteps, values) in pairs]


def coverage(run: Run) -> Points:
    """Share of the reachable cells in which episodes have ended; none before timestep 0."""
    return _from_zero(*logged(run, "coverage/reachable"))


def best_return(run: Run) -> Points:
    """Highest return of an episode so far, from the first generation on."""
    states = final_states(run)
    timesteps, returns = highest(states, states["timesteps"])
    return timesteps, np.maximum.accumulate(returns)


def final_states(run: Run) -> dict[str, Array]:
    """The final states of a run with an episode."""
    if not run.final_states:
        raise ValueError(f"`folder` must be that of a run, final states of {run} are missing.")
    return run.final_states


def highest(states: dict[str, Array], group: Array) -> Points:
    """Timesteps at the end of each group of episodes in a row, and its highest return."""
    first = np.flatnonzero(np.r_[True, group[1:] != group[:-1]])
    last = np.r_[first[1:], len(group)] - 1
    timesteps = states["timesteps"][last].astype(np.float64)
    return timesteps, np.maximum.reduceat(states["return"], first)


def logged(run: Run, column: str) -> Points:
    """Timesteps and values of the rows of the log that have both."""
    progress = run.progress
    if len(progress) and column not in progress:
        without = " Without behaviors there is no coverage." if "coverage" in column else ""
        raise ValueError(f"`runs` must have {column} in progress.csv, {run} has not.{without}")
    rows = progress.reindex(columns=[TIMESTEPS, column]).apply(pd.to_numeric, errors="coerce")
    timesteps, values = rows.dropna().to_numpy(dtype=np.float64).T
    return timesteps, values


def _from_zero(timesteps: npt.ArrayLike, values: npt.ArrayLike) -> Points:
    return np.r_[0.0, timesteps], np.r_[0.0, values]


def in_seconds(run: Run, timesteps: npt.ArrayLike) -> Float64Array:
    """Seconds of training after which a run was at `timesteps` (n,), by its log and its result."""
    known, seconds = _from_zero(*logged(run, SECONDS))
    end = run.result
    if end and end["timesteps"] > known[-1]:
        known, seconds = np.r_[known, end["timesteps"]], np.r_[seconds, end["seconds"]]
    return np.interp(np.asarray(timesteps, dtype=np.float64), known, seconds)


qd_score = partial(logged, column=QD_SCORE)
"""Sum of the elites' returns, less the archive's `qd_score_offset` for each of them."""
n_elites = partial(logged, column=SIZE)
"""Number of elites."""


def with_archives(runs: pd.DataFrame) -> pd.DataFrame:
    """The rows of `load_compared` whose logs have a QD score, and a column `archive`.

    QD scores of one `archive` can be compared: they are of one environment, and of archives of one
    class with the same cells and `qd_score_offset`. Of archives without cells, such as
    `UnstructuredArchive`, each label has its own.
    """
    archives = [_archive_of(*row) for row in zip(runs["files"], runs["label"], strict=True)]
    texts = pd.DataFrame(archives, index=runs.index).dropna(how="all").astype(object)
    texts = texts.where(texts.notna(), "none").reindex(columns=["archive", *texts.columns[1:]])
    runs = runs.loc[texts.index]
    names = runs["env"] + ", " + texts.pop("archive")
    return runs.assign(archive=with_differences(names, texts))


def _archive_of(run: Run, label: str) -> dict[str, str]:
    """The class of a run's `archive` and its settings, in words; empty without a QD score."""
    archive = run.description.get("archive")
    if not archive or not {QD_SCORE, SIZE} <= {*run.progress}:
        return {}
    ((name, settings),) = archive.items()
    if settings.keys() & CELLS:
        return {"archive": name} | {key: str(value) for key, value in settings.items()}
    return {"archive": f"{name} of {label}"}
