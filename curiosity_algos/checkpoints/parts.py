"""The parts of a model: found, so that a file forgets none, and put into a model made anew."""

from __future__ import annotations

import inspect
from typing import Any, TypeVar

import torch as th
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import load_from_zip_file, recursive_getattr
from stable_baselines3.common.type_aliases import TensorDict
from stable_baselines3.common.utils import check_for_correct_spaces

_Model = TypeVar("_Model", bound=BaseAlgorithm)

_NO_PARTS = ("env", "evaluator", "_evaluator_choice")
"""Attributes that no file holds, even where they have a state."""


def stateful_parts(model: BaseAlgorithm) -> list[str]:
    """Names of all attributes with a `state_dict` and a `load_state_dict`.

    The policy and its networks are left out, which Stable-Baselines3 knows of, and so is an
    argument of the constructor that a part works with, as the motivation does with the bonus: the
    state of that part has the argument's.
    """
    parts = {name: part for name, part in vars(model).items() if _is_part(model, name)}
    arguments = _arguments(type(model))
    own = [part for name, part in parts.items() if name not in arguments]
    held = {id(each) for part in own for each in (part, *getattr(part, "__dict__", {}).values())}
    return [name for name, part in parts.items() if name not in arguments or id(part) not in held]


def _arguments(cls: type) -> set[str]:
    """Names that the constructor takes, or passes on to those of its bases."""
    constructors = [vars(each)["__init__"] for each in cls.__mro__ if "__init__" in vars(each)]
    return {name for each in constructors for name in inspect.signature(each).parameters}


def _is_part(model: BaseAlgorithm, name: str) -> bool:
    part = getattr(model, name)
    if name in _NO_PARTS or isinstance(part, type):
        return False
    if isinstance(part, th.nn.Module) and part in set(model.policy.modules()):
        return False
    return all(hasattr(part, method) for method in ("state_dict", "load_state_dict"))


def read_parts(model: BaseAlgorithm, source: str | TensorDict, exact_match: bool) -> TensorDict:
    """States for `set_parameters`, in a dictionary or a file, whose names the model knows.

    A file's are on the CPU: networks copy them to where they are, other parts are arrays.

    Raises:
        ValueError: If the model has no part of a name, or, with `exact_match`, one is missing.
    """
    if isinstance(source, dict):
        parameters: TensorDict = source
    else:
        parameters = load_from_zip_file(source, device="cpu", load_data=False)[1]
    given, expected = set(parameters), set(model._get_torch_save_params()[0])
    wrong = {"missing": expected - given if exact_match else set(), "unknown": given - expected}
    if any(wrong.values()):
        found = "; ".join(
            f"{kind}: {' and '.join(f'`{name}`' for name in sorted(names))}"
            for kind, names in wrong.items()
            if names
        )
        raise ValueError(f"Names of parameters do not match the model's parts, {found}.")
    return parameters


def load_parts(model: BaseAlgorithm, parameters: TensorDict, strict: bool) -> None:
    """Give parts the states that `read_parts` gave; networks alone know of `strict`."""
    for name, state in parameters.items():
        part = recursive_getattr(model, name)
        keywords = {"strict": strict} if isinstance(part, th.nn.Module) else {}
        part.load_state_dict(state, **keywords)


def build_model(
    cls: type[_Model],
    data: dict[str, Any],
    parameters: TensorDict,
    env: Any,
    device: th.device | str,
    force_reset: bool,
) -> _Model:
    """Make the model whose attributes and states `read_model` gave, as SB3's `load` does.

    Raises ValueError if the env has other spaces, or the states do not fit the model.
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
