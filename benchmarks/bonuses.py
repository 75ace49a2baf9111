"""What a bonus does for Stable-Baselines3's PPO and TD3: `python -m benchmarks.bonuses` tells.

Every run is one process on one thread; results do not depend on how many run at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
import torch as th
import typer
from scipy.stats import bootstrap
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.env_util import make_vec_env

from benchmarks.off_policy import make_td3
from benchmarks.runs import markdown, run_all
from curiosity_algos import TD3ICM, BonusVecEnvWrapper, ExplorationCallback

N_ENVS = 8
"""Environments that PPO learns from side by side."""


def ppo(env: str, seed: int, bonus: str | None) -> PPO:
    """SB3's PPO with its defaults, with or without a bonus in its reward."""
    venv = make_vec_env(env, n_envs=N_ENVS, seed=seed)
    if bonus is not None:
        venv = BonusVecEnvWrapper(venv, bonus=bonus, seed=seed, device="cpu")
    return PPO("MlpPolicy", venv, seed=seed, device="cpu")


VARIANTS: dict[str, Callable[[str, int], BaseAlgorithm]] = {
    "PPO": lambda env, seed: ppo(env, seed, None),
    "PPO + ICM": lambda env, seed: ppo(env, seed, "icm"),
    "PPO + RND": lambda env, seed: ppo(env, seed, "rnd"),
    "TD3": lambda env, seed: make_td3(env, seed=seed),
    "TD3ICM": lambda env, seed: TD3ICM(env, seed=seed, device="cpu"),
}
"""What makes the model of each row of the table."""


@dataclass(frozen=True)
class Result:
    """What one run came to."""

    variant: str
    seed: int
    coverage: float
    first_success: int | None
    best_return: float
    seconds: float


def run(variant: str, seed: int, env: str, timesteps: float) -> Result:
    """Train one variant."""
    th.set_num_threads(1)
    began = time.process_time()
    model = VARIANTS[variant](env, seed)
    coverage = ExplorationCallback()
    model.learn(int(timesteps), callback=coverage)
    share = coverage.coverage.reachable
    assert share is not None
    seconds = time.process_time() - began
    first, best = coverage.first_success_timesteps, float(coverage.best_return)
    return Result(variant, seed, share, first, best, seconds)


def table(results: list[Result]) -> str:
    """Markdown: a row for each variant; coverage with a bootstrapped interval of its mean."""
    columns = [
        "Algorithm",
        "Coverage, reachable (%)",
        "Mean and 95 % interval",
        "First reward (M steps)",
        "Best return",
        "CPU seconds a run",
    ]
    variants = dict.fromkeys(result.variant for result in results)
    groups = [[result for result in results if result.variant == each] for each in variants]
    return markdown(columns, [_row(group) for group in groups])


def _row(group: list[Result]) -> list[str]:
    shares = 100 * np.array([result.coverage for result in group])
    firsts = (result.first_success for result in group)
    return [
        group[0].variant,
        " / ".join(f"{share:.1f}" for share in shares),
        _interval(shares),
        " / ".join("never" if first is None else f"{first / 1e6:.2f}" for first in firsts),
        " / ".join(f"{result.best_return:.2f}" for result in group),
        f"{np.mean([result.seconds for result in group]):.0f}",
    ]


def _interval(values: np.ndarray) -> str:
    if len(values) < 2:
        return f"{values.mean():.1f}"
    rng = np.random.default_rng(0)
    found = bootstrap((values,), np.mean, method="percentile", random_state=rng)
    low, high = found.confidence_interval
    return f"{values.mean():.1f} ({low:.1f} to {high:.1f})"


def main(
    timesteps: float = 1e6,
    env: str = "CuriosityMaze-US-v0",
    variants: str = ",".join(VARIANTS),
    first_seed: int = 0,
    n_seeds: int = 5,
    jobs: int = 2,
    out: Path | None = None,
) -> None:
    """Train every variant with every seed, and print the table."""
    seeds = range(first_seed, first_seed + n_seeds)
    tasks = list(product(variants.split(","), seeds, [env], [timesteps]))
    print(table(run_all(run, tasks, jobs=jobs, out=out)))


if __name__ == "__main__":
    typer.run(main)
