"""The paper's figures from committed data, and that from runs.

`python -m benchmarks.paper collect RUNS` adds the finished runs of `benchmarks.reproduce` and
`curiosity sweep` in a folder to the CSV files, `python -m benchmarks.paper draw` draws from these,
light and dark, without a run. What is measured anew replaces what was there.

runs.csv          a row for each run
curves.csv        of each run its curves, at up to `N_POINTS` times
final_states.csv  of runs that figure 4 shows how many episodes ended in each square of the maze
projection.csv    rewarding policies of the runs that figure 8 shows
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise, product
from pathlib import Path

import matplotlib as mpl
import matplotlib.style
import numpy as np
import numpy.typing as npt
import pandas as pd
import typer

from benchmarks import paper_figures, results
from benchmarks.figures import IMAGES, points_of
from benchmarks.paper_figures import MEASURES, SIDE, Counts, count_final_states
from benchmarks.plan import BUDGETS, Series, series_of
from benchmarks.projection import (
    Projection,
    project_rewarding,
    replay_rewarding,
)
from curiosity_algos.experiments import load_runs
from curiosity_algos.experiments.canvas import save_figure
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.measures import Points, logged

FOLDER = results.FOLDER / "paper"
N_POINTS = 100
SIZE = 200
"""Maze units along each side of a maze."""
COLUMNS = [str(x) for x in range(int(SIZE / SIDE))]
"""Of the squares that final states are counted in."""
ROUTE_CELL = 20
"""Maze units along each side of the squares whose order is a policy's route."""
BONUS = "intrinsic/mean"
"""The column of a run's log."""
PUBLIC_STEP = "step=canonical"
SETTINGS = {"paper": ("paper", ""), "public": ("paper", PUBLIC_STEP), "tuned": ("tuned", "")}
"""By name the preset, and the setting whose runs count instead, of algorithms that have it."""
ABOUT = {
    "paper": "the paper's table 1, the formula's step",
    "public": "the paper's table 1, the code's step",
    "tuned": "today's settings",
}
"""By the same names what stands in a title."""
BUDGET = {"paper": "paper", "public": "paper", "tuned": "short"}
"""By the same names the budget that claims are judged at."""
FIGURES = {
    "paper": (1, 2, 3, 4, 5, 6, 7, 8),
    "public": (2, 3, 4, 7, 8),
    "tuned": (2, 3, 4, 5, 6, 7, 8),
}
"""By the name of the settings the figures whose runs there are."""
KEYS = ["preset", "variant", "algorithm", "env", "seed"]
RESULTS = [
    "timesteps",
    "n_episodes",
    "n_rewarding",
    "first_success_timesteps",
    "best_return",
    "seconds",
    "machine.processor",
    "coverage.reachable",
    "coverage.all",
    "coverage.visited",
]
DARK = dict.fromkeys(("figure.facecolor", "axes.facecolor", "savefig.facecolor"), "#131416")
THEMES = {"": {}, "_dark": {**matplotlib.style.library["dark_background"], **DARK}}
"""What is added to a picture's name, and matplotlib's settings: the docs' dark background."""
app = typer.Typer(add_completion=False, help=__doc__)


# -- from runs ------------------------------------------------------------------------------------


@app.command()
def collect(runs: Path, out: Path = FOLDER) -> None:
    """Add the finished runs of a folder to the files."""
    found = load_runs(runs)
    found = found[found["timesteps"] >= found["total_timesteps"]]
    if found.empty:
        raise ValueError(f"`runs` must hold finished runs, {runs} has none.")
    variants = [_variant(Path(run).relative_to(runs)) for run in found["run"]]
    found = found.assign(preset=found["settings.preset"], variant=variants)
    tables = {
        "runs": (found.reindex(columns=[*KEYS, *RESULTS]), KEYS),
        "curves": (_of_each(found, _curves), KEYS),
        "final_states": (_of_each(_shown(found, 4), _final_states), KEYS),
        "projection": (_projection(_shown(found, 8), out), ["preset"]),
    }
    for name, (table, keys) in tables.items():
        if not table.empty:
            results.add_rows(table, out / f"{name}.csv", keys, read)


