"""What Gymnasium's vector environments say of each of theirs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv

from curiosity_gym.episodic_vector_env import EpisodicVectorEnv

_FINAL = ("final_obs", "final_info")


def has_generators(env: VectorEnv[Any, Any, Any]) -> bool:
    """Whether each env has a generator of its own, and a reset takes a seed for each."""
    inner = env.unwrapped
    return hasattr(inner, "env_fns") or isinstance(inner, EpisodicVectorEnv)


def info_of(infos: Mapping[str, Any], i: int) -> dict[str, Any]:
    """One env's entries of a VectorEnv's infos (`_key` masks whether env i has `key`)."""
    return {
        key: info_of(values, i) if isinstance(values, Mapping) else _number(values[i])
        for key, values, has in entries_of(infos)
        if has is None or has[i]
    }


def _number(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def entries_of(infos: Mapping[str, Any], default: Any = None) -> Iterator[tuple[str, Any, Any]]:
    """Name, values and mask of each entry; in a dictionary that has one, its own may have none."""
    for key, values in infos.items():
        if key not in _FINAL and not (key.startswith("_") and key[1:] in infos):
            mask = infos.get(f"_{key}")
            yield key, values, default if mask is None else mask.tolist()
