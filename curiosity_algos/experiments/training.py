"""One run, from its settings to its folder; one that was interrupted goes on."""

from __future__ import annotations

import hashlib
import inspect
import os
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import torch as th
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv

import curiosity_gym  # noqa: F401  registers the ids
from curiosity_algos.evaluation.arguments import check_learning
from curiosity_algos.evaluation.environments import open_env
from curiosity_algos.experiments.description import describe_run
from curiosity_algos.experiments.differences import MAY_DIFFER, differences
from curiosity_algos.experiments.names import find_algorithm, find_known
from curiosity_algos.experiments.run_folder import RunFolder
from curiosity_algos.experiments.save_run import SaveRun

LONGEST_NAME = 255
"""Bytes of a file's name, at most, in most file systems."""


def variant_of(settings: Mapping[str, Any]) -> str:
    """The name of a folder for runs of these settings; "" for none.

    One that a file system would refuse ends in a digest of all settings instead.
    """
    text = ",".join(f"{name}={value}" for name, value in sorted(settings.items()))
    name = re.sub(r"[^\w.,=+-]+", "-", text)
    if len(name.encode()) <= LONGEST_NAME:
        return name
    digest = hashlib.sha256(repr(sorted(settings.items())).encode()).hexdigest()
    return f"{name[:50]}-{digest[:16]}"


@dataclass(frozen=True)
class RunSpec:
    """A run that is to be trained.

    Args:
        algorithm: Name of the algorithm, in any spelling.
        env: Id of the environment.
        seed: Seed of everything random.
        timesteps: Budget in environment steps.
        env_kwargs: Keywords of the environment.
        settings: Keywords of the algorithm, and `preset`: what they begin with.
        variant: Folder of its own among runs of other settings, if any.
    """

    algorithm: str
    env: str
    seed: int
    timesteps: float
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    variant: str = ""

    def folder(self, parent: str | os.PathLike[str]) -> Path:
        """The place of its files: a folder for the algorithm, the environment and the seed."""
        name = find_algorithm(self.algorithm).__name__
        env = self.env.rpartition(":")[2].replace("/", "-")
        return Path(parent) / self.variant / name / env / str(self.seed)

    def check(self) -> None:
        """Make the environment and the model once, so that mistakes are found before a run begins.

        Raises:
            ValueError: If a name, a keyword or a value is wrong.
        """
        if self.env.rpartition(":")[2] not in gym.registry and ":" not in self.env:
            find_known("env", self.env, gym.registry)
        cls = find_algorithm(self.algorithm)
        parameters = inspect.signature(cls).parameters
        known = ["preset", *(name for name in parameters if name not in {"env", "seed"})]
        for name in self.settings:
            find_known("hyperparams", name, known)
        if str(self.settings.get("device")).startswith("cuda") and not th.cuda.is_available():
            raise ValueError("`device` must be auto or cpu where there is no GPU, got cuda.")
        try:
            with warnings.catch_warnings(action="ignore"):  # the run itself warns
                check_learning(self.make().get_env(), self.timesteps, None)
        except RuntimeError as error:  # torch's, of a device
            raise ValueError(f"`device` must be auto, cpu or cuda: {error}") from error
        except (AssertionError, TypeError) as error:  # of classes that take what they are given
            raise ValueError(f"`hyperparams` must fit {cls.__name__}: {error}") from error

    def make(self) -> BaseAlgorithm:
        """A model that has not trained."""
        cls = find_algorithm(self.algorithm)
        settings = dict(self.settings)
        preset = settings.pop("preset", None)
        make = cls if preset is None else partial(cls.from_preset, preset)
        model: BaseAlgorithm = make(self._make_env(), seed=self.seed, **settings)
        return model

    def _make_env(self) -> VecEnv:
        try:
            env: VecEnv = open_env(self.env, **self.env_kwargs)
        except TypeError as error:
            raise ValueError(f"`env_kwargs` must be keywords of {self.env}: {error}.") from error
        return env

    def load(self, checkpoint: Path) -> BaseAlgorithm:
        """The model as it was at a checkpoint."""
        passed_again = MAY_DIFFER | {"evaluator", "archive", "emitters", "search"}
        free = {name: value for name, value in self.settings.items() if name in passed_again}
        cls = find_algorithm(self.algorithm)
        model: BaseAlgorithm = cls.load(checkpoint / "model", env=self._make_env(), **free)
        return model


def is_finished(run: RunSpec, folder: Path) -> bool:
    """Whether the budget of the run in a folder is spent; False where there is none.

    Raises:
        ValueError: If the folder holds another run.
    """
    stored = RunFolder(folder)
    if stored.is_empty():
        return False
    with warnings.catch_warnings(action="ignore"):  # the run itself warns
        described = describe_run(run.make())
    if others := differences(stored.describe(), described):
        raise ValueError(
            f"`folder` must be empty or that of this run: in {folder} {', '.join(others)}."
        )
    result = stored.result()
    return bool(result) and result["timesteps"] >= run.timesteps and result.get("ended", True)


def train(
    run: RunSpec,
    folder: Path,
    *,
    interval: float = 60.0,
    progress_bar: bool = False,
) -> bool:
    """Train until the budget is spent, from where the run in the folder stands.

    Args:
        run: Run to train.
        folder: Folder of the run.
        interval: Seconds between two checkpoints.
        progress_bar: Show a bar of timesteps.

    Returns:
        Whether there was anything to do.

    Raises:
        ValueError: If the folder holds another run.
    """
    if is_finished(run, folder):
        return False
    checkpoint = RunFolder(folder).checkpoint
    model = run.make() if checkpoint is None else run.load(checkpoint)
    rest = max(0, int(run.timesteps) - model.num_timesteps)
    save = SaveRun(folder, interval=interval)
    try:
        model.learn(rest, callback=save, reset_num_timesteps=False, progress_bar=progress_bar)
    except KeyboardInterrupt:
        if save.n_calls:
            save.save()  # Ctrl-C comes between two generations
        raise
    finally:
        save.close()
    return True


def summary(folder: Path) -> str:
    """A run's result in a line."""
    result = RunFolder(folder).result()
    first = result["first_success_timesteps"]
    found = "no success" if first is None else f"first success after {first:,} timesteps"
    shares = [f"{name} {share:.1%}" for name, share in result["coverage"].items()]
    coverage = f", coverage {', '.join(shares)}" if shares else ""
    best = result["best_return"]
    return f"{folder}: best return {'none' if best is None else f'{best:.3f}'}, {found}{coverage}"
