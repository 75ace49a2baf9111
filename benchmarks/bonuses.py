"""What a bonus does for Stable-Baselines3's PPO, SAC and TD3: `python -m benchmarks.bonuses` tells.

Every run is one process on one thread, and leaves a folder; one that is finished is not done again,
one that was interrupted goes on.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from stable_baselines3.common.noise import NormalActionNoise

from benchmarks.learning import MAZES, WORLDS
from benchmarks.off_policy import TD3_SETTINGS, Stored
from benchmarks.results import FOLDER, collect
from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.bonuses.make import BONUSES
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.sweep import sweep

US = MAZES[1]
SPARSE = ("MountainCarContinuous-v0", "CuriositySparse-PointMaze_Large-v0")
"""Tasks of others' where reward is far away."""
SAMPLED = tuple(name for name, bonus in BONUSES.items() if bonus.episodes is Bonus.episodes)
"""Bonuses that a replay buffer takes: they ask for no episodes."""


# As docs/bonuses_sb3.md has it for sparse rewards.
PPO = RunSpec("PPO", US, 0, 1e6, settings={"n_steps": 64}, n_envs=16, repeat_action=10)
OFF_POLICY: dict[str, Any] = {
    "learning_starts": 1000,
    "train_freq": 4,
    "gradient_steps": 8,
    "policy_kwargs": {"net_arch": [64, 64], "optimizer_kwargs": {"fused": True}},  # for speed
}
LOUD = {
    "SAC": {"ent_coef": "auto_0.01", "target_entropy": 0.0},
    "TD3": {"action_noise": NormalActionNoise(np.zeros(2), np.ones(2))},
}
SAC, TD3 = (replace(PPO, algorithm=each, settings=OFF_POLICY | LOUD[each]) for each in LOUD)
FINDS = {"weight": 1.0, "norm_reward": False}
"""With this weight a policy explores on where it has found a goal."""
APT = replace(PPO, bonus="apt", bonus_kwargs=FINDS)
PARTS = {
    "power=1": replace(APT, bonus_kwargs=FINDS | {"power": 1.0}),
    "horizon=100": replace(APT, bonus_kwargs=FINDS | {"horizon": 100}),
    "n_steps=2048": replace(APT, settings={"n_steps": 2048}),
    "num_repeats=1": replace(APT, repeat_action=1),
}
"""Other settings of the recipe, one at a time."""
KEPT = replace(APT, timesteps=3e6, bonus_kwargs={})
"""With the weight and a budget at which the policy learns to come back to what it has found."""
OWN_SIZE = replace(KEPT, settings=PPO.settings | {"normalize_advantage": False})
"""PPO divides the advantages of each batch by their deviation, so that a batch in which nothing but
the bonus pays changes the policy as much as one with a success; here they keep their size."""
RECIPE = replace(KEPT, settle=6e4)
"""As docs/bonuses_sb3.md has it: with steps that shrink while half of the episodes succeed."""
WEIGHTS = (0.002, 0.02, 0.2, 2.0)
DRAWN = ("perfect-8x8-seed10", "loops-8x8-seed10", "rooms-4x4-door8-seed10")
"""Mazes drawn at random, on none of which anything was tuned."""
ANT = RunSpec("PPO", WORLDS[0], 0, 1e6, n_envs=8)
"""With the defaults of PPO; its bonus is the one that CuriosityES has."""
ANT_APT = replace(ANT, bonus="apt", bonus_kwargs=FINDS | {"horizon": 100, "power": 1.0})


def runs_of(run: RunSpec, envs: Iterable[str], bonuses: Iterable[str | None]) -> list[RunSpec]:
    """A run in each environment with each bonus, of E3B the paper's."""
    own: dict[str | None, dict[str, Any]] = {None: {}, "e3b": {**FINDS, "log": False}}
    return [
        replace(run, env=env, bonus=bonus, bonus_kwargs=own.get(bonus, FINDS))
        for env, bonus in product(envs, bonuses)
    ]


def in_all(name: str, run: RunSpec) -> dict[str, list[RunSpec]]:
    """A run in the mazes, in PointMaze and in each maze that was drawn, by the name of a table."""
    general = replace(run, env="CuriosityMaze-v0")
    drawn = {
        f"{name}/{each}": [replace(general, env_kwargs={"layout": each}, variant=each)]
        for each in DRAWN
    }
    return {
        name: [replace(run, env=env) for env in MAZES],
        f"{name}/point": [replace(run, env=SPARSE[1])],
        **drawn,
    }


RUNS: dict[str, list[RunSpec]] = {
    "ppo": runs_of(PPO, MAZES, (None, *BONUSES)),
    **in_all("recipe", RECIPE),
    **in_all("constant", KEPT),
    **in_all("own_size", OWN_SIZE),
    "weights": [
        replace(
            KEPT,
            env=env,
            bonus_kwargs={"weight": weight, "norm_reward": False},
            variant=f"weight={weight:g}",
        )
        for env, weight in product((US, MAZES[2], SPARSE[1]), WEIGHTS)
    ],
    "sparse": runs_of(PPO, SPARSE, (None, "apt", "ngu", "rnd")),
    **{f"ppo_parts/{part}": [replace(run, variant=part)] for part, run in PARTS.items()},
    "off_policy/sac": runs_of(SAC, MAZES, (None, *SAMPLED)),
    "off_policy/td3": runs_of(TD3, MAZES, (None, *SAMPLED)),
    "off_policy/stored": runs_of(Stored(**vars(SAC) | {"variant": "stored"}), MAZES, ["apt"]),
    "locomotion/ppo": [replace(run, env=env) for run in (ANT, ANT_APT) for env in WORLDS],
    "td3": [RunSpec("TD3", US, 0, 4e5, settings=TD3_SETTINGS), RunSpec("TD3ICM", US, 0, 4e5)],
}
"""What is trained for each name, timesteps being the environment's; before a "/" is its table."""


def main(
    name: Annotated[str, typer.Argument(help=f"One of {', '.join(RUNS)}.")] = "ppo",
    seeds: str = "0,1,2,3,4",
    timesteps: Annotated[float | None, typer.Option(help="None: the table's.")] = None,
    runs: Path = Path("runs"),
    jobs: int = 2,
    out: Annotated[Path, typer.Option(help="Where the CSV files go.")] = FOLDER,
) -> None:
    """Train every run with every seed, and write the CSV files."""
    if name not in RUNS:
        raise typer.BadParameter(f"The name is one of {', '.join(RUNS)}, not {name}.")
    specs = [
        replace(run, seed=seed, timesteps=(timesteps or run.timesteps) // run.repeat_action)
        for run, seed in product(RUNS[name], map(int, seeds.split(",")))
    ]
    table = name.partition("/")[0]
    sweep(specs, runs / table, jobs=jobs, interval=600.0)
    collect(runs / table, table, out)


if __name__ == "__main__":
    typer.run(main)
