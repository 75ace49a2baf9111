"""Checks of the arguments that every algorithm takes, before anything is made of them."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterable
from difflib import get_close_matches
from numbers import Real
from typing import Any

from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

import curiosity_gym  # noqa: F401  registers the ids, so that users need no import of their own
from curiosity_algos.common.networks import torch_device
from curiosity_algos.state.settings import python_number
from curiosity_gym.validation import check_at_least_one, check_seed, check_whole


def check_keywords_known(
    cls: type, unknown: Iterable[str], known: Iterable[str] | None = None
) -> None:
    """Raise TypeError, as Python does, if a class is given a keyword that it does not know.

    The nearest of those `known` is suggested, which are those of its signature by default.
    """
    for name in unknown:
        near = get_close_matches(name, list(known or inspect.signature(cls).parameters), n=1)
        meant = f": did you mean {near[0]}?" if near else "."
        raise TypeError(f"{cls.__name__} got an unexpected keyword argument {name!r}{meant}")


def check_order(algorithm: BaseAlgorithm, env: object, policy: object) -> None:
    """Raise ValueError unless the environment comes first, and the algorithm knows the policy."""
    name, aliases = type(algorithm).__name__, type(algorithm).policy_aliases
    is_sb3_order = isinstance(env, str) and env.endswith("Policy")  # of SB3, whatever its kind
    if is_sb3_order or not isinstance(policy, str | type):
        raise ValueError(f'Pass the environment first: {name}(env, policy="MlpPolicy").')
    if isinstance(policy, type) and not issubclass(policy, tuple(aliases.values())):
        known = " or ".join(f'"{alias}"' for alias in aliases)
        raise ValueError(f"`policy` must be {known} or a subclass of it, got {policy.__name__}.")


def check_common(seed: object, device: Any, verbose: object) -> None:
    """Raise ValueError unless Stable-Baselines3 can begin with these arguments."""
    check_seed(seed)
    check_whole(0, 2, verbose=verbose)
    torch_device(device)


def use_python_numbers(algorithm: BaseAlgorithm) -> None:
    """Make Python's numbers of settings that are numpy's: torch refuses some of these."""
    arguments = inspect.signature(type(algorithm)).parameters
    for name in arguments.keys() & vars(algorithm).keys():
        vars(algorithm)[name] = python_number(vars(algorithm)[name])


def check_learning(env: VecEnv | None, total_timesteps: object, log_interval: object) -> None:
    """Raise ValueError unless `learn` can begin with these arguments."""
    if log_interval is not None:
        check_at_least_one(log_interval=log_interval)
    if not isinstance(total_timesteps, Real) or not 0.0 <= float(total_timesteps) < math.inf:
        raise ValueError(
            f"`total_timesteps` must be finite and at least 0, got {total_timesteps!r}."
        )
    if env is None:
        raise ValueError("`env` must be set before learning: call set_env(env).")


def check_no_options(env: VecEnv | None) -> None:
    """Raise ValueError if the next reset of an environment has options: no episode gets them."""
    while isinstance(env, VecEnvWrapper):
        env = env.venv
    if any(getattr(env, "_options", ())):
        raise ValueError(
            "`set_options` does not reach the episodes of a population, which begin with a seed "
            "alone: make the environment with keywords, or in a wrapper, that do the same."
        )
