"""What a bonus does for Stable-Baselines3's PPO, SAC and TD3: `python -m benchmarks.bonuses` tells.

Every run is one process on one thread, and leaves a folder; one that is finished is not done again.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch as th
import typer
from gymnasium.wrappers import RepeatAction
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.vec_env import VecEnv

from benchmarks.learning import MAZES, WORLDS
from benchmarks.off_policy import make_td3
from benchmarks.pool import run_all
from benchmarks.results import FOLDER, collect
from curiosity_algos import TD3ICM, BonusReplayBuffer, BonusVecEnvWrapper
from curiosity_algos.bonuses.make import BONUSES
from curiosity_algos.experiments import RunFolder, SaveRun

US = MAZES[1]
SPARSE = ("MountainCarContinuous-v0", "CuriositySparse-PointMaze_Large-v0")
"""Tasks of others' where reward is far away."""
SAMPLED = tuple(name for name, bonus in BONUSES.items() if not hasattr(bonus, "episodes"))
"""Bonuses that a replay buffer takes: they ask for no episodes."""
PARTS: dict[str, dict[str, Any]] = {
    "power=1": {"power": 1.0},
    "horizon=100": {"horizon": 100},
    "n_steps=2048": {"n_steps": 2048},
    "num_repeats=1": {"num_repeats": 1},
}
"""Other settings of `ppo`, one at a time, by the names of their folders."""


def ppo(
    seed: int,
    bonus: str | None,
    env: str,
    *,
    num_repeats: int = 10,
    n_steps: int = 64,
    **bonus_kwargs: Any,
) -> PPO:
    """SB3's PPO with or without a bonus, as docs/bonuses_sb3.md has it for sparse rewards."""
    venv = _held(env, seed, num_repeats)
    if bonus is not None:
        venv = BonusVecEnvWrapper(
            venv, bonus=bonus, bonus_kwargs=bonus_kwargs, seed=seed, device="cpu"
        )
    return PPO("MlpPolicy", venv, n_steps=n_steps, seed=seed, device="cpu")


def off_policy(
    seed: int, bonus: str | None, env: str, *, algorithm: type[SAC | TD3], stored: bool = False
) -> SAC | TD3:
    """SB3's SAC or TD3, as docs/bonuses_sb3.md has them for sparse rewards.

    A stored bonus stays as it was collected.
    """
    venv = _held(env, seed, 10)
    buffer: dict[str, Any] = {}
    if bonus is not None and stored:
        venv = BonusVecEnvWrapper(venv, bonus=bonus, seed=seed, device="cpu")
    elif bonus is not None:
        keywords = {"bonus": bonus}
        buffer = {"replay_buffer_class": BonusReplayBuffer, "replay_buffer_kwargs": keywords}
    noise = NormalActionNoise(np.zeros(2), np.ones(2))
    loud = {SAC: {"ent_coef": "auto_0.01", "target_entropy": 0.0}, TD3: {"action_noise": noise}}
    return algorithm(
        "MlpPolicy",
        venv,
        learning_starts=1000,
        train_freq=4,
        gradient_steps=8,
        policy_kwargs={"net_arch": [64, 64], "optimizer_kwargs": {"fused": True}},  # for speed
        seed=seed,
        device="cpu",
        **loud[algorithm],
        **buffer,
    )


def _held(env: str, seed: int, num_repeats: int) -> VecEnv:
    """Sixteen environments whose actions are held."""
    return make_vec_env(env, 16, seed, wrapper_class=lambda each: RepeatAction(each, num_repeats))


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
    "sparse": {
        f"{bonus} {env}": partial(ppo, bonus=bonus, env=env)
        for bonus, env in product((None, "apt", "ngu", "rnd"), SPARSE)
    },
    **{
        f"ppo_parts/{part}": {f"apt/{US}": partial(ppo, bonus="apt", env=US, **changes)}
        for part, changes in PARTS.items()
    },
    **{
        f"off_policy/{name}": {
            f"{bonus} {env}": partial(off_policy, bonus=bonus, env=env, algorithm=algorithm)
            for bonus, env in product((None, *SAMPLED), MAZES)
        }
        for name, algorithm in (("sac", SAC), ("td3", TD3))
    },
    "off_policy/stored": {
        f"apt/{env}": partial(off_policy, bonus="apt", env=env, algorithm=SAC, stored=True)
        for env in MAZES
    },
    "locomotion/ppo": {
        f"{bonus} {env}": partial(ant_ppo, bonus=bonus, env=env)
        for env, bonus in product(WORLDS, (None, "apt"))
    },
    "td3": {
        "TD3": lambda seed: make_td3(US, seed=seed),
        "TD3ICM": lambda seed: TD3ICM(US, seed=seed, device="cpu"),
    },
}
"""What makes the model of each row, by the name of the table, which ends at a "/"."""
TIMESTEPS = {
    **dict.fromkeys(("ppo", "sparse", "ppo_parts", "off_policy", "locomotion"), 1e6),
    "td3": 4e5,
}
"""Steps of the environment, by table."""


def train(name: str, variant: str, seed: int, timesteps: float, runs: Path) -> None:
    """Train one variant, from the beginning: Stable-Baselines3 does not resume bit for bit."""
    th.set_num_threads(1)
    folder = RunFolder(runs / name / variant / str(seed))
    model = VARIANTS[name][variant](seed)
    n_steps = int(timesteps) // n_held(model)
    if folder.result().get("timesteps", 0) >= n_steps:
        return
    shutil.rmtree(folder.path, ignore_errors=True)
    model.learn(n_steps, callback=SaveRun(folder.path, interval=600.0))


def n_held(model: BaseAlgorithm) -> int:
    """Steps of the environment in one of the algorithm's."""
    envs = model.get_env()
    assert envs is not None
    return int(envs.get_attr("num_repeats")[0]) if envs.env_is_wrapped(RepeatAction)[0] else 1


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
    table = name.partition("/")[0]
    budget = TIMESTEPS[table] if timesteps is None else timesteps
    tasks = product([name], VARIANTS[name], map(int, seeds.split(",")), [budget], [runs])
    run_all(train, tasks, jobs)
    collect(runs / table, table, out)


if __name__ == "__main__":
    typer.run(main)
