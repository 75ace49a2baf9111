"""What a bonus does for PPO behind MiniGrid's doors: `python -m benchmarks.minigrid` tells.

It needs MiniGrid, which the extra `dev` has. A run of DoorKey is three minutes of one thread, one
of KeyCorridor twelve; a GPU is taken where there is one. What is in the folder of runs is not done
again. Measures are those of DEIR's code, https://github.com/swan-utokyo/deir.
"""

from __future__ import annotations

from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import pandas as pd
import torch as th
import typer
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env

from benchmarks.measure import markdown
from benchmarks.pool import run_all
from benchmarks.results import FOLDER, add_rows
from curiosity_algos import BonusVecEnvWrapper, SmallCNN
from curiosity_algos.bonuses.make import BONUSES
from curiosity_algos.experiments.canvas import short_name

FRAMES = {"MiniGrid-DoorKey-8x8-v0": 122_880, "MiniGrid-KeyCorridorS3R3-v0": 491_520}
"""Of each task."""
EVERY = 8192
"""Frames between two rows of a run."""
POLICY = {
    "features_extractor_class": SmallCNN,
    "features_extractor_kwargs": {"batch_norm": True},
    "normalize_images": False,
}
SETTINGS = {
    "n_steps": 128,
    "batch_size": 256,
    "learning_rate": 1e-3,
    "n_epochs": 4,
    "ent_coef": 0.01,
    "policy_kwargs": POLICY,
}
"""Of PPO."""


class Returns(BaseCallback):
    """Keeps the mean return of the last 100 episodes, every so many frames."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[tuple[int, float]] = []

    def _on_step(self) -> bool:
        if self.num_timesteps % EVERY == 0:
            episodes = [episode["r"] for episode in self.model.ep_info_buffer or ()]
            self.rows.append((self.num_timesteps, np.mean(episodes) if episodes else 0.0))
        return True


def make_env(env: str) -> gym.Env[Any, Any]:
    """A task whose observations are images of the tiles ahead, without the mission's text."""
    from minigrid.wrappers import ImgObsWrapper

    return ImgObsWrapper(gym.make(env))


def make_ppo(env: str, bonus: str, seed: int) -> PPO:
    """SB3's PPO with or without a bonus, as docs/minigrid.md has it."""
    venv = make_vec_env(partial(make_env, env), n_envs=16, seed=seed)
    if bonus != "none":
        venv = BonusVecEnvWrapper(venv, bonus=bonus, weight=0.1, norm_reward=False, seed=seed)
    return PPO("CnnPolicy", venv, seed=seed, **SETTINGS)


def train(runs: Path, env: str, bonus: str, seed: int) -> None:
    """Train a run and write its rows, the frames so far and the mean return, unless it has them."""
    path = runs / f"{env}-{bonus}-{seed}.csv"
    if path.exists():
        return
    th.set_num_threads(1)
    returns = Returns()
    make_ppo(env, bonus, seed).learn(FRAMES[env], callback=returns)
    rows = pd.DataFrame(returns.rows, columns=["frames", "return"])
    algorithm = "PPO" if bonus == "none" else f"PPO + {BONUSES[bonus].__name__}"
    path.parent.mkdir(parents=True, exist_ok=True)
    rows.assign(algorithm=algorithm, env=env, seed=seed).to_csv(path, index=False)


def main(
    bonuses: str = ",".join(("none", *BONUSES)),
    seeds: str = "0,1,2,3,4",
    runs: Path = Path("runs/minigrid"),
    jobs: int = 2,
    out: Annotated[Path, typer.Option(help="Where the CSV file goes.")] = FOLDER,
) -> None:
    """Train every task with every bonus and seed, and put their rows into the CSV file."""
    run_all(train, product([runs], FRAMES, bonuses.split(","), map(int, seeds.split(","))), jobs)
    table = pd.concat(map(pd.read_csv, sorted(runs.glob("*.csv"))))
    add_rows(table, out / "minigrid.csv", ["algorithm", "env", "seed"])


def table(values: pd.DataFrame) -> str:
    """A row for each algorithm: when the mean return of each seed is .9, and what it ends at."""
    rows = []
    for (env, algorithm), runs in values.groupby(["env", "algorithm"], sort=False):
        last = runs.groupby("seed")["return"].last()
        solved = runs[runs["return"] >= 0.9].groupby("seed")["frames"].min().reindex(last.index)
        frames = " / ".join("never" if pd.isna(each) else f"{each:,.0f}" for each in solved)
        returns = " / ".join(f"{each:.2f}" for each in last)
        rows.append([env, -last.mean(), [short_name(env), algorithm, frames, returns]])
    head = ["Task", "Algorithm", "Frames to a mean return of .9", "Mean return at the end"]
    return markdown(head, [cells for *_, cells in sorted(rows, key=lambda row: row[:2])])


if __name__ == "__main__":
    typer.run(main)
