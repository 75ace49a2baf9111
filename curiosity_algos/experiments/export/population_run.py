"""The policies that the folder of a population algorithm's run keeps."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from curiosity_algos.common.arrays import Array, Float32Array, Int64Array
from curiosity_algos.common.names import ALGORITHMS, find_algorithm
from curiosity_algos.evaluation.evaluator import check_policy_kwargs
from curiosity_algos.evaluation.policies import build_mlp
from curiosity_algos.experiments.env_spec import make_env
from curiosity_algos.experiments.reading import REWARDING, damaged, read_arrays
from curiosity_algos.experiments.run_folder import last_checkpoint
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.loops.quality_diversity import QualityDiversity

FILES = {"rewarding": "rewarding.npz", "sample": "sample.npz"}
"""Where a checkpoint keeps policies, by kind."""
POLICIES = ("elites", *FILES)
"""Kinds of policies."""


class Policies(NamedTuple):
    """Policies, each with the episode that it played.

    Attributes:
        parameters: (n, n_parameters).
        seeds: (n,) of the resets of their episodes.
    """

    parameters: Float32Array
    seeds: Int64Array

    def distinct(self) -> Policies:
        """The same without those that stand there twice, with the same seed."""
        rows = [row.tobytes() for row in self.parameters]
        is_repeated = pd.DataFrame({"row": rows, "seed": self.seeds}).duplicated()
        return self._at(np.flatnonzero(~is_repeated))

    def draw(self, n: int) -> Policies:
        """At most n of them, drawn uniformly, in their order."""
        if len(self.seeds) <= n:
            return self
        return self._at(np.sort(np.random.default_rng(0).choice(len(self.seeds), n, replace=False)))

    def _at(self, places: Int64Array) -> Policies:
        return Policies(self.parameters[places], self.seeds[places])


class PopulationRun:
    """The last checkpoint of a run of a population algorithm.

    Args:
        folder: Folder of the run.
        trust: Also run code that it names or holds.

    Attributes:
        described: What `run.json` says.
        timesteps: Of the checkpoint.
        env: An environment as the run was trained in.
        mlp: The shape of its policies.

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If it is of another algorithm, without a checkpoint or damaged, or needs trust.
    """

    def __init__(self, folder: Path, *, trust: bool = False) -> None:
        self.described, self._checkpoint = last_checkpoint(folder)
        self.timesteps = int(self._checkpoint.name)
        self._algorithm = _population_algorithm(folder, self.described["algorithm"])
        self._trust = trust
        settings = self.described.get("settings", {})
        net_arch = check_policy_kwargs(settings.get("policy_kwargs"))
        self.env = make_env(self.described, trust=trust)
        self.mlp = build_mlp(self.env.observation_space, self.env.action_space, net_arch)

    def best(self) -> Float32Array:
        """The best policy, (n_parameters,): the one that `curiosity enjoy` plays."""
        path = self._checkpoint / "best_policy.npz"
        parameters = read_arrays(path, {"parameters": 1})["parameters"]
        best, _ = self._checked(parameters[None], np.zeros(1, np.int64), path)
        return best.reshape(-1)

    def policies(self, kind: str) -> Policies:
        """All policies of a kind that the run keeps.

        Args:
            kind: One of `POLICIES`: "elites", of an algorithm with an archive; "rewarding", those
                that succeeded; "sample", of all that were evaluated.

        Raises:
            ValueError: If the run keeps none.
        """
        found = self._elites() if kind == "elites" else self._sampled(FILES[kind])
        if not len(found.seeds):
            raise ValueError(f"`policies` must be some that the run keeps, it has no {kind}.")
        return found

    def _elites(self) -> Policies:
        if not issubclass(self._algorithm, QualityDiversity):
            raise ValueError(
                "`policies` must be rewarding or sample of an algorithm without an archive, such "
                f"as {self.described['algorithm']}."
            )
        settings = self.described.get("settings", {})
        if settings.get("emitters") is not None or isinstance(settings.get("archive"), dict):
            raise ValueError(
                "`policies` must be rewarding or sample of a run with an `archive` or `emitters` "
                "that were given, as its folder cannot give them back."
            )
        model = self._algorithm.load(self._checkpoint / "model", allow_pickle=self._trust)
        elites = model.archive.data(["solution", "seed"])
        return self._checked(elites["solution"], elites["seed"], self._checkpoint / "model.zip")

    def _sampled(self, name: str) -> Policies:
        path = self._checkpoint / name
        kept = read_arrays(path, REWARDING)
        if not len(kept["return"]):
            return Policies(np.empty((0, self.mlp.n_parameters), np.float32), np.empty(0, np.int64))
        return self._checked(kept.get("parameters"), kept["episode_seed"], path)

    def _checked(self, parameters: Any, seeds: Array, path: Path) -> Policies:
        """Those of a file, which must be policies for the environment."""
        fits = np.shape(parameters) == (len(seeds), self.mlp.n_parameters)
        are_seeds = seeds.dtype.kind in "iu" and (seeds >= 0).all()
        if not fits or not are_seeds or not np.isfinite(parameters).all():
            raise damaged(path)
        return Policies(np.asarray(parameters, dtype=np.float32), seeds.astype(np.int64))


def _population_algorithm(folder: Path, name: str) -> type[EvolutionaryAlgorithm]:
    if name in ALGORITHMS:
        cls = find_algorithm(name)
        if issubclass(cls, EvolutionaryAlgorithm):
            return cls
    raise ValueError(
        f"`run` must be of an algorithm that evolves policies, {folder} is of {name}, which trains "
        "one."
    )
