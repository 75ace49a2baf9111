"""What runs came to, in two small CSV files that tables and figures are made from.

NAME.csv          a row for each run
NAME_curves.csv   of each run best return, coverage and success at up to `N_POINTS` times
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from curiosity_algos.common.names import ENVIRONMENTS
from curiosity_algos.experiments import load_progress, load_runs
from curiosity_algos.experiments.labels import label_runs
from curiosity_algos.experiments.progress_log import TIMESTEPS

FOLDER = Path(__file__).parent / "results"
N_POINTS = 60
KEYS = ["algorithm", "env", "seed"]
RUN = [*KEYS, "timesteps", "first_success_timesteps", "best_return", "seconds", "machine.processor"]
CURVE = {
    TIMESTEPS: "timesteps",
    "time/seconds": "seconds",
    "rollout/ep_rew_max": "best_return",
    "coverage/reachable": "coverage",
    "rollout/success_rate": "success",
}


HELD = "wrappers.RepeatAction.num_repeats"
"""Column of how many steps of the environment, at most, are one of the algorithm's."""


def collect(runs: Path, name: str, folder: Path = FOLDER) -> None:
    """Add all runs in a folder to the two files `name`; timesteps are the environment's.

    What is measured anew replaces what was there.
    """
    table = load_runs(runs)
    n_held = steps_of_one(table)
    for column in ("timesteps", "first_success_timesteps"):
        table[column] *= n_held
    table["algorithm"] = label(table, runs)
    table["first_success_timesteps"] = table["first_success_timesteps"].astype("Int64")
    shares = sorted(column for column in table if column.startswith("coverage."))
    add_rows(table[[*RUN, *shares]], folder / f"{name}.csv", KEYS)
    labels = table.set_index("run")["algorithm"]
    curves = load_progress(runs)
    curves[TIMESTEPS] *= curves["run"].map(n_held.set_axis(table["run"]))
    curves["algorithm"] = curves["run"].map(labels)
    parts = [_thin(curve) for _, curve in curves.groupby(KEYS)]
    add_rows(pd.concat(parts), folder / f"{name}_curves.csv", KEYS)


def steps_of_one(table: pd.DataFrame) -> pd.Series:
    """Steps of the environment that are one of the algorithm's, for each run."""
    return table[HELD].fillna(1) if HELD in table else pd.Series(1, table.index)


def label(table: pd.DataFrame, runs: Path) -> pd.Series:
    """As `label_runs`; runs of a sweep with a folder of its own have the folder's name, too."""
    sweeps = table["run"].map(lambda run: Path(run).relative_to(runs).parts[:-3])
    names = [
        label_runs(group).map(lambda name, sweep=sweep: ", ".join([name, *sweep]))
        for sweep, group in table.groupby(sweeps)
    ]
    return pd.concat(names).loc[table.index]


def _thin(curve: pd.DataFrame) -> pd.DataFrame:
    """The last row before each of `N_POINTS` times, equally far from each other, of one run.

    What its algorithm does not log, as Stable-Baselines3's the best return, is NaN. Success is the
    share of the last episodes, which these log alone.
    """
    rows = curve.rename(columns=CURVE).reindex(columns=[*KEYS, *CURVE.values()])
    rows["best_return"] = rows["best_return"].cummax()
    times = np.linspace(0.0, rows["timesteps"].iloc[-1], N_POINTS + 1)[1:]
    last = np.searchsorted(rows["timesteps"], times, side="right") - 1
    return rows.iloc[np.unique(np.maximum(last, 0))]


def _read(path: Path) -> pd.DataFrame:
    return pd.read_csv(path, dtype={"first_success_timesteps": "Int64"})


def add_rows(
    table: pd.DataFrame,
    path: Path,
    keys: list[str],
    read: Callable[[Path], pd.DataFrame] = _read,
) -> None:
    """Write a CSV file with these rows, in the place of old ones that have the same keys."""
    path.parent.mkdir(parents=True, exist_ok=True)
    table = table.set_index(keys)
    if path.exists():
        old = read(path).set_index(keys)
        table = pd.concat([old[~old.index.isin(table.index)], table])
    table.sort_index(kind="stable").to_csv(path, float_format="%.6g")


def read_runs(name: str, folder: Path = FOLDER) -> pd.DataFrame:
    """A row for each run, in order."""
    return in_order(pd.read_csv(folder / f"{name}.csv"))


def recorded(path: Path, keys: list[str]) -> set[tuple[Any, ...]]:
    """The keys of the rows that a CSV file has, if there is one."""
    if not path.exists():
        return set()
    return set(pd.read_csv(path)[keys].itertuples(index=False, name=None))


def rank(env: str) -> int:
    """The place of an environment among those that are registered here; others come last."""
    return ENVIRONMENTS.index(env) if env in ENVIRONMENTS else len(ENVIRONMENTS)


def in_order(runs: pd.DataFrame) -> pd.DataFrame:
    """Environments as they are registered, algorithms that cover most first."""
    covered = -runs.groupby("algorithm")["coverage.reachable"].transform("mean")
    order = pd.DataFrame({"covered": covered, "env": runs["env"].map(rank)})
    return runs.loc[order.sort_values(["covered", "env"], kind="stable").index]


def read_rows(name: str, folder: Path = FOLDER) -> pd.DataFrame:
    """The rows of a file in their order, as of settings that were tried."""
    return pd.read_csv(folder / f"{name}.csv")


def read_curves(name: str, folder: Path = FOLDER) -> pd.DataFrame:
    """A row for each time of each run."""
    return pd.read_csv(folder / f"{name}_curves.csv")
