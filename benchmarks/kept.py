"""Whether the last policy of a run comes to the goal: `python -m benchmarks.kept NAME` counts.

The runs are those of `python -m benchmarks.bonuses NAME`. Exploration may find a goal to which the
policy that it leaves behind never comes back. When a run came back reliably is read from its log.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from benchmarks.measure import markdown
from benchmarks.results import (
    FOLDER,
    KEYS,
    add_rows,
    label,
    read_rows,
    read_runs,
    steps_of_one,
)
from benchmarks.run_tables import short
from curiosity_algos.common.names import find_algorithm
from curiosity_algos.experiments import load_progress, load_runs
from curiosity_algos.experiments.canvas import short_name
from curiosity_algos.experiments.env_spec import make_env
from curiosity_algos.experiments.progress_log import TIMESTEPS
from curiosity_algos.experiments.run_folder import RunFolder

N_ENVS = 8
SEED = 10_000
"""Of actions that are drawn, and of starts."""
GENERAL = "CuriosityMaze-v0"
"""Of mazes that are drawn."""
RELIABLE = 0.9
"""The share of the last 100 episodes from which on a run comes to the goal reliably."""
RATE = "rollout/success_rate"
"""Stable-Baselines3's name of that share."""


def main(
    name: Annotated[str, typer.Argument(help="Of a table of `benchmarks.bonuses`.")] = "recipe",
    runs: Annotated[Path, typer.Option(help="That holds the folder of the name.")] = Path("runs"),
    episodes: Annotated[int, typer.Option(min=1, help="Episodes of each policy.")] = 100,
    out: Annotated[Path, typer.Option(help="Where the CSV file goes.")] = FOLDER,
) -> None:
    """Count the episodes in which each last policy succeeds, and add them to a CSV file."""
    table = load_runs(runs / name)
    table["algorithm"] = label(table, runs / name)
    table["episodes"] = episodes
    for column, is_best in (("drawn", False), ("best", True)):
        counts = [count(Path(run), episodes, is_best=is_best) for run in table["run"]]
        table[column] = counts
    table["reliable_timesteps"] = table["run"].map(reliable_timesteps(runs / name))
    table["reliable_timesteps"] *= steps_of_one(table)
    columns = [*KEYS, "episodes", "drawn", "best", "reliable_timesteps"]
    add_rows(table[columns], out / f"{name}_kept.csv", KEYS)


def reliable_timesteps(runs: Path) -> pd.Series:
    """Of each run that came to that, the first logged timesteps at which it comes reliably.

    Stable-Baselines3 logs the share of the last 100 episodes; before as many, that of all.
    """
    curves = load_progress(runs)
    return curves[curves[RATE] >= RELIABLE].groupby("run")[TIMESTEPS].min()


def count(path: Path, n_episodes: int, *, is_best: bool) -> int:
    """Episodes that succeed with the best action at each step, or with drawn ones."""
    run = RunFolder(path)
    described = run.describe()
    cls = find_algorithm(described["algorithm"].partition(" + ")[0])
    model: BaseAlgorithm = run.read(lambda folder: cls.load(folder / "model", device="cpu"))
    venv = VecMonitor(DummyVecEnv([partial(make_env, described, trust=True)] * N_ENVS))
    venv.seed(SEED)
    set_random_seed(SEED)
    successes: list[bool] = []

    def note(scope: Mapping[str, Any], _: object) -> None:
        if scope["done"]:
            successes.append(bool(scope["info"].get("is_success")))

    evaluate_policy(
        model, venv, n_eval_episodes=n_episodes, deterministic=is_best, callback=note, warn=False
    )
    venv.close()
    return sum(successes)


def table(name: str) -> str:
    """When runs of that name found the goal, and how often their last policies come back to it."""
    runs = read_runs(name).merge(read_rows(f"{name}_kept"), on=KEYS)
    (n_episodes,) = runs["episodes"].unique()
    rows = [
        [_task(algorithm, env), *map(" / ".join, _cells(group))]
        for (env, algorithm), group in runs.groupby(["env", "algorithm"])
    ]
    times = ["First reward (M steps)", "90 of the last 100"]
    heads = [*times, f"Successes in {n_episodes} episodes, stochastic", "deterministic"]
    return markdown(["Task", *heads], rows)


def times(timesteps: pd.Series, unit: float) -> list[str]:
    """Timesteps of each seed in a unit; "never" where there are none."""
    return ["never" if pd.isna(each) else short(each / unit, 1) for each in timesteps]


def _task(algorithm: str, env: str) -> str:
    """The environment, and what a run had otherwise than others; of a maze drawn its name."""
    named = [] if env == GENERAL else [short_name(env)]
    return ", ".join([*named, *algorithm.split(", ")[1:]])


def _cells(group: pd.DataFrame) -> list[Iterable[str]]:
    """Of each seed when it found and came back, and how often its last policy comes to the goal."""
    when = [times(group[f"{what}_timesteps"], 1e6) for what in ("first_success", "reliable")]
    return [*when, group["drawn"].map(str), group["best"].map(str)]


if __name__ == "__main__":
    typer.run(main)
