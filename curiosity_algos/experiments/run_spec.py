"""Runs that are to be trained: their settings, their folders, and the models that they make."""

from __future__ import annotations

import inspect
import os
import re
import warnings
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import gymnasium as gym
from gymnasium.envs.registration import WrapperSpec, load_env_creator
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv, VecMonitor

import curiosity_gym  # noqa: F401  registers the ids
from curiosity_algos.common.names import find_algorithm, find_known
from curiosity_algos.common.networks import torch_device
from curiosity_algos.evaluation.arguments import check_learning
from curiosity_algos.evaluation.environments import open_env
from curiosity_algos.experiments.baselines import (
    find_bonus,
    is_baseline,
    is_foreign,
    load_baseline,
    make_baseline,
)
from curiosity_algos.experiments.description import MAY_DIFFER
from curiosity_algos.sb3.gymnasium_vec_env import open_batch
from curiosity_gym.validation import check_at_least_one, check_positive

Wrapping: TypeAlias = tuple[str, Mapping[str, Any]]
"""`module:Class` of a wrapper, and its keywords."""
ELSEWHERE = "MODULE:ID is one that a module registers."


def variant_of(settings: Mapping[str, Any]) -> str:
    """The name of a folder for runs of these settings; "" for none."""
    text = ",".join(f"{name}={value}" for name, value in sorted(settings.items()))
    return re.sub(r"[^\w.,=+-]+", "-", text)


def check_wrapping(entry: str, kwargs: Mapping[str, Any]) -> None:
    """Raise ValueError unless a wrapper can be imported, and takes its keywords."""
    try:
        inspect.signature(load_env_creator(entry)).bind("env", **kwargs)
    except (AttributeError, ImportError, TypeError) as error:
        raise ValueError(
            f"`wrapper` must be a class that can be imported, and its keywords, {entry}: {error}."
        ) from error


def _wrap(env: gym.Env[Any, Any], entry: str, kwargs: Mapping[str, Any]) -> gym.Env[Any, Any]:
    cls: Any = load_env_creator(entry)
    made: gym.Wrapper[Any, Any, Any, Any] = cls(env, **kwargs)
    assert env.spec is not None
    # Most wrappers do not note their keywords; this one's spec is how the run is played again.
    defined = f"{cls.__module__}:{cls.__name__}"  # as Gymnasium's own are known
    wrappers = *env.spec.additional_wrappers, WrapperSpec(cls.__name__, defined, dict(kwargs))
    made._cached_spec = replace(env.spec, additional_wrappers=wrappers)
    return made


