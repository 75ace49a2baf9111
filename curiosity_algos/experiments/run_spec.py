"""Runs that are to be trained: their settings, their folders, and the models that they make."""

from __future__ import annotations

import ast
import hashlib
import inspect
import os
import re
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv

import curiosity_gym  # noqa: F401  registers the ids
from curiosity_algos.common.names import find_algorithm, find_known
from curiosity_algos.common.networks import torch_device
from curiosity_algos.evaluation.arguments import check_learning
from curiosity_algos.evaluation.environments import open_env
from curiosity_algos.experiments import baselines
from curiosity_algos.experiments.baselines import (
    find_bonus,
    is_baseline,
    load_baseline,
    make_baseline,
)
from curiosity_algos.experiments.differences import MAY_DIFFER
from curiosity_algos.experiments.run_envs import (
    Wrapping,
    check_wrapping,
    closed_on_error,
    make_single,
    open_envs,
)
from curiosity_algos.state.settings import python_number
from curiosity_gym.validation import check_at_least_one

LONGEST_NAME = 255
"""Bytes of a file's name, at most, in most file systems."""
ELSEWHERE = "MODULE:ID is one that a module registers."


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
        algorithm: Name of the algorithm, in any spelling: of this package, of Stable-Baselines3, or
            of sb3-contrib.
        env: Id of the environment.
        seed: Seed of everything random.
        timesteps: Budget in environment steps, as the algorithm counts them.
        env_kwargs: Keywords of the environment.
        settings: Keywords of the algorithm, and `preset`: what they begin with.
        variant: Folder of its own among runs of other settings, if any.
        bonus: Name of a bonus, which `BonusVecEnvWrapper` or `BonusReplayBuffer` adds to the reward
            of Stable-Baselines3's algorithms; of this package's it is their `bonus`.
        bonus_kwargs: Keywords of the bonus, and of what adds it.
        n_envs: Environments side by side, of Stable-Baselines3's algorithms.
        repeat_action: Steps for which each action is held; timesteps then count actions.
        wrappers: `module:Class` of the environment's wrappers, and their keywords, innermost first.
    """

    algorithm: str
    env: str
    seed: int
    timesteps: float
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    variant: str = ""
    bonus: str | None = None
    bonus_kwargs: Mapping[str, Any] = field(default_factory=dict)
    n_envs: int = 1
    repeat_action: int = 1
    wrappers: Sequence[Wrapping] = ()

    def folder(self, parent: str | os.PathLike[str]) -> Path:
        """The place of its files: a folder for the algorithm, the environment and the seed."""
        name = find_algorithm(self.algorithm).__name__
        added = "" if self.bonus is None else f"+{find_bonus(self.bonus)}"
        env = self.env.rpartition(":")[2].replace("/", "-")
        return Path(parent) / self.variant / f"{name}{added}" / env / str(self.seed)

    def check(self) -> None:
        """Make the environment and the model once, so that mistakes are found before a run begins.

        Raises:
            ValueError: If a name, a keyword or a value is wrong.
        """
        with warnings.catch_warnings(action="ignore"):  # the run itself warns
            env = self.make().get_env()
        assert env is not None
        env.close()

    def _check_settings(self, cls: type[Any]) -> None:
        check_at_least_one(n_envs=self.n_envs, repeat_action=self.repeat_action)
        for entry, kwargs in self.wrappers:
            check_wrapping(entry, kwargs)
        for name in ("n_threads", "preset"):
            if name in self.settings and baselines.is_foreign(cls):
                raise ValueError(
                    f"`{name}` must be left out for {cls.__name__}, which is not of this package."
                )
        parameters = [name for name in inspect.signature(cls).parameters if name[0] != "_"]
        known = ["preset", *(name for name in parameters if name not in {"env", "seed"})]
        for name in self.settings:
            find_known("hyperparams", name, known)
        torch_device(self.settings.get("device", "cpu"))  # raises where there is none

    def make(self) -> BaseAlgorithm:
        """A model that has not trained.

        Raises:
            ValueError: If a name, a keyword or a value is wrong.
        """
        if self.env.rpartition(":")[2] not in gym.registry and ":" not in self.env:
            find_known("env", self.env, gym.registry, hint=ELSEWHERE)
        cls = find_algorithm(self.algorithm)
        self._check_settings(cls)
        venv = self._make_env()  # apart: its own errors are none of the algorithm's
        with closed_on_error(venv):
            try:
                model = self._make_model(venv)
            except (AssertionError, AttributeError, RuntimeError, TypeError) as error:
                # Of classes that take what they are given.
                message = f"`env` and `hyperparams` must fit {cls.__name__}: {error}"
                raise ValueError(message) from error
            except ValueError as error:
                raise ValueError(str(error)) from error  # what a library refuses, too
            check_learning(model.get_env(), self.timesteps, None)
            return model

    def _make_model(self, venv: VecEnv) -> BaseAlgorithm:
        cls = find_algorithm(self.algorithm)
        # Stable-Baselines3's A2C, DDPG and SAC write into their `policy_kwargs`.
        settings: dict[str, Any] = {
            name: dict(value) if isinstance(value, dict) else value
            for name, value in self.settings.items()
        }
        if baselines.is_foreign(cls):
            added = {"bonus": self.bonus, "bonus_kwargs": self.bonus_kwargs}
            return make_baseline(cls, venv, seed=self.seed, **{**added, **settings})
        settings |= self._bonus_settings(cls)
        preset = settings.pop("preset", None)
        make = cls if preset is None else partial(cls.from_preset, preset)
        model: BaseAlgorithm = make(venv, seed=self.seed, **settings)
        return model

    def _bonus_settings(self, cls: type[Any]) -> dict[str, Any]:
        """The bonus as an algorithm of this package takes it."""
        if self.bonus is None and not self.bonus_kwargs:
            return {}
        if "bonus" not in inspect.signature(cls).parameters:
            raise ValueError(f"`bonus` must be left out for {cls.__name__}, which has none.")
        given = {} if self.bonus is None else {"bonus": find_bonus(self.bonus)}
        return {**given, **({"bonus_kwargs": {**self.bonus_kwargs}} if self.bonus_kwargs else {})}

    def _make_env(self) -> VecEnv:
        """The environments; errors of their own pass, but of keywords that they do not take."""
        cls = find_algorithm(self.algorithm)
        if self.n_envs > 1 and not is_baseline(cls):
            raise ValueError(
                f"`n_envs` must be 1 for {cls.__name__}: several are for algorithms of "
                "Stable-Baselines3's own."
            )
        try:
            return self._open_env(is_baseline(cls))
        except TypeError as error:
            message = str(error.__cause__ or error)  # Gymnasium repeats all keywords in its own
            named = [f"{quote}{name}{quote}" for name in self.env_kwargs for quote in "'`"]
            if not any(name in message for name in named):
                raise
            raise ValueError(f"`env_kwargs` must be keywords of {self.env}: {message}.") from error

    def _open_env(self, is_theirs: bool) -> VecEnv:
        as_said = self.repeat_action, self.env_kwargs, self.wrappers
        if is_theirs:
            return open_envs(self.env, self.n_envs, *as_said)
        if self.repeat_action > 1 or self.wrappers:
            changed: VecEnv = open_env(partial(make_single, self.env, *as_said))
            return changed
        env: VecEnv = open_env(self.env, **self.env_kwargs)
        return env

    def words(self, parent: str | os.PathLike[str]) -> list[str]:
        """The words of `curiosity train` for this run, in its folder below `parent`.

        Raises:
            ValueError: If a keyword has a value that no text says.
        """
        words = ["--algo", self.algorithm, "--env", self.env, "--seed", f"{self.seed}"]
        words += ["-n", f"{self.timesteps}", "-f", str(Path(parent, self.variant))]
        words += ["--bonus", self.bonus or "none", "--n-envs", f"{self.n_envs}"]
        words += ["--repeat-action", f"{self.repeat_action}"]
        keywords = {"--env-kwargs": self.env_kwargs, "--hyperparams": self.settings}
        for option, values in (keywords | {"--bonus-kwargs": self.bonus_kwargs}).items():
            for name, value in values.items():
                words += [option, f"{name}:{_literal(name, value)}"]
        for entry, values in self.wrappers:
            pairs = [f"{name}={_literal(name, value, but=':')}" for name, value in values.items()]
            words += ["--wrapper", ":".join([entry.replace(":", "."), *pairs])]
        return words

    def load(self, checkpoint: Path) -> BaseAlgorithm:
        """The model as it was at a checkpoint."""
        passed_again = MAY_DIFFER | {"evaluator", "archive", "emitters", "search"}
        free = {name: value for name, value in self.settings.items() if name in passed_again}
        cls, venv = find_algorithm(self.algorithm), self._make_env()
        with closed_on_error(venv):
            if is_baseline(cls):
                return load_baseline(cls, checkpoint, venv, **free)
            model: BaseAlgorithm = cls.load(checkpoint / "model", env=venv, **free)
            return model


def _literal(name: str, value: Any, but: str = "\0") -> str:
    """The text of a value, which the command makes the same value of."""
    value = str(value) if isinstance(value, Path) else python_number(value)
    text = repr(value)
    with suppress(SyntaxError, ValueError):
        if but not in text and ast.literal_eval(text) == value:
            return text
    raise ValueError(
        f"`{name}` must be a number, a text, or lists and dictionaries of them, where several runs "
        f"are trained at a time, got {value!r}."
    )
