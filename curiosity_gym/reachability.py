"""The free space of a maze that a robot can reach from a start, exactly.

The edges of the grown walls cut the world into rectangles, each wholly free or wholly blocked. A
flood fill over shared sides finds the free ones that the start reaches.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from curiosity_gym.core import Float64Array, Mask

IntArray = NDArray[np.integer]

# Edges closer than this are one edge: 0.1 + 0.2 and 0.3 leave no gap for the robot.
_DECIMALS = 9


class Region(NamedTuple):
    """The union of the rectangles `[xs[i], xs[i + 1]] x [ys[j], ys[j + 1]]` with `mask[i, j]`."""

    xs: Float64Array
    ys: Float64Array
    mask: Mask

    def cells(self, size: tuple[float, float], n_cells: int) -> Mask:
        """Which cells of a grid over a world of a size hold an open piece of it, [ix, iy]."""
        # As numbers: numpy multiplies truth values a hundred times slower.
        columns = _overlaps(self.xs, np.linspace(0.0, size[0], n_cells + 1)).astype(np.float32)
        rows = _overlaps(self.ys, np.linspace(0.0, size[1], n_cells + 1)).astype(np.float32)
        return columns.T @ self.mask.astype(np.float32) @ rows > 0.0

    def distance(self, point: tuple[float, float]) -> float:
        """Return the distance from a point to the region, infinite if the region is empty."""
        gap_x, gap_y = (
            np.maximum(np.maximum(edges[:-1] - value, value - edges[1:]), 0.0)
            for edges, value in zip((self.xs, self.ys), point, strict=True)
        )
        distances = np.hypot(gap_x[:, None], gap_y[None, :])
        return float(distances[self.mask].min(initial=np.inf))


def reachable_region(
    walls: Float64Array, size: tuple[float, float], start: Sequence[float], radius: float
) -> Region:
    """Return where the center of a robot of a half-width can get to from a start.

    Walls (n, 4) that touch leave no way between them, and neither does a common corner.
    """
    left, right, xs = _grown_spans(walls[:, 0], walls[:, 2], size[0], radius)
    bottom, top, ys = _grown_spans(walls[:, 1], walls[:, 3], size[1], radius)
    free = np.ones((xs.size - 1, ys.size - 1), dtype=np.bool_)
    for i in range(len(walls)):
        free[left[i] : right[i], bottom[i] : top[i]] = False
    at_start = np.outer(_holds(xs, start[0]), _holds(ys, start[1]))
    return Region(xs, ys, _flood(free, at_start & free))


def _grown_spans(
    low: Float64Array, length: Float64Array, size: float, radius: float
) -> tuple[IntArray, IntArray, Float64Array]:
    """Return the two ends of the grown walls along an axis as indices of its edges, and these."""
    limits = np.array([radius, size - radius])
    ends = np.concatenate([limits, low - radius, low + length + radius])
    edges, index = np.unique(np.round(np.clip(ends, *limits), _DECIMALS), return_inverse=True)
    return index[2 : 2 + low.size], index[2 + low.size :], edges


def _holds(edges: Float64Array, value: float) -> Mask:
    """Mark the intervals that hold a value; two do where it is their common edge."""
    value = round(value, _DECIMALS)
    return (edges[:-1] <= value) & (value <= edges[1:])


def _overlaps(edges: Float64Array, others: Float64Array) -> Mask:
    """Mark which intervals of one axis (rows) share an open piece with another's (columns)."""
    low = np.maximum(edges[:-1, None], others[None, :-1])
    high = np.minimum(edges[1:, None], others[None, 1:])
    return high - low > 10.0**-_DECIMALS


def _flood(free: Mask, reached: Mask) -> Mask:
    """Spread over free neighbors; in plain Python, which takes less than to import what does it."""
    left, row = np.pad(free & ~reached, 1), free.shape[1] + 2
    is_left = bytearray(left)
    pending = np.flatnonzero(np.pad(reached, 1)).tolist()
    while pending:
        place = pending.pop()
        for other in (place - row, place - 1, place + 1, place + row):
            if is_left[other]:
                is_left[other] = False
                pending.append(other)
    still_left = np.frombuffer(is_left, dtype=bool).reshape(left.shape)
    return free & ~still_left[1:-1, 1:-1]
