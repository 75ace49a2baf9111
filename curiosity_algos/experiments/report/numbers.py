"""Numbers as text."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from curiosity_algos.experiments.statistics import Interval

NOTHING = "\N{EN DASH}"
"""Where there is no number."""


def whole(value: float) -> str:
    """1234567.0 as "1,234,567"."""
    return f"{value:,.0f}"


def counted(n: int, thing: str) -> str:
    """1 as "1 run", 2 as "2 runs"."""
    return f"{n} {thing}" if n == 1 else f"{n:,} {thing}s"


def short(value: float | None) -> str:
    """1234567.0 as "1.23M", three digits with a unit."""
    if value is None or math.isnan(value):
        return NOTHING
    for unit, size in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if abs(value) >= 0.9995 * size:
            return f"{float(f'{value / size:.3g}'):g}{unit}"
    return f"{value:.3g}"


def percent(share: float) -> str:
    """0.1234 as "12.3 %", 0.000123 as "0.012 %", with a space that does not break."""
    value = 100.0 * share
    small = np.format_float_positional(value, precision=2, fractional=False, trim="-")
    return f"{f'{value:.1f}' if value >= 0.1 or value == 0.0 else small}\N{NO-BREAK SPACE}%"


def score(value: float) -> str:
    """0.12345 as "0.123", large ones with thousands separators."""
    return f"{value:,.3f}" if abs(value) < 1000.0 else whole(value)


def interval(numbers: Interval, text: Callable[[float], str]) -> str:
    """An estimate and its bounds; a single run has none."""
    estimate = text(numbers.estimate)
    if math.isnan(numbers.low):
        return estimate
    return f"{estimate} ({text(numbers.low)} to {text(numbers.high)})"
