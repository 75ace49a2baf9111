"""Which attributes of a model a resumed run needs: they are found, so that none is forgotten."""

from __future__ import annotations

import inspect

import torch as th
from stable_baselines3.common.base_class import BaseAlgorithm


def stateful_parts(model: BaseAlgorithm) -> list[str]:
    """Names of all attributes with a `state_dict` and a `load_state_dict`.

    The policy and its networks are left out, which Stable-Baselines3 knows of, and so are arguments
    of the constructor: the part that works with one has its state, or `load` is given it again.
    """
    arguments = inspect.signature(type(model)).parameters
    return [name for name in vars(model) if name not in arguments and _is_part(model, name)]


def _is_part(model: BaseAlgorithm, name: str) -> bool:
    part = getattr(model, name)
    is_network = isinstance(part, th.nn.Module)
    if isinstance(part, type) or (is_network and part in set(model.policy.modules())):
        return False
    return all(hasattr(part, method) for method in ("state_dict", "load_state_dict"))
