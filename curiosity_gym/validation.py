"""Checks of arguments: one clear sentence, before anything changes."""

from __future__ import annotations

import copy
import math
from numbers import Integral, Real
from typing import TypeGuard

import numpy as np

LARGEST_COUNT = 10**9
"""Beyond it no run ends, no memory holds so many, and 32 bits cannot number them."""
LARGEST = 1e12
"""Of other numbers: their squares are finite in 32 bits too."""


def check_whole(low: int, high: int, /, **values: object) -> None:
    """Raise ValueError unless every value is a whole number from `low` to `high`."""
    for name, value in values.items():
        if not (_is_whole(value) and low <= value <= high):
            raise ValueError(
                f"`{name}` must be a whole number from {low} to {high}, got {value!r}."
            )


def check_at_least_one(**values: object) -> None:
    """Raise ValueError unless every value is a whole number from 1 to `LARGEST_COUNT`."""
    for name, value in values.items():
        if not (_is_whole(value) and value >= 1):
            raise ValueError(f"`{name}` must be a whole number of at least 1, got {value!r}.")
        _check_largest(name, value, LARGEST_COUNT)


def check_positive(**values: object) -> None:
    """Raise ValueError unless every value is above 0 and at most `LARGEST`."""
    for name, value in values.items():
        if not 0.0 < (number := _number(value)) < math.inf:
            raise ValueError(f"`{name}` must be finite and above 0, got {value!r}.")
        _check_largest(name, number, LARGEST)


def check_not_negative(**values: object) -> None:
    """Raise ValueError unless every value is from 0 to `LARGEST`."""
    for name, value in values.items():
        if not 0.0 <= (number := _number(value)) < math.inf:
            raise ValueError(f"`{name}` must be finite and at least 0, got {value!r}.")
        _check_largest(name, number, LARGEST)


def _check_largest(name: str, value: float, largest: float) -> None:
    if value > largest:
        raise ValueError(f"`{name}` must be at most {largest:.0e}, got {value!r}.")


def check_share(**values: object) -> None:
    """Raise ValueError unless every value is a number from 0 to 1."""
    for name, value in values.items():
        if not 0.0 <= _number(value) <= 1.0:
            raise ValueError(f"`{name}` must be from 0 to 1, got {value!r}.")


def _is_whole(value: object) -> TypeGuard[int]:
    """Whether it is a whole number of Python or numpy; Python counts True as 1."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def _number(value: object) -> float:
    """`value` as a float, or NaN, which is in no range, where it is no real number."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return math.nan
    try:
        return float(value)
    except OverflowError:  # a whole number beyond floats
        return math.inf


def check_choice(choices: tuple[str, ...], **values: object) -> None:
    """Raise ValueError unless every value is one of the choices."""
    for name, value in values.items():
        if not (isinstance(value, str) and value in choices):
            raise ValueError(f"`{name}` must be one of {', '.join(choices)}, got {value!r}.")


def check_bool(**values: object) -> None:
    """Raise ValueError unless every value is True or False."""
    for name, value in values.items():
        if not isinstance(value, bool | np.bool_):
            raise ValueError(f"`{name}` must be True or False, got {value!r}.")


def check_keywords(**values: object) -> None:
    """Raise ValueError unless every value is None or a dictionary whose keys are names."""
    for name, value in values.items():
        if value is None or (isinstance(value, dict) and all(isinstance(k, str) for k in value)):
            continue
        raise ValueError(f"`{name}` must be None or a dictionary of keywords, got {value!r}.")


def check_seed(seed: object) -> None:
    """Raise ValueError unless `seed` is None or a whole number of at least 0."""
    if not (seed is None or (_is_whole(seed) and seed >= 0)):
        raise ValueError(f"`seed` must be None or a whole number of at least 0, got {seed!r}.")


def check_copyable(**values: object) -> None:
    """Raise ValueError unless `copy.deepcopy` copies every value."""
    for name, value in values.items():
        try:
            copy.deepcopy(value)
        except Exception as error:  # of any kind: objects copy themselves as they like
            raise ValueError(
                f"`{name}` must be what `copy.deepcopy` copies, got {value!r:.60} ({error})."
            ) from error


def check_info(info: object) -> None:
    """Raise ValueError unless the info that an environment gave is a dictionary."""
    if not isinstance(info, dict):
        raise ValueError(
            f"`env` must give a dictionary as info with each reset and step, got {info!r:.60}."
        )
