"""Checks of arguments: one clear sentence, before anything changes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from numbers import Real

import numpy as np

from curiosity_gym.core import Float32Array

LARGEST_COUNT = 10**9
"""Beyond it no run ends, no memory holds so many, and 32 bits cannot number them."""
LARGEST = 1e12
"""The bound of other numbers: their squares are finite in 32 bits too."""


def check_whole(low: int, high: int, /, **values: object) -> None:
    """Raise ValueError unless every value is a whole number from `low` to `high`."""
    _check(
        lambda value: _is_whole(value, low, high), f"a whole number from {low} to {high}", values
    )


def check_at_least_one(**values: object) -> None:
    """Raise ValueError unless every value is a whole number from 1 to `LARGEST_COUNT`."""
    what = f"a whole number of at least 1, at most {LARGEST_COUNT:,}"
    _check(lambda value: _is_whole(value, 1, LARGEST_COUNT), what, values)


def check_positive(**values: object) -> None:
    """Raise ValueError unless every value is above 0 and at most `LARGEST`."""
    what = f"finite and above 0, at most {LARGEST:.0e}"
    _check(lambda value: 0.0 < _number(value) <= LARGEST, what, values)


def check_not_negative(**values: object) -> None:
    """Raise ValueError unless every value is from 0 to `LARGEST`."""
    what = f"finite and at least 0, at most {LARGEST:.0e}"
    _check(lambda value: 0.0 <= _number(value) <= LARGEST, what, values)


def check_share(**values: object) -> None:
    """Raise ValueError unless every value is a number from 0 to 1."""
    _check(lambda value: 0.0 <= _number(value) <= 1.0, "from 0 to 1", values)


def check_choice(choices: tuple[str, ...], **values: object) -> None:
    """Raise ValueError unless every value is one of the choices."""
    what = f"one of {', '.join(choices)}"
    _check(lambda value: isinstance(value, str) and value in choices, what, values)


def check_bool(**values: object) -> None:
    """Raise ValueError unless every value is True or False."""
    _check(lambda value: isinstance(value, bool | np.bool_), "True or False", values)


def check_keywords(**values: object) -> None:
    """Raise ValueError unless every value is None or a dictionary whose keys are names."""
    _check(_is_keywords, "None or a dictionary of keywords", values)


def check_render_mode(render_mode: object) -> None:
    """Raise ValueError unless `render_mode` is None or "rgb_array"."""
    what = 'None or "rgb_array"'
    _check(lambda value: value in (None, "rgb_array"), what, {"render_mode": render_mode})


def check_seed(seed: object) -> None:
    """Raise ValueError unless `seed` is None or a whole number of at least 0."""
    what = "None or a whole number of at least 0"
    _check(lambda value: value is None or _is_whole(value, 0, math.inf), what, {"seed": seed})


def as_float32(values: object) -> Float32Array:
    """The values as an array, without a copy where they are one; no numbers are an empty one."""
    try:
        return np.asarray(values, dtype=np.float32)
    except (TypeError, ValueError):
        return np.empty(0, dtype=np.float32)


def _check(is_valid: Callable[[object], bool], what: str, values: Mapping[str, object]) -> None:
    for name, value in values.items():
        if not is_valid(value):
            raise ValueError(f"`{name}` must be {what}, got {value!r}.")


def _is_whole(value: object, low: float, high: float) -> bool:
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


def _is_keywords(value: object) -> bool:
    return value is None or (isinstance(value, dict) and all(isinstance(k, str) for k in value))


def check_info(info: object) -> None:
    """Raise ValueError unless the info that an environment gave is a dictionary."""
    if not isinstance(info, dict):
        raise ValueError(
            f"`env` must give a dictionary as info with each reset and step, got {info!r:.60}."
        )
