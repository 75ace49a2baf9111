"""Arrays as text, as small as their numbers allow."""

from __future__ import annotations

import base64
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Packed: TypeAlias = dict[str, Any]
NO_VALUE = 65_535
"""Stands for NaN among quantized numbers, and for "never" among indices."""


def pack(values: npt.ArrayLike, kind: str) -> Packed:
    """An array for the page's `decode`.

    Args:
        values: (n,).
        kind: "u2", "u4" or "f4": whole numbers of 2 or 4 bytes, or floats of 4.
    """
    array = np.ascontiguousarray(values, dtype=np.dtype(f"<{kind}"))
    return {"kind": kind, "data": base64.b64encode(array.tobytes()).decode()}


def quantize(values: npt.ArrayLike, low: float, high: float) -> Packed:
    """Numbers from `low` to `high` in steps of 1 / 65,534 of that range; those outside are clipped.

    NaN becomes `NO_VALUE`.
    """
    array = np.asarray(values, dtype=np.float64)
    width = high - low if high > low else 1.0
    steps = np.clip(np.round((array - low) / width * (NO_VALUE - 1)), 0, NO_VALUE - 1)
    return pack(np.where(np.isnan(array), NO_VALUE, steps), "u2") | {"low": low, "width": width}


def evenly(n: int, most: int) -> npt.NDArray[np.int64]:
    """Indices of at most `most` of n entries, evenly spaced, the first and the last among them."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(np.int64))
