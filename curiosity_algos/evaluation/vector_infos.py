"""What Gymnasium's vector environments say of each of theirs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv

from curiosity_gym.episodic_vector_env import EpisodicVectorEnv

_FINAL = ("final_obs", "final_info")


def has_generators(env: VectorEnv[Any, Any, Any]) -> bool:
    """Whether each env has a generator of its own, and a reset takes a seed for each."""
    inner = env.unwrapped
    return hasattr(inner, "env_fns") or isinstance(inner, EpisodicVectorEnv)


def info_rows(infos: Mapping[str, Any], n: int) -> list[dict[str, Any]]:
    """Infos of a VectorEnv as one dictionary an env, those of ended episodes aside.

    `_key` masks which envs have `key`; in a dictionary that has a mask, its own may have none.
    """
    rows: list[dict[str, Any]] = [{} for _ in range(n)]
    for key, values in infos.items():
        if key in _FINAL or (key.startswith("_") and key[1:] in infos):
            continue
        mask = infos.get(f"_{key}")
        has = [True] * n if mask is None else mask.tolist()
        for row, value, is_there in zip(rows, _each(values, n), has, strict=True):
            if is_there:
                row[key] = value
    return rows


def _each(values: Any, n: int) -> Any:
    """One value an env; numbers as Python has them."""
    if isinstance(values, Mapping):
        return info_rows(values, n)
    return values.tolist() if isinstance(values, np.ndarray) and values.ndim == 1 else values
