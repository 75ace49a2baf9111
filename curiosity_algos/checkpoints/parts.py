"""Which attributes of a model a resumed run needs: they are found, so that none is forgotten."""

from __future__ import annotations

import inspect

import torch as th
from stable_baselines3.common.base_class import BaseAlgorithm

_NO_PARTS = ("env", "evaluator", "_evaluator_choice")
"""What no file holds, even where it has a state."""


def stateful_parts(model: BaseAlgorithm) -> list[str]:
    """Names of all attributes with a `state_dict` and a `load_state_dict`.

    The policy and its networks are left out, which Stable-Baselines3 knows of, and so is an
    argument of the constructor that a part works with, as the motivation does with the bonus: the
    state of that part has the argument's.
    """
    parts = {name: part for name, part in vars(model).items() if _is_part(model, name)}
    arguments = inspect.signature(type(model)).parameters
    own = [part for name, part in parts.items() if name not in arguments]
    held = {id(each) for part in own for each in (part, *getattr(part, "__dict__", {}).values())}
    return [name for name, part in parts.items() if name not in arguments or id(part) not in held]


def _is_part(model: BaseAlgorithm, name: str) -> bool:
    part = getattr(model, name)
    is_network = isinstance(part, th.nn.Module)
    if name in _NO_PARTS or isinstance(part, type):
        return False
    if is_network and part in set(model.policy.modules()):
        return False
    return all(hasattr(part, method) for method in ("state_dict", "load_state_dict"))
