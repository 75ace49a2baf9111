"""What the mazes of the authors' public code make easy: `python -m benchmarks.dynamics` tells.

There robots bounce off walls, move at up to 500 units a second, and must come within 1 of the goal.
Random policies are those of a strategy's first generation; searches have the paper's settings with
the code's step, and end with their first success. What the CSV files have is not done again.
"""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import pandas as pd
import torch as th
import typer

import curiosity_algos
from benchmarks.measure import markdown
from benchmarks.paper import PUBLIC_STEP
from benchmarks.plan import MAZES
from benchmarks.results import FOLDER, add_rows, recorded
from benchmarks.until_found import UntilFound, in_words
from curiosity_algos import make_evaluator
from curiosity_algos.experiments.canvas import short_name

LARGEST, N_LAST = 100.0, 16 * 2 + 2
"""Acceleration of `STRONG`, and parameters of the last layer."""
CODE: dict[str, Any] = {"restitution": 1.0, "max_speed": 500.0, "goal_radius": 1.0}
STRONG = "the code's, of Curiosity-ES"
"""Its actions are `100 tanh(z / 100)` of a network's output z, those of others `5 tanh(z)`."""
DYNAMICS: dict[str, dict[str, Any]] = {
    "as here": {},
    "elastic walls": {"restitution": 1.0},
    "the code's": CODE,
    STRONG: {**CODE, "max_acceleration": LARGEST},
}
"""Keywords of the mazes."""
STRONG_SIGMA = {MAZES[2]: 0.1}
"""Its deviation of the weights by maze; .05 in others."""
N_POLICIES, SIGMA = 2000, 0.5
"""Random policies, and the deviation of their weights: the paper's `sigma`."""
STRATEGIES = ("CanonicalES", "NSES", "CuriosityES")
ALGORITHMS = (*STRATEGIES, "NSLC", "AURORA", "MAPElites", "CMAME")
POLICIES, KEYS = ["dynamics", "env"], ["algorithm", "env", "seed"]


def main(
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each, from seed 0 on.")] = 5,
    timesteps: Annotated[float, typer.Option(help="Of a run, at most.")] = 2.24e7,
    policies: Annotated[int, typer.Option(min=1, help="Random policies.")] = N_POLICIES,
    out: Annotated[Path, typer.Option(help="Where the CSV files go.")] = FOLDER,
) -> None:
    """Play random policies with each dynamics, and search with the code's."""
    th.set_num_threads(1)
    path = out / "dynamics_random.csv"
    done = recorded(path, POLICIES)
    for key in product(DYNAMICS, MAZES):
        if key not in done:
            add_rows(pd.DataFrame([play(*key, policies)]), path, POLICIES)
    path = out / "dynamics.csv"
    done = recorded(path, KEYS)
    for seed, env, algorithm in product(range(seeds), MAZES, ALGORITHMS):
        key = algorithm, env, seed
        if key not in done:
            add_rows(pd.DataFrame([search(*key, timesteps)]), path, KEYS)


def play(dynamics: str, env: str, n: int) -> dict[str, Any]:
    """How many of n random policies come to the goal."""
    is_strong = dynamics == STRONG
    evaluator = make_evaluator(gym.make(env, **DYNAMICS[dynamics]), n_threads=1)
    shape = n, evaluator.n_parameters
    sigma = STRONG_SIGMA.get(env, 0.05) if is_strong else SIGMA
    drawn = np.random.default_rng(0).normal(0.0, sigma, shape).astype(np.float32)
    played = evaluator.evaluate(strong(drawn) if is_strong else drawn)
    return {"dynamics": dynamics, "env": env, "policies": n, "found": int(played.success.sum())}


def strong(parameters: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Policies with a hundredth of the output of these, (n, n_parameters)."""
    weaker = parameters.copy()
    weaker[:, -N_LAST:] /= LARGEST
    return weaker


def search(algorithm: str, env: str, seed: int, timesteps: float) -> dict[str, Any]:
    """A run: timesteps until its first success, or until its end."""
    name, _, value = PUBLIC_STEP.partition("=")
    step = {name: value} if algorithm in STRATEGIES else {}
    model = getattr(curiosity_algos, algorithm).from_preset(
        "paper", gym.make(env, **CODE), seed=seed, n_threads=1, device="cpu", **step
    )
    model.learn(timesteps, UntilFound())
    return {
        **dict(zip(KEYS, (algorithm, env, seed), strict=True)),
        "timesteps": model.num_timesteps,
        "first_success_timesteps": model.first_success_timesteps,
    }


def random_table(values: pd.DataFrame) -> str:
    """A row for each dynamics: how many random policies come to the goal of each maze."""
    (n,) = values["policies"].unique()
    found = values.set_index(POLICIES)["found"]
    rows = [[each, *(str(found[each, env]) for env in MAZES)] for each in DYNAMICS]
    return markdown([f"Dynamics, of {n:,} policies", *map(short_name, MAZES)], rows)


def table(values: pd.DataFrame) -> str:
    """A row for each algorithm: how many runs found each goal there, and when."""
    firsts = values.set_index(["algorithm", "env"])["first_success_timesteps"]
    rows = [[name, *(in_words(firsts[[(name, env)]]) for env in MAZES)] for name in ALGORITHMS]
    return markdown(["Algorithm", *map(short_name, MAZES)], rows)


if __name__ == "__main__":
    typer.run(main)