def _variant(path: Path) -> str:
    """The folder of runs with settings of their own, if any."""
    return "/".join(path.parts[:-3])


def _shown(runs: pd.DataFrame, figure: int) -> pd.DataFrame:
    """Those of the runs that a figure shows, with one step of the strategies or the other."""
    panels = series_of(figure)
    shown = [(env, series.algorithm) for env, panel in panels.items() for series in panel]
    is_shown = runs.set_index(["env", "algorithm"]).index.isin(shown)
    return runs[is_shown & runs["variant"].isin(["", PUBLIC_STEP])]


def _of_each(runs: pd.DataFrame, read: Callable[[Run], pd.DataFrame]) -> pd.DataFrame:
    """What is read of each run, in rows that begin with its keys."""
    rows = runs[[*KEYS, "run"]].itertuples(index=False)
    tables = {tuple(key): read(Run(run)) for *key, run in rows}
    if not tables:
        return pd.DataFrame(columns=KEYS)
    return pd.concat(tables, names=KEYS).reset_index(KEYS)


def _curves(run: Run) -> pd.DataFrame:
    """What the measures are at `N_POINTS` times; a bonus is logged by those that have one.

    A generation's return and the bonus are means since the time before: the highest would be that
    of the luckiest of many generations.
    """
    measured = {name: measure(run) for name, measure in MEASURES.items()}
    curves = {name: (np.r_[0.0, x], np.r_[0.0, y]) for name, (x, y) in measured.items()}
    if BONUS in run.progress:
        x, y = logged(run, BONUS)
        curves["bonus"] = np.r_[0.0, x], np.r_[np.nan, y]  # not known before the first log
    edges = np.linspace(0.0, max(steps[-1] for steps, _ in curves.values()), N_POINTS + 1)
    table = pd.DataFrame({"timesteps": edges[1:].round()})
    for name, (steps, values) in curves.items():
        last = np.searchsorted(steps, edges, side="right")
        of_each = [values[min(a, b - 1) : b] for a, b in pairwise(last)]
        mean = name in {"generation_return", "bonus"}
        table[name] = [each.mean() if mean else each[-1] for each in of_each]
    return table


def _final_states(run: Run) -> pd.DataFrame:
    """How many episodes ended in each square, a row for each y."""
    table = pd.DataFrame(count_final_states(run, run.folder.path.parent.name), columns=COLUMNS)
    return table.rename_axis("y").reset_index()


def _projection(runs: pd.DataFrame, folder: Path) -> pd.DataFrame:
    """A row for each rewarding policy, and its route: equal ones have the same number.

    None where the folder's file has policies of other runs: it is one projection of all.
    """
    keys = ["preset", "variant", "algorithm", "seed"]
    if (path := folder / "projection.csv").exists():
        old = read(path)
        old = old[old["preset"].isin(runs["preset"])].set_index(keys)
        if not old.index.isin(runs.set_index(keys).index).all():
            typer.echo("projection.csv stays as it is: it shows runs that are not here.")
            return pd.DataFrame(columns=keys)
    played = {run: [replay_rewarding(Run(run))] for run in runs["run"]}
    states = [policy for (each,) in played.values() for policy in each.states]
    if len(states) < 3:
        return pd.DataFrame(columns=keys)
    projected = project_rewarding(played)
    table = runs[keys].iloc[projected.owners].reset_index(drop=True)
    table[["x", "y"]] = projected.scores
    table["return"] = projected.returns
    table["route"] = pd.factorize(pd.Series([_route(each) for each in states]))[0]
    return table.assign(share_x=projected.shares[0], share_y=projected.shares[1])


