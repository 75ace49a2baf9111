"""Ranges that Optuna tries for each algorithm, in rl-zoo3's form: `rl_zoo3_train.py` adds them.

rl-zoo3 asks for two functions of an algorithm: one that samples keywords in a trial, and one that
makes keywords of what a trial has sampled. Ranges are around the defaults, wide enough for other
environments than the mazes; change them to your own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from curiosity_algos.common.names import find_algorithm

Keywords = dict[str, Any]

NET_ARCHS = {"tiny": [16], "small": [32, 16], "square": [32, 32], "medium": [64, 64]}


class Whole(NamedTuple):
    """A whole number; the algorithm's keyword is its power of 2 where the name says `_pow`."""

    low: int
    high: int

    def suggest(self, trial: Any, name: str) -> int:
        """A value for an Optuna trial."""
        value: int = trial.suggest_int(name, self.low, self.high)
        return value


class Real(NamedTuple):
    """A number, even over its logarithm unless `log` is False."""

    low: float
    high: float
    log: bool = True

    def suggest(self, trial: Any, name: str) -> float:
        """A value for an Optuna trial."""
        value: float = trial.suggest_float(name, self.low, self.high, log=self.log)
        return value


class Choice(NamedTuple):
    """One of some words."""

    words: tuple[str, ...]

    def suggest(self, trial: Any, name: str) -> str:
        """A value for an Optuna trial."""
        word: str = trial.suggest_categorical(name, self.words)
        return word


Space = Mapping[str, Whole | Real | Choice]

POPULATION: Space = {
    "net_arch": Choice(tuple(NET_ARCHS)),
    "population_size_pow": Whole(4, 8),
    "sigma": Real(0.03, 1.0),
}
STRATEGY: Space = {
    **POPULATION,
    "parents_share": Real(0.1, 0.5, log=False),
    "learning_rate": Real(0.1, 3.0),
}
BONUS: Space = {
    "bonus": Choice(("apt", "icm", "rnd")),
    "bonus_learning_rate": Real(1e-5, 1e-2),
    "n_updates_pow": Whole(3, 7),
    "batch_size_pow": Whole(6, 10),
}
SPACES: dict[str, Space] = {
    "CanonicalES": STRATEGY,
    "CuriosityES": {**STRATEGY, **BONUS},
    "NSES": {**STRATEGY, "k": Whole(3, 30)},
    "NSLC": {**POPULATION, "n_parents": Whole(2, 16), "k": Whole(3, 30)},
    "MAPElites": POPULATION,
    "CMAME": {**POPULATION, "restart_interval": Whole(3, 50)},
    "CuriosityMAPElites": {**POPULATION, **BONUS, "tournament_size_pow": Whole(1, 6)},
    "AURORA": {
        **POPULATION,
        "latent_size": Whole(2, 16),
        "trajectory_share": Real(0.2, 1.0, log=False),
    },
    "GoExplore": {
        "population_size_pow": Whole(4, 8),
        "n_steps": Whole(20, 300),
        "archive_size": Whole(200, 2000),
        "sigma": Real(0.03, 1.0),
    },
    "TD3ICM": {
        "net_arch": Choice(tuple(NET_ARCHS)),
        **BONUS,
        "bonus_learning_rate": Real(1e-7, 1e-3),  # a fast one outruns the policy
        "weight": Real(0.01, 10.0),
        "learning_rate": Real(1e-5, 1e-3),
        "tau": Real(1e-3, 0.1),
        "one_minus_gamma": Real(1e-3, 0.1),
    },
}
"""Of each algorithm what is sampled, by the names of the trial's parameters."""


def sampler(algorithm: str) -> Callable[[Any, int, int, Keywords], Keywords]:
    """The function of rl-zoo3 that samples an algorithm's keywords in an Optuna trial.

    Args:
        algorithm: Its name, in any spelling.

    Raises:
        ValueError: If there is none.
    """
    space = SPACES[find_algorithm(algorithm).__name__]

    def sample(trial: Any, n_actions: int, n_envs: int, additional_args: Keywords) -> Keywords:
        return convert({name: each.suggest(trial, name) for name, each in space.items()})

    return sample


def convert(sampled: Mapping[str, Any]) -> Keywords:
    """The keywords that the parameters of a trial stand for."""
    keywords: Keywords = {}
    for name, value in sampled.items():
        if name.endswith("_pow"):
            keywords[name.removesuffix("_pow")] = 2**value
        else:
            keywords[name] = value
    if "net_arch" in keywords:
        keywords["policy_kwargs"] = {"net_arch": NET_ARCHS[keywords.pop("net_arch")]}
    if "parents_share" in keywords:
        share = keywords.pop("parents_share")
        keywords["n_parents"] = max(1, round(share * keywords["population_size"]))
    if "bonus_learning_rate" in keywords:
        keywords["bonus_kwargs"] = {"learning_rate": keywords.pop("bonus_learning_rate")}
    if "one_minus_gamma" in keywords:
        keywords["gamma"] = 1.0 - keywords.pop("one_minus_gamma")
    return keywords
