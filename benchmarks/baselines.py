"""Who solves sparse tasks of physics without learning: `python -m benchmarks.baselines` counts.

Every episode begins at the task's fixed start or, where it draws them, at one of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice, repeat
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import pandas as pd
import typer
from gymnasium.utils import seeding

from benchmarks.results import FOLDER
from curiosity_algos import make_evaluator
from curiosity_gym.control.simulation import Simulation
from curiosity_gym.control.tasks import ControlTask
from curiosity_gym.locomotion.simulation import LocomotionSimulation

Actions = npt.NDArray[np.float32]

STRICT, RANDOM = {"success_threshold": 0.5}, {"random_start": True}
CONTROL: dict[str, tuple[str, dict[str, Any]]] = {
    "BallInCup": ("CuriosityControl-BallInCup-v0", {}),
    "Finger": ("CuriosityControl-Finger-v0", {}),
    "Stacker": ("CuriosityControl-Stacker-v0", {}),
    "Stacker, `success_threshold=0.5`": ("CuriosityControl-Stacker-v0", STRICT),
    "BallInCup, `random_start`": ("CuriosityControl-BallInCup-v0", RANDOM),
    "Finger, `random_start`": ("CuriosityControl-Finger-v0", RANDOM),
    "Stacker, `random_start`": ("CuriosityControl-Stacker-v0", RANDOM),
    "Stacker, `random_start`, `success_threshold=0.5`": (
        "CuriosityControl-Stacker-v0",
        {**RANDOM, **STRICT},
    ),
}
UNENDING = {"env_kwargs": {"terminate_when_unhealthy": False}}
LOCOMOTION: dict[str, tuple[str, dict[str, Any]]] = {
    "AntTrap": ("CuriosityLocomotion-AntTrap-v0", {}),
    "AntMaze": ("CuriosityLocomotion-AntMaze-v0", {}),
    "HumanoidTrap": ("CuriosityLocomotion-HumanoidTrap-v0", {}),
    "AntTrap, `terminate_when_unhealthy=False`": ("CuriosityLocomotion-AntTrap-v0", UNENDING),
    "AntMaze, `terminate_when_unhealthy=False`": ("CuriosityLocomotion-AntMaze-v0", UNENDING),
}
FILES = {"control_baselines": CONTROL, "locomotion_baselines": LOCOMOTION}
"""File, and its rows. Label: environment and its keywords."""
DEVIATIONS = (0.3, 1.0)
"""Of the random policies' weights."""
N_HELD = 10
"""Steps that a bang-bang action lasts."""


def main(
    only: Annotated[str | None, typer.Option(help="One of the rows; None: all.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of actions and policies.")] = 0,
    quick: Annotated[bool, typer.Option("--quick", help="Few episodes, and short.")] = False,
    out: Annotated[Path, typer.Option(help="Where the CSV files go.")] = FOLDER,
) -> None:
    """Count the episodes that succeed, and put each row into a CSV file once it is counted."""
    known = [label for rows in FILES.values() for label in rows]
    if only not in (None, *known):
        raise typer.BadParameter(f"The row is one of {'; '.join(known)}, not {only}.")
    n_episodes, shortened = (3, {"horizon": 20}) if quick else (200, {})
    policies = [f"policies of N(0, {deviation:g}²)" for deviation in DEVIATIONS]
    out.mkdir(parents=True, exist_ok=True)
    columns = ["Task", "No actions", "Uniform actions", f"+-1, held {N_HELD} steps", *policies]
    for file, rows in FILES.items():
        path = out / f"{file}.csv"
        table = pd.read_csv(path) if path.exists() else pd.DataFrame(columns=columns)
        table = table.set_index("Task")
        for label in [each for each in rows if only in (None, each)]:
            env_id, keywords = rows[label]
            env = gym.make(env_id, **keywords, **shortened)
            table.loc[label] = solved(env, n_episodes, seed)
            table.loc[[each for each in rows if each in table.index]].to_csv(path)


def solved(env: gym.Env[Any, Any], n_episodes: int, seed: int) -> list[int]:
    """Episodes solved by no, uniform and bang-bang actions, and by policies of each deviation."""
    children = np.random.SeedSequence(seed).spawn(2 + len(DEVIATIONS))
    first, second, *others = map(np.random.default_rng, children)
    shape = (n_episodes, *env.action_space.shape)
    draws = repeat(np.zeros(shape, np.float32)), uniform(first, shape), bang_bang(second, shape)
    counts = [open_loop(env, n_episodes, actions) for actions in draws]
    evaluator = make_evaluator(env)
    for rng, deviation in zip(others, DEVIATIONS, strict=True):
        parameters = rng.normal(0.0, deviation, (n_episodes, evaluator.n_parameters))
        # One by one, as policies that are evaluated together share their start.
        parts = parameters[:, None] if env.unwrapped.task.draws else [parameters]
        counts.append(
            sum(int(evaluator.evaluate(each, i).success.sum()) for i, each in enumerate(parts))
        )
    return counts


def uniform(rng: np.random.Generator, shape: tuple[int, ...]) -> Iterator[Actions]:
    """Independent actions, without end."""
    while True:
        yield rng.uniform(-1.0, 1.0, shape).astype(np.float32)


def bang_bang(rng: np.random.Generator, shape: tuple[int, ...]) -> Iterator[Actions]:
    """All the way to one side or the other, for some steps at a time, without end."""
    while True:
        yield from [rng.choice([-1.0, 1.0], shape).astype(np.float32)] * N_HELD


def open_loop(env: gym.Env[Any, Any], n_episodes: int, actions: Iterator[Actions]) -> int:
    """Episodes that succeed; random starts are those of seeds from 0 on.

    Args:
        env: A control or locomotion environment.
        n_episodes: n.
        actions: (n, A) of each step in [-1, 1], a row for each episode.
    """
    task, going = env.unwrapped.task, np.arange(n_episodes)
    is_control = isinstance(task, ControlTask)
    simulation = (Simulation if is_control else LocomotionSimulation)(task, n_episodes)
    simulation.reset(going, [seeding.np_random(seed)[0] for seed in range(n_episodes)])
    for action in islice(actions, env.unwrapped.horizon):
        scaled = action[going] * env.action_space.high
        going = going[~simulation.step(scaled, going)]
        if not len(going):
            break
    return int(simulation.success.sum())


if __name__ == "__main__":
    typer.run(main)