@dataclass(frozen=True)
class RunSpec:
    """A run that is to be trained.

    Args:
        algorithm: Name of an algorithm of this package, of Stable-Baselines3 or of sb3-contrib, in
            any spelling.
        env: Id of the environment.
        seed: Seed of everything random.
        timesteps: Budget in environment steps, as the algorithm counts them.
        env_kwargs: Keywords of the environment.
        settings: Keywords of the algorithm, and its `preset`.
        variant: Folder of its own among runs of other settings, if any.
        bonus: Name of a bonus, which `BonusVecEnvWrapper` or `BonusReplayBuffer` adds to the reward
            of Stable-Baselines3's algorithms; the `bonus` of those of this package.
        bonus_kwargs: Keywords of the bonus, and of what adds it.
        n_envs: Environments side by side, for Stable-Baselines3's algorithms.
        repeat_action: Steps that an action is taken for; timesteps then count actions.
        wrappers: `module:Class` of the environment's wrappers, and their keywords, innermost first.
        settle: Timesteps of a `SettleCallback`, for Stable-Baselines3's algorithms; None: there is
            no such callback.
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
    settle: float | None = None

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

    def make(self) -> BaseAlgorithm:
        """A model that has not trained.

        Raises:
            ValueError: If a name, a keyword or a value is wrong.
        """
        if ":" not in self.env:
            find_known("env", self.env, gym.registry, hint=ELSEWHERE)
        cls = find_algorithm(self.algorithm)
        self._check_settings(cls)
        venv = self._make_env()  # apart: its own errors are none of the algorithm's
        with ExitStack() as stack:
            stack.callback(venv.close)
            try:
                model = self._make_model(venv)
                if self.settle is not None:
                    vars(model)["settle"] = self.settle  # as the callback does
            except (AssertionError, AttributeError, RuntimeError, TypeError) as error:
                # Of classes that take what they are given.
                message = f"`env` and `hyperparams` must fit {cls.__name__}: {error}"
                raise ValueError(message) from error
            except ValueError as error:
                raise ValueError(str(error)) from error  # what a library refuses, too
            check_learning(model.get_env(), self.timesteps, None)
            stack.pop_all()
            return model

    def _check_settings(self, cls: type[Any]) -> None:
        check_at_least_one(n_envs=self.n_envs, repeat_action=self.repeat_action)
        if self.n_envs > 1 and not is_baseline(cls):
            raise ValueError(
                f"`n_envs` must be 1 for {cls.__name__}: several are for algorithms of "
                "Stable-Baselines3's own."
            )
        if self.settle is not None:
            if not is_baseline(cls):
                raise ValueError(
                    f"`settle` must be left out for {cls.__name__}: it is for algorithms of "
                    "Stable-Baselines3's own."
                )
            check_positive(settle=self.settle)
        for entry, kwargs in self.wrappers:
            check_wrapping(entry, kwargs)
        known = [name for name in inspect.signature(cls).parameters if name[0] != "_"]
        known += [] if is_foreign(cls) else ["preset"]
        for name in self.settings:
            find_known("hyperparams", name, sorted({*known} - {"env", "seed"}))
        torch_device(self.settings.get("device", "cpu"))  # raises where there is none

    def _make_model(self, venv: VecEnv) -> BaseAlgorithm:
        cls = find_algorithm(self.algorithm)
        # Stable-Baselines3's A2C, DDPG and SAC write into their `policy_kwargs`.
        settings: dict[str, Any] = {
            name: dict(value) if isinstance(value, dict) else value
            for name, value in self.settings.items()
        }
        if is_foreign(cls):
            added = {"bonus": self.bonus, "bonus_kwargs": self.bonus_kwargs}
            return make_baseline(cls, venv, seed=self.seed, **{**added, **settings})
        settings |= self._bonus_settings(cls)
        preset = settings.pop("preset", None)
        make = cls if preset is None else partial(cls.from_preset, preset)
        model: BaseAlgorithm = make(venv, seed=self.seed, **settings)
        return model

    def _bonus_settings(self, cls: type[Any]) -> dict[str, Any]:
        """The bonus as an algorithm of this package takes it."""
        given: dict[str, Any] = {} if self.bonus is None else {"bonus": find_bonus(self.bonus)}
        if self.bonus_kwargs:
            given["bonus_kwargs"] = {**self.bonus_kwargs}
        if given and "bonus" not in inspect.signature(cls).parameters:
            raise ValueError(f"`bonus` must be left out for {cls.__name__}, which has none.")
        return given

    def _make_env(self) -> VecEnv:
        """The environments; errors of their own pass, except of keywords that they do not take."""
        make = self.make_single
        try:
            if is_baseline(find_algorithm(self.algorithm)):
                return VecMonitor(open_batch(make, self.n_envs))
            is_changed = self.repeat_action > 1 or self.wrappers
            opened: VecEnv = open_env(make) if is_changed else open_env(self.env, **self.env_kwargs)
            return opened
        except ModuleNotFoundError as error:
            module, missing = self.env.partition(":")[0], error.__cause__ or error
            if not f"{module}.".startswith(f"{getattr(missing, 'name', None)}."):
                raise  # it is what that module imports
            raise ValueError(f"`env` {self.env} needs a module: {missing}.") from error
        except TypeError as error:
            message = str(error.__cause__ or error)  # Gymnasium repeats all keywords in its own
            named = [f"{quote}{name}{quote}" for name in self.env_kwargs for quote in "'`"]
            if not any(name in message for name in named):
                raise
            raise ValueError(f"`env_kwargs` must be keywords of {self.env}: {message}.") from error

    def make_single(self) -> gym.Env[Any, Any]:
        """One of the environments, which takes each action for so many steps, in wrappers."""
        made: gym.Env[Any, Any] = gym.make(self.env, **self.env_kwargs)
        if self.repeat_action > 1:
            if not hasattr(gym.wrappers, "RepeatAction"):
                raise ImportError("`repeat_action` needs gymnasium 1.3 or newer.")
            made = gym.wrappers.RepeatAction(made, self.repeat_action)
        for entry, keywords in self.wrappers:
            made = _wrap(made, entry, keywords)
        return made

    def load(self, checkpoint: Path) -> BaseAlgorithm:
        """The model as it was at a checkpoint."""
        passed_again = MAY_DIFFER | {"evaluator", "archive", "emitters", "search"}
        free = {name: value for name, value in self.settings.items() if name in passed_again}
        cls, venv = find_algorithm(self.algorithm), self._make_env()
        with ExitStack() as stack:
            stack.callback(venv.close)
            if is_baseline(cls):
                model = load_baseline(cls, checkpoint, venv, **free)
            else:
                model = cls.load(checkpoint / "model", env=venv, **free)
            stack.pop_all()
            return model
