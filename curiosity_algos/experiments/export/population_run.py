"""The policies in the folder of a population algorithm's run."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import gymnasium as gym
import numpy as np
import pandas as pd
from gymnasium import spaces

from curiosity_algos.common.arrays import Array, Float32Array, Int64Array
from curiosity_algos.common.names import ALGORITHMS, find_algorithm
from curiosity_algos.evaluation.evaluator import check_policy_kwargs
from curiosity_algos.evaluation.mlp import build_mlp
from curiosity_algos.experiments.env_spec import given_or_made, make_env
from curiosity_algos.experiments.reading import REWARDING, damaged, read_arrays
from curiosity_algos.experiments.run import Run
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.loops.model_file import read_settings
from curiosity_algos.loops.quality_diversity import QualityDiversity
from curiosity_algos.state.file import read

FILES = {"rewarding": "rewarding.npz", "sample": "sample.npz"}
"""Files of a checkpoint with policies, by kind."""
POLICIES = ("elites", *FILES)
"""Kinds of policies."""
_Read = TypeVar("_Read")


class Policies(NamedTuple):
    """Policies and their episodes.

    Attributes:
        parameters: (n, n_parameters).
        seeds: (n,) seeds of the resets of their episodes.
    """

    parameters: Float32Array
    seeds: Int64Array

    def distinct(self) -> Policies:
        """The policies without repetitions of the same parameters and seed."""
        rows = [row.tobytes() for row in self.parameters]
        is_repeated = pd.DataFrame({"row": rows, "seed": self.seeds}).duplicated()
        return self._at(np.flatnonzero(~is_repeated))

    def draw(self, n: int) -> Policies:
        """At most n policies, drawn uniformly, in order."""
        if len(self.seeds) <= n:
            return self
        return self._at(np.sort(np.random.default_rng(0).choice(len(self.seeds), n, replace=False)))

    def _at(self, places: Int64Array) -> Policies:
        return Policies(self.parameters[places], self.seeds[places])


class PopulationRun:
    """The last checkpoint of a run of a population algorithm.

    Args:
        folder: Folder of the run.
        trust: Also run code that it names or contains.
        env: Environment like the run's; None: the one that `run.json` describes, once it is needed.

    Attributes:
        described: The fields of `run.json`.
        timesteps: Timesteps of the checkpoint that was read last.
        mlp: Shape of the policies.
        action_space: Space of their actions.

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If it is of another algorithm, without a checkpoint or damaged, or needs trust.
    """

    def __init__(
        self, folder: Path, *, trust: bool = False, env: gym.Env[Any, Any] | None = None
    ) -> None:
        self._run = Run(folder)
        self.described = self._run.description
        self._algorithm = _population_algorithm(folder, self.described["algorithm"])
        self._trust = trust
        self._env = env
        settings = self.described.get("settings", {})
        net_arch = check_policy_kwargs(settings.get("policy_kwargs"))
        observation_space, self.action_space = self._read(self._spaces)
        self.mlp = build_mlp(observation_space, self.action_space, net_arch)

    def opened_env(self) -> AbstractContextManager[gym.Env[Any, Any]]:
        """An environment like the run's, which is closed afterwards unless it is the user's."""
        return given_or_made(self._env, partial(make_env, self.described, trust=self._trust))

    def _read(self, read: Callable[[Path], _Read]) -> _Read:
        """Read the last checkpoint with a function, and note its timesteps."""

        def read_and_note(checkpoint: Path) -> _Read:
            self.timesteps = int(checkpoint.name)
            return read(checkpoint)

        return self._run.folder.read(read_and_note)

    def _spaces(self, checkpoint: Path) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
        """Spaces of observations and actions, of the model or else of the environment."""
        file = checkpoint / "model.zip"
        content, _ = read(file, self._algorithm.__name__)
        settings = read_settings(content, file, self._algorithm)
        if settings.observation_space is not None and settings.action_space is not None:
            return settings.observation_space, settings.action_space
        with self.opened_env() as env:
            return env.observation_space, env.action_space

    def best(self) -> Float32Array:
        """The best policy, (n_parameters,): the one that `curiosity enjoy` plays."""
        return self._read(self._best)

    def _best(self, checkpoint: Path) -> Float32Array:
        path = checkpoint / "best_policy.npz"
        parameters = read_arrays(path, {"parameters": 1})["parameters"]
        best, _ = self._checked(parameters[None], np.zeros(1, np.int64), path)
        return best.reshape(-1)

    def policies(self, kind: str) -> Policies:
        """All policies of a kind in the run.

        Args:
            kind: One of `POLICIES`: "elites", of an algorithm with an archive; "rewarding", those
                that succeeded; "sample", of all that were evaluated.

        Raises:
            ValueError: If the run has none.
        """
        policies = self._read(
            self._elites if kind == "elites" else lambda last: self._sampled(last / FILES[kind])
        )
        if not len(policies.seeds):
            raise ValueError(f"`policies` must be a kind that the run has, it has no {kind}.")
        return policies

    def _elites(self, checkpoint: Path) -> Policies:
        if not issubclass(self._algorithm, QualityDiversity):
            raise ValueError(
                "`policies` must be rewarding or sample for an algorithm without an archive, such "
                f"as {self.described['algorithm']}."
            )
        file = checkpoint / "model.zip"
        _, state = read(file, self._algorithm.__name__)
        try:
            elites = state["archive"]["elites"]
            return self._checked(elites["solution"], elites["seed"], file)
        except (AttributeError, KeyError, TypeError) as error:
            raise damaged(file) from error

    def _sampled(self, path: Path) -> Policies:
        stored = read_arrays(path, REWARDING)
        if not len(stored["return"]):
            return Policies(np.empty((0, self.mlp.n_parameters), np.float32), np.empty(0, np.int64))
        return self._checked(stored.get("parameters"), stored["episode_seed"], path)

    def _checked(self, parameters: Any, seeds: Array, path: Path) -> Policies:
        """The policies of a file, which must fit the environment."""
        fits = np.shape(parameters) == (len(seeds), self.mlp.n_parameters)
        has_seeds = seeds.dtype.kind in "iu" and (seeds >= 0).all()
        if not fits or not has_seeds or not np.isfinite(parameters).all():
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
