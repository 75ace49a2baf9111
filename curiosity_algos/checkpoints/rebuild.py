"""Models made anew of what a file holds."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeVar

import torch as th
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.type_aliases import TensorDict
from stable_baselines3.common.utils import check_for_correct_spaces

_Model = TypeVar("_Model", bound=BaseAlgorithm)


def build_model(
    cls: type[_Model],
    data: dict[str, Any],
    parameters: TensorDict,
    env: Any,
    device: th.device | str,
    force_reset: bool,
) -> _Model:
    """Make the model that `read_model` read, as SB3's `load` does.

    Args:
        cls: Of the model.
        data: Its attributes; those of the env are replaced.
        parameters: The states of its parts.
        env: To learn in, or None.
        device: As in the constructor.
        force_reset: As in SB3.

    Raises:
        ValueError: If the env has other spaces, or the states do not fit the model.
        RuntimeError: If those of networks do not fit.
    """
    if env is not None:
        env = cls._wrap_env(env, data["verbose"])
        check_for_correct_spaces(env, data["observation_space"], data["action_space"])
        data["n_envs"] = env.num_envs
        data |= {"_last_obs": None} if force_reset else {}
    else:
        env = data.get("env")  # a user may have included it
    later: dict[str, Any] = {"_init_setup_model": False}  # which SB3's base does not declare
    model = cls(policy=data["policy_class"], env=env, device=device, **later)
    vars(model).update(data)
    model._setup_model()
    try:
        model.set_parameters(parameters, exact_match=True, device=device)
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise ValueError(f"`path` must be a saved {cls.__name__}: {error}") from error
    return model


def check_names(given: Iterable[str], expected: Iterable[str], *, exact_match: bool) -> None:
    """Check the names of the parts that `set_parameters` is given.

    Raises:
        ValueError: If the model has no part of a name, or, with `exact_match`, one is missing.
    """
    given, expected = set(given), set(expected)
    wrong = {"missing": expected - given if exact_match else set(), "unknown": given - expected}
    if any(wrong.values()):
        found = "; ".join(
            f"{kind}: {' and '.join(f'`{name}`' for name in sorted(names))}"
            for kind, names in wrong.items()
            if names
        )
        raise ValueError(f"Names of parameters do not match the model's parts, {found}.")


def read_parameters(source: str | TensorDict, device: th.device | str) -> TensorDict:
    """The states of parts that `set_parameters` is given, or is to read from a file."""
    if isinstance(source, dict):
        return source
    parameters: TensorDict = load_from_zip_file(source, device=device, load_data=False)[1]
    return parameters
