"""How soon GoExplore finds a goal: `python -m benchmarks.restored run`, some tasks or all.

Its timesteps are explorations alone, as states are restored: they are another problem's than those
of searches that play every episode from its start. Beside them are the steps of the ways: a search
that takes the actions again from the start, as where nothing can be restored, needs both. Each run
ends with its first success. Runs that `restored.csv` has are left alone.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import matplotlib.pyplot as plt
import pandas as pd
import typer

from benchmarks.figures import IMAGES
from benchmarks.measure import markdown
from benchmarks.results import FOLDER, add_rows, recorded
from curiosity_algos import GoExplore
from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.robust.solve import Enough
from curiosity_gym import SparseRewardWrapper
from curiosity_gym.maze.plots import draw_layout

app = typer.Typer(pretty_exceptions_enable=False)
KEYS = ["task", "behavior", "seed"]
MAZES = ("Snake", "US", "Hard", "Labyrinth")
KINDS = ("perfect-8x8", "loops-8x8", "rooms-4x4-door4", "rooms-4x4-door8", "open-5x5", "open-8x8")
DRAWN = [f"{kind}-seed{seed}" for kind in KINDS for seed in range(10, 14)]
"""Names of mazes drawn at random, on none of which anything was tuned."""


SEVEN_ROOMS = {"minNumRooms": 7, "maxNumRooms": 7, "maxRoomSize": 8}
MINIGRID: dict[str, tuple[Any, ...]] = {
    "DoorKey-16x16": ("DoorKey-16x16-v0", {}),
    "MultiRoom-N7-S8": ("MultiRoom-N6-v0", SEVEN_ROOMS),
    "KeyCorridorS8R5": ("KeyCorridorS6R3-v0", {"room_size": 8, "num_rows": 5}),
    "ObstructedMaze-1Q": ("ObstructedMaze-1Q-v1", {}),
    "ObstructedMaze-2Dlhb": ("ObstructedMaze-2Dlhb-v1", {}),
}
"""By name the id and the keywords; a seed draws a layout, in which one search searches."""


@dataclass(frozen=True)
class Task:
    """An environment, how many steps a search may take, and its settings but the defaults."""

    make: Callable[[], gym.Env[Any, Any]]
    timesteps: float
    settings: Mapping[str, Any] = field(default_factory=dict)


def _minigrid(name: str, **kwargs: int) -> gym.Env[Any, Any]:
    from minigrid.wrappers import ImgObsWrapper  # an extra of few

    wrapped: gym.Env[Any, Any] = ImgObsWrapper(gym.make(f"MiniGrid-{name}", **kwargs))
    return wrapped


def _adroit(name: str) -> gym.Env[Any, Any]:
    import gymnasium_robotics

    gym.register_envs(gymnasium_robotics)
    return SparseRewardWrapper(gym.make(f"AdroitHand{name}Sparse-v1"), _is_success, horizon=200)


def _is_success(_env: Any, _observation: Any, _reward: Any, info: dict[str, Any]) -> bool:
    return bool(info["success"])


def _mountain_car() -> gym.Env[Any, Any]:
    return SparseRewardWrapper(gym.make("MountainCar-v0"), _is_at_the_top, horizon=200)


def _is_at_the_top(_env: Any, observation: Any, _reward: Any, _info: dict[str, Any]) -> bool:
    return bool(observation[0] >= 0.5)


CONTROL = ("BallInCup", "Finger", "Stacker")
SPARSE = ("PointMaze_UMaze", "PointMaze_Large", "CartPoleSwingUp", "AcrobotSwingUp")
ADROIT = ("Door", "Hammer", "Pen", "Relocate")
"""Of the hand, the tasks of Gymnasium-Robotics."""
TASKS = {
    **{name: Task(partial(gym.make, f"CuriosityMaze-{name}-v0"), 4e6) for name in MAZES},
    **{name: Task(partial(gym.make, "CuriosityMaze-v0", layout=name), 4e6) for name in DRAWN},
    **{
        name: Task(partial(gym.make, f"CuriosityLocomotion-{name}-v0"), 8e6)
        for name in ("AntTrap", "AntMaze", "HumanoidTrap")
    },
    **{name: Task(partial(gym.make, f"CuriosityControl-{name}-v0"), 1e6) for name in CONTROL},
    **{
        f"{name}-random": Task(
            partial(gym.make, f"CuriosityControl-{name}-v0", random_start=True), 1e6
        )
        for name in CONTROL
    },
    **{name: Task(partial(gym.make, f"CuriositySparse-{name}-v0"), 1e6) for name in SPARSE},
    "MountainCar": Task(_mountain_car, 1e6),
    "MountainCarContinuous": Task(partial(gym.make, "MountainCarContinuous-v0"), 1e6),
    **{f"Adroit{name}": Task(partial(_adroit, name), 5e5) for name in ADROIT},
    **{
        name: Task(partial(_minigrid, *made, **kwargs), 3e5, {"is_copied": True, "n_steps": 20})
        for name, (*made, kwargs) in MINIGRID.items()
    },
}


class WithWays(GoExplore):
    """Counts the steps of the ways to where explorations began."""

    ways = 0

    def _play(self) -> tuple[Float32Array, Rollouts]:
        played = super()._play()
        self.ways += sum(place.length for place in self._origins)
        return played


@app.command()
def run(
    tasks: Annotated[list[str] | None, typer.Argument(help="Names; without any, all.")] = None,
    behaviors: Annotated[str, typer.Option(help="learned, cells or both.")] = "learned",
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each, from seed 0 on.")] = 5,
    out: Annotated[Path, typer.Option(help="Where the CSV file goes.")] = FOLDER,
) -> None:
    """Search until the first success, and note when it came."""
    path = out / "restored.csv"
    done = recorded(path, KEYS)
    for seed in range(seeds):
        for task in tasks or TASKS:
            for behavior in behaviors.split(","):
                if (task, behavior, seed) not in done:
                    row = pd.DataFrame([search(task, behavior, seed)]).convert_dtypes()
                    add_rows(row, path, KEYS, _read)


@app.command()
def picture(task: str = "rooms-4x4-door8-seed11", out: Path = IMAGES) -> None:
    """Draw the states that a search has kept when it has found the goal of a maze."""
    make = TASKS[task].make
    model = GoExplore(make, seed=0).learn(TASKS[task].timesteps, Enough(1))
    layout = make().unwrapped.layout
    observed = model.archive.data("observation")
    places = (observed[:, :2] + 1.0) / 2.0 * [layout.width, layout.height]
    figure, axes = plt.subplots(figsize=(5.0, 4.0))
    draw_layout(axes, layout)
    points = axes.scatter(*places.T, c=-model.archive.data("objective"), s=8, zorder=3)
    figure.colorbar(points, label="steps from the start")
    figure.savefig(out / "go_explore.png", dpi=120, bbox_inches="tight")


def _read(path: Path) -> pd.DataFrame:
    return pd.read_csv(path).convert_dtypes()  # whole numbers, though some are missing


def search(task: str, behavior: str, seed: int) -> dict[str, Any]:
    """A run: timesteps and seconds until its first success, or until its end."""
    chosen, begin = TASKS[task], time.perf_counter()
    model = WithWays(chosen.make, behavior=behavior, seed=seed, **chosen.settings)
    model.learn(chosen.timesteps, Enough(1))
    first = model.first_success_timesteps or model.first_reward_timesteps
    return {
        **dict(zip(KEYS, (task, behavior, seed), strict=True)),
        "timesteps": model.num_timesteps,
        "ways": model.ways,
        "first_success_timesteps": first,
        "seconds": round(time.perf_counter() - begin, 1),
        "length": len(model.episodes[0]["actions"]) if model.episodes else None,
    }


def table(values: pd.DataFrame) -> str:
    """A row for each task: how many runs found the goal, with how many steps, in how long."""
    values = values.assign(kind=values["task"].str.replace(r"-seed\d+$", "", regex=True))
    rows = []
    for (kind, behavior), runs in values.groupby(["kind", "behavior"], sort=False):
        found = runs.dropna(subset="first_success_timesteps")
        firsts = found["first_success_timesteps"] / 1e6
        whole = _with_ways(found)
        seconds = found["seconds"].median()  # unknown of a run that was paused
        cells = [_span(firsts), _span(whole), "" if pd.isna(seconds) else f"{seconds:.0f}"]
        rows.append([f"{kind}, {behavior}", f"{len(found)} of {len(runs)}", *cells])
    head = ["Task, behavior", "Found", "First success (M steps)", "With all ways", "Seconds"]
    return markdown(head, rows)


def _with_ways(runs: pd.DataFrame) -> pd.Series:
    """Millions of steps with those of the ways."""
    return (runs["timesteps"] + runs["ways"]) / 1e6


def _span(numbers: pd.Series) -> str:
    """The median, and the least and the largest; empty where some are unknown."""
    if not len(numbers) or numbers.isna().any():
        return ""
    return f"{numbers.median():.2f} ({numbers.min():.2f} to {numbers.max():.2f})"


def in_words(values: pd.DataFrame) -> str:
    """In how many runs a search that knows no positions found the goals of mazes, and when."""
    runs = values[(values["behavior"] == "learned") & values["task"].isin([*MAZES, *DRAWN])]
    firsts, whole = runs["first_success_timesteps"] / 1e6, _with_ways(runs)
    n_mazes = runs["task"].nunique()
    return (
        f"In {n_mazes} mazes, {n_mazes - len(MAZES)} of them drawn at random, `GoExplore` came to "
        f"the goal in {firsts.notna().sum()} of {len(runs)} runs, by observations and the sparse "
        f"reward alone. It explored for {firsts.median():.1f} M steps (median), and for "
        f"{firsts.max():.1f} M at most. If it had walked to every restored state, it would have "
        f"needed {whole.median():.1f} M steps, and {whole.max():.1f} M at most."
    )


def robots_in_words(values: pd.DataFrame) -> str:
    """The same of ants among walls."""
    parts = []
    for task in ("AntTrap", "AntMaze"):
        runs = values[values["task"] == task]
        firsts = runs["first_success_timesteps"].dropna() / 1e6
        span = f"{firsts.min():.1f} to {firsts.max():.1f}"
        parts.append(f"of {task} in {len(firsts)} of {len(runs)} runs, after {span} M steps")
    return f"`GoExplore` came to the goal {', and '.join(parts)}."


def rooms_in_words(values: pd.DataFrame) -> str:
    """The same of mazes of rooms, with the steps of a search that cannot restore states."""
    is_rooms = values["task"].str.startswith("rooms-") & (values["behavior"] == "learned")
    runs = values[is_rooms]
    solved = runs.dropna(subset="first_success_timesteps")
    whole = _with_ways(solved)
    assert whole.notna().all(), "A run lacks its ways."
    return (
        f"In {runs['task'].nunique()} such mazes, with doors of 4 or 8 units, it came to the goal "
        f"in {len(solved)} of {len(runs)} runs. A search that cannot restore states may take the "
        f"actions to a state again: with all these steps it would have needed {whole.median():.1f} "
        f"M (median), and {whole.max():.1f} M at most."
    )


if __name__ == "__main__":
    app()
