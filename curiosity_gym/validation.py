"""Checks of arguments: one clear sentence, before anything changes."""

from __future__ import annotations

import math
from collections.abc import Callable
from numbers import Real
from typing import Any

import numpy as np

from curiosity_gym.core import Float32Array

LARGEST_COUNT = 10**9
"""Beyond it no run ends, no memory holds so many, and 32 bits cannot number them."""
LARGEST = 1e12  # the bound of other numbers: their squares are finite in 32 bits too


def _checker(what: str, is_valid: Callable[[Any], bool]) -> Callable[..., None]:
    """A function that raises ValueError unless each of its keywords has a valid value."""

    def check(**values: object) -> None:
        for name, value in values.items():
            if not is_valid(value):
                raise ValueError(f"`{name}` must be {what}, got {value!r}.")

    check.__doc__ = f"Raise ValueError unless every value is {what}."
    return check


def check_whole(low: int, high: int, /, **values: object) -> None:
    """Raise ValueError unless every value is a whole number from `low` to `high`."""
    what = f"a whole number from {low} to {high}"
    _checker(what, lambda value: is_whole(value, low, high))(**values)


def check_choice(choices: tuple[str, ...], **values: object) -> None:
    """Raise ValueError unless every value is one of the choices."""
    what = f"one of {', '.join(choices)}"
    _checker(what, lambda value: isinstance(value, str) and value in choices)(**values)


check_at_least_one = _checker(
    f"a whole number of at least 1, at most {LARGEST_COUNT:,}",
    lambda value: is_whole(value, 1, LARGEST_COUNT),
)
check_positive = _checker(
    f"finite and above 0, at most {LARGEST:.0e}", lambda value: 0.0 < _number(value) <= LARGEST
)
check_not_negative = _checker(
    f"finite and at least 0, at most {LARGEST:.0e}", lambda value: 0.0 <= _number(value) <= LARGEST
)
check_share = _checker("from 0 to 1", lambda value: 0.0 <= _number(value) <= 1.0)
check_bool = _checker("True or False", lambda value: isinstance(value, bool | np.bool_))
check_keywords = _checker(
    "None or a dictionary of keywords",
    lambda value: (
        value is None or (isinstance(value, dict) and all(isinstance(key, str) for key in value))
    ),
)
check_render_mode = _checker('None or "rgb_array"', lambda value: value in (None, "rgb_array"))
_check_seed = _checker(
    "None or a whole number of at least 0",
    lambda value: value is None or is_whole(value, 0, math.inf),
)


def check_seed(seed: object) -> None:
    """Raise ValueError unless `seed` is None or a whole number of at least 0."""
    _check_seed(seed=seed)


def as_float32(values: object) -> Float32Array:
    """The values as an array, without a copy where they are one; no numbers are an empty one."""
    try:
        return np.asarray(values, dtype=np.float32)
    except (TypeError, ValueError):
        return np.empty(0, dtype=np.float32)


def is_whole(value: object, low: float, high: float) -> bool:
    """Whether it is a whole number of Python or numpy in a range; Python counts True as 1."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        return False
    return low <= int(value) <= high


def _number(value: object) -> float:
    """`value` as a float, or NaN, which is in no range, where it is no real number."""
    try:
        return float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    except OverflowError:  # a whole number beyond floats
        return math.inf


def check_info(info: object) -> None:
    """Raise ValueError unless the info that an environment gave is a dictionary."""
    if not isinstance(info, dict):
        raise ValueError(
            f"`env` must give a dictionary as info with each reset and step, got {info!r:.60}."
        )