def _route(states: npt.NDArray[np.float32]) -> bytes:
    """The squares that a policy came through, in the order of its first visits; states: -1 to 1."""
    squares = ((states[:, :2] + 1.0) * (SIZE / 2 / ROUTE_CELL)).astype(np.int8)
    return bytes(number for square in dict.fromkeys(map(tuple, squares)) for number in square)


# -- from the files -------------------------------------------------------------------------------


def read(path: Path) -> pd.DataFrame:
    """A file."""
    return pd.read_csv(path, dtype={"variant": str}).fillna({"variant": ""})


class Tables:
    """Evidence that is read from the files.

    Args:
        settings: One of `SETTINGS`.
        folder: That holds the files.

    Attributes:
        about: What the settings are.
        budget: That claims are judged at.
    """

    def __init__(self, settings: str, folder: Path = FOLDER) -> None:
        preset, setting = SETTINGS[settings]
        self.about = ABOUT[settings]
        self.budget = BUDGETS[BUDGET[settings]]
        tables = {path.stem: read(path) for path in folder.glob("*.csv")}
        tables = {name: table[table["preset"] == preset] for name, table in tables.items()}
        runs = tables["runs"]
        replaced = set(runs.loc[runs["variant"] == setting, "algorithm"]) if setting else set()
        self._tables = {
            name: _with_setting(table, setting, replaced) for name, table in tables.items()
        }

    def table(self, name: str) -> pd.DataFrame:
        """The rows of a file that are of these settings."""
        return self._tables[name]

    def curves(self, series: Series, env: str, measure: str) -> list[Points]:
        """A curve of each run, of one of `MEASURES`."""
        curves = self._of("curves", series, env)
        return [points_of(curve, measure) for _, curve in curves.groupby("seed")]

    def final_states(self, series: Series, env: str) -> Counts:
        """How many episodes of all runs ended in each square of a maze, by y and x."""
        return self._of("final_states", series, env).groupby("y")[COLUMNS].sum().to_numpy()

    def projection(self, panel: Sequence[Series], env: str) -> Projection:
        """Rewarding policies of all runs."""
        rows = self._tables["projection"]
        rows = rows[rows["variant"] == ""]
        names = tuple(series.algorithm for series in panel)
        return Projection(
            names,
            rows["algorithm"].map(names.index).to_numpy(),
            rows[["x", "y"]].to_numpy(),
            rows["return"].to_numpy(),
            rows[["share_x", "share_y"]].iloc[0].to_numpy(dtype=float),
        )

    def n_rewarding(self, series: Series, env: str) -> int:
        """How many rewarding policies all runs have found."""
        return int(self._of("runs", series, env)["n_rewarding"].sum())

    def _of(self, name: str, series: Series, env: str) -> pd.DataFrame:
        table = self._tables[name]
        keys = {"variant": series.variant, "algorithm": series.algorithm, "env": env}
        return table[(table[list(keys)] == pd.Series(keys)).all(axis=1)]


evidence = cache(Tables)
"""What is committed of some settings, read once."""


def _with_setting(table: pd.DataFrame, setting: str, algorithms: set[str]) -> pd.DataFrame:
    """Rows in which the algorithms' runs with a setting are in the place of those without."""
    settings = table["variant"].str.split(",")
    has_it = settings.map(lambda each: setting in each)
    others = settings.map(lambda each: ",".join(name for name in each if name != setting))
    return table.assign(variant=others)[has_it | ~table["algorithm"].isin(algorithms)]


@app.command()
def draw(out: Path = IMAGES, folder: Path = FOLDER) -> None:
    """Draw every figure anew."""
    for settings, figures in FIGURES.items():
        tables = Tables(settings, folder)
        for figure, (ending, theme) in product(figures, THEMES.items()):
            with mpl.rc_context(theme):
                path = out / f"{settings}_figure_{figure}{ending}.png"
                save_figure(paper_figures.draw(figure, tables), path)
                typer.echo(path)


if __name__ == "__main__":
    app()
