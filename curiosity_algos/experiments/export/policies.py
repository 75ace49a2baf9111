"""The policies in the folder of a population algorithm's run."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
import pandas as pd

from curiosity_algos.algorithms.go_explore import GoExplore
from curiosity_algos.common.arrays import Float32Array, Int64Array
from curiosity_algos.common.names import ALGORITHMS, find_algorithm
from curiosity_algos.evaluation.mlp import Mlp
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.run_folder import REWARDING, damaged, read_arrays
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.loops.model_file import load_policy
from curiosity_algos.loops.quality_diversity import QualityDiversity
from curiosity_algos.state.file import read

POLICIES = {"elites": "model.zip", "rewarding": "rewarding.npz", "sample": "sample.npz"}
"""By kind the file of a checkpoint with policies of that kind."""


class Policies(NamedTuple):
    """Policies of a checkpoint, and the seeds (n,) of the resets of their episodes."""

    mlp: Mlp
    parameters: Float32Array
    seeds: Int64Array
    timesteps: int

    def select(self, n: int) -> Policies:
        """At most n of the policies, without repetitions of the same parameters and seed."""
        rows = [row.tobytes() for row in self.parameters]
        is_repeated = pd.DataFrame({"row": rows, "seed": self.seeds}).duplicated()
        places = draw(np.flatnonzero(~is_repeated), n)
        return self._replace(parameters=self.parameters[places], seeds=self.seeds[places])


def draw(places: Int64Array, n: int) -> Int64Array:
    """At most n of the places, drawn uniformly, in order."""
    if len(places) <= n:
        return places
    return np.sort(np.random.default_rng(0).choice(places, n, replace=False))


def population_algorithm(run: Run) -> type[EvolutionaryAlgorithm]:
    """The class of a run's algorithm; ValueError if it evolves no population."""
    name = run.description["algorithm"]
    if name in ALGORITHMS:
        cls = find_algorithm(name)
        if issubclass(cls, EvolutionaryAlgorithm) and not issubclass(cls, GoExplore):
            return cls
    raise ValueError(
        f"`run` must be of an algorithm that evolves policies, {run} is of {name}, which does not."
    )


def read_policies(run: Run, kind: str, env: gym.Env[Any, Any]) -> Policies:
    """All policies of one of the kinds in `POLICIES`; ValueError if the run has none."""
    cls = population_algorithm(run)
    if kind == "elites" and not issubclass(cls, QualityDiversity):
        raise ValueError(
            "`policies` must be rewarding or sample for an algorithm without an archive, such as "
            f"{cls.__name__}."
        )
    return run.folder.read(partial(_read, cls, kind, env))


def _read(cls: type[Any], kind: str, env: gym.Env[Any, Any], checkpoint: Path) -> Policies:
    mlp = load_policy(checkpoint / "model.zip", cls, env)[0].mlp
    path = checkpoint / POLICIES[kind]
    try:
        if kind == "elites":
            stored = read(path, cls.__name__)[1]["archive"]["elites"]
            parameters, seeds = stored["solution"], stored["seed"]
        else:
            stored = read_arrays(path, REWARDING)
            parameters, seeds = stored.get("parameters"), stored["episode_seed"]
        if not len(seeds):
            raise ValueError(f"`policies` must be a kind that the run has, it has no {kind}.")
        fits = parameters.shape == (len(seeds), mlp.n_parameters)
        has_seeds = seeds.dtype.kind in "iu" and (seeds >= 0).all()
    except (AttributeError, LookupError, TypeError) as error:
        raise damaged(path) from error
    if not fits or not has_seeds or not np.isfinite(parameters).all():
        raise damaged(path)
    timesteps = int(checkpoint.name)
    return Policies(mlp, parameters.astype(np.float32), seeds.astype(np.int64), timesteps)
