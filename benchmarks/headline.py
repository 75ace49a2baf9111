"""Three numbers, and what they are beside, for the page that a reader opens first."""

from __future__ import annotations

import pandas as pd

from benchmarks.markdown import markdown
from benchmarks.results import read_runs
from benchmarks.speed_tables import HEADLINES, filled
from curiosity_algos.experiments.statistics import survival


def headline() -> str:
    """Goals found by evolution and by gradients, with curiosity and without, and steps a second."""
    mazes, ppo = read_runs("mazes"), read_runs("ppo")
    (speed,) = filled(HEADLINES[:1])
    rows = [
        [
            "Goals of three mazes found, told nothing",
            f"CuriosityES: {_found(mazes, 'CuriosityES')}",
            f"MAP-Elites, told the position: {_found(mazes, 'MAPElites')}",
        ],
        [
            "The same by Stable-Baselines3's PPO, with a bonus around its environment",
            f"PPO + APT: {_found(ppo, 'PPO + APT')}",
            f"PPO: {_found(ppo, 'PPO')}",
        ],
        speed[:3],
    ]
    return markdown(["", "Here", "Beside it"], rows)


def _found(runs: pd.DataFrame, algorithm: str) -> str:
    """How many runs found the goal, and the median time of first reward."""
    own = runs[runs["algorithm"] == algorithm]
    firsts, budget = own["first_success_timesteps"], own["timesteps"]
    median = survival(firsts, budget).median
    n_found = f"{firsts.notna().sum()} of {len(own)} runs"
    if median is None:
        return f"{n_found} within {budget.min() / 1e6:.0f} M steps"
    return f"{n_found}, within {median / 1e6:.1f} M steps (median)"
