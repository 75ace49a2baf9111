"""Checks of arguments: one clear sentence, before anything changes."""

from __future__ import annotations

import copy
import math
import operator
from numbers import Real

import numpy as np


def check_at_least_one(**values: object) -> None:
    """Raise ValueError unless every value is a whole number of at least 1."""
    for name, value in values.items():
        try:
            # Python counts True as 1.
            is_valid = not isinstance(value, bool | np.bool_) and operator.index(value) >= 1  # type: ignore[arg-type]
        except TypeError:
            is_valid = False
        if not is_valid:
            raise ValueError(f"`{name}` must be a whole number of at least 1, got {value!r}.")


def check_positive(**values: object) -> None:
    """Raise ValueError unless every value is a finite number above 0."""
    for name, value in values.items():
        if not 0.0 < _number(value) < math.inf:
            raise ValueError(f"`{name}` must be finite and above 0, got {value!r}.")


def check_not_negative(**values: object) -> None:
    """Raise ValueError unless every value is a finite number of at least 0."""
    for name, value in values.items():
        if not 0.0 <= _number(value) < math.inf:
            raise ValueError(f"`{name}` must be finite and at least 0, got {value!r}.")


def check_share(**values: object) -> None:
    """Raise ValueError unless every value is a number from 0 to 1."""
    for name, value in values.items():
        if not 0.0 <= _number(value) <= 1.0:
            raise ValueError(f"`{name}` must be from 0 to 1, got {value!r}.")


def _number(value: object) -> float:
    """`value` as a float, or NaN, which is in no range, where it is no real number."""
    return float(value) if isinstance(value, Real) else math.nan


def check_choice(choices: tuple[str, ...], **values: object) -> None:
    """Raise ValueError unless every value is one of the choices."""
    for name, value in values.items():
        if value not in choices:
            raise ValueError(f"`{name}` must be one of {', '.join(choices)}, got {value!r}.")


def check_bool(**values: object) -> None:
    """Raise ValueError unless every value is True or False."""
    for name, value in values.items():
        if not isinstance(value, bool | np.bool_):
            raise ValueError(f"`{name}` must be True or False, got {value!r}.")


def check_seed(seed: object) -> None:
    """Raise ValueError unless `seed` is None or a whole number of at least 0."""
    try:
        is_valid = seed is None or operator.index(seed) >= 0  # type: ignore[arg-type]
    except TypeError:
        is_valid = False
    if not is_valid:
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
