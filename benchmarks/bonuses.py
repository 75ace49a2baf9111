"""What a bonus does for Stable-Baselines3's PPO and TD3: `python -m benchmarks.bonuses` tells.

Every run is one process on one thread, and leaves a folder; one that is finished is not done again.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated

import torch as th
import typer
from gymnasium.wrappers import RepeatAction
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.env_util import make_vec_env

from benchmarks.off_policy import make_td3
from benchmarks.pool import run_all
from benchmarks.results import FOLDER, collect
from curiosity_algos import TD3ICM, BonusVecEnvWrapper
from curiosity_algos.bonuses.make import BONUSES
from curiosity_algos.experiments import RunFolder, SaveRun

MAZES = ("CuriosityMaze-Snake-v0", "CuriosityMaze-US-v0", "CuriosityMaze-Hard-v0")
US = MAZES[1]
ANTS = ("CuriosityLocomotion-AntTrap-v0", "CuriosityLocomotion-AntMaze-v0")
N_REPEATS = 10
"""Steps that PPO holds an action in mazes."""


def ppo(seed: int, bonus: str | None, env: str) -> PPO:
    """SB3's PPO with or without a bonus, as docs/bonuses.md has it for sparse rewards."""
    venv = make_vec_env(env, 16, seed, wrapper_class=lambda each: RepeatAction(each, N_REPEATS))
    if bonus is not None:
        venv = BonusVecEnvWrapper(venv, bonus=bonus, seed=seed, device="cpu")
    return PPO("MlpPolicy", venv, n_steps=64, seed=seed, device="cpu")


def ant_ppo(seed: int, bonus: str | None, env: str) -> PPO:
    """SB3's PPO with its defaults, with or without the bonus that CuriosityES has."""
    venv = make_vec_env(env, n_envs=8, seed=seed)
    if bonus is not None:
        venv = BonusVecEnvWrapper(
            venv,
            bonus=bonus,
            bonus_kwargs={"horizon": 100, "power": 1.0},
            seed=seed,
            device="cpu",
        )
    return PPO("MlpPolicy", venv, seed=seed, device="cpu")


VARIANTS: dict[str, dict[str, Callable[[int], BaseAlgorithm]]] = {
    "ppo": {
        f"{bonus} {env}": partial(ppo, bonus=bonus, env=env)
        for bonus, env in product((None, *BONUSES), MAZES)
    },
    "locomotion/ppo": {
        f"{bonus} {env}": partial(ant_ppo, bonus=bonus, env=env)
        for env, bonus in product(ANTS, (None, "apt"))
    },
    "td3": {
        "TD3": lambda seed: make_td3(US, seed=seed),
        "TD3ICM": lambda seed: TD3ICM(US, seed=seed, device="cpu"),
    },
}
"""What makes the model of each row, by the name of the table, which ends at a "/"."""
TIMESTEPS = {"ppo": 1e6, "locomotion/ppo": 1e6, "td3": 4e5}
HELD = {"ppo": N_REPEATS}
"""Steps of the environment in one of the algorithm's, where they are not the same."""


def train(name: str, variant: str, seed: int, timesteps: float, runs: Path) -> None:
    """Train one variant, from the beginning: Stable-Baselines3 does not resume bit for bit."""
    th.set_num_threads(1)
    folder = RunFolder(runs / name / variant / str(seed))
    n_steps = int(timesteps) // HELD.get(name, 1)
    if folder.result().get("timesteps", 0) >= n_steps:
        return
    shutil.rmtree(folder.path, ignore_errors=True)
    model = VARIANTS[name][variant](seed)
    model.learn(n_steps, callback=SaveRun(folder.path, interval=600.0))


def main(
    name: Annotated[str, typer.Argument(help=f"One of {', '.join(VARIANTS)}.")] = "ppo",
    seeds: str = "0,1,2,3,4",
    timesteps: Annotated[float | None, typer.Option(help="None: the table's.")] = None,
    runs: Path = Path("runs"),
    jobs: int = 2,
    out: Annotated[Path, typer.Option(help="Where the CSV files go.")] = FOLDER,
) -> None:
    """Train every variant with every seed, and write the CSV files."""
    if name not in VARIANTS:
        raise typer.BadParameter(f"The name is one of {', '.join(VARIANTS)}, not {name}.")
    budget = TIMESTEPS[name] if timesteps is None else timesteps
    tasks = product([name], VARIANTS[name], map(int, seeds.split(",")), [budget], [runs])
    run_all(train, tasks, jobs)
    table = name.partition("/")[0]
    collect(runs / table, table, out, n_held=HELD.get(table, 1))


if __name__ == "__main__":
    typer.run(main)
