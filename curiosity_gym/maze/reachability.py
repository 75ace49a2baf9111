"""What a robot can reach in a maze, exactly: the part of the free space connected to a start.

Coordinate compression: the edges of the grown walls cut the world into rectangles, each wholly free
or wholly blocked, and a flood fill over shared sides finds the free ones that the start reaches.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

# Edges closer than this are one edge: 0.1 + 0.2 and 0.3 leave no gap for the robot.
_DECIMALS = 9


class Region(NamedTuple):
    """The union of the rectangles `[xs[i], xs[i + 1]] x [ys[j], ys[j + 1]]` with `mask[i, j]`."""

    xs: FloatArray
    ys: FloatArray
    mask: BoolArray

    def cells(self, size: tuple[float, float], n_cells: int) -> BoolArray:
        """Mark the cells of a regular grid over a world of a size that hold an open piece of it.

        Returns:
            (n_cells, n_cells), indexed [ix, iy].
        """
        columns = _overlaps(self.xs, np.linspace(0.0, size[0], n_cells + 1))
        rows = _overlaps(self.ys, np.linspace(0.0, size[1], n_cells + 1))
        return columns.T @ self.mask @ rows

    def distance(self, point: tuple[float, float]) -> float:
        """Return the distance from a point to the region, infinite if the region is empty."""
        gap_x, gap_y = (
            np.maximum(np.maximum(edges[:-1] - value, value - edges[1:]), 0.0)
            for edges, value in zip((self.xs, self.ys), point, strict=True)
        )
        distances = np.hypot(gap_x[:, None], gap_y[None, :])
        return float(distances[self.mask].min(initial=np.inf))


def reachable_region(
    walls: FloatArray, size: tuple[float, float], start: Sequence[float], radius: float
) -> Region:
    """Return where the center of a robot can get to from a start.

    Walls that touch leave no way between them, and neither does a common corner.

    Args:
        walls: (n, 4) x, y, width, height.
        size: Width and height of the world, whose border is a wall too.
        start: (x, y); where it is a corner of two pieces, both are reached.
        radius: Half-width of the robot, by which walls and border are grown.
    """
    left, right, xs = _grown_spans(walls[:, 0], walls[:, 2], size[0], radius)
    bottom, top, ys = _grown_spans(walls[:, 1], walls[:, 3], size[1], radius)
    free = np.ones((xs.size - 1, ys.size - 1), dtype=bool)
    for x0, x1, y0, y1 in zip(left, right, bottom, top, strict=True):
        free[x0:x1, y0:y1] = False
    at_start = np.outer(_holds(xs, start[0]), _holds(ys, start[1]))
    return Region(xs, ys, _flood(free, at_start & free))


def _grown_spans(
    low: FloatArray, length: FloatArray, size: float, radius: float
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the two ends of the grown walls along an axis as indices of its edges, and these."""
    limits = np.array([radius, size - radius])
    ends = np.concatenate([limits, low - radius, low + length + radius])
    edges, index = np.unique(np.round(np.clip(ends, *limits), _DECIMALS), return_inverse=True)
    return index[2 : 2 + low.size], index[2 + low.size :], edges


def _holds(edges: FloatArray, value: float) -> BoolArray:
    """Mark the intervals that hold a value; two do where it is their common edge."""
    value = round(value, _DECIMALS)
    return (edges[:-1] <= value) & (value <= edges[1:])


def _overlaps(edges: FloatArray, others: FloatArray) -> BoolArray:
    """Mark which intervals of one axis (rows) share an open piece with another's (columns)."""
    low = np.maximum(edges[:-1, None], others[None, :-1])
    high = np.minimum(edges[1:, None], others[None, 1:])
    return high - low > 10.0**-_DECIMALS


def _flood(free: BoolArray, reached: BoolArray) -> BoolArray:
    """Spread over free neighbors, a whole straight run at a time: a round for each two turns."""
    columns, rows = _run_labels(free), _run_labels(free.T)
    while True:
        spread = _fill_runs(reached, columns) & free
        spread = _fill_runs(spread.T, rows).T & free
        if np.array_equal(spread, reached):
            return reached
        reached = spread


def _run_labels(free: BoolArray) -> IntArray:
    """Number the runs of free entries along the last axis, each with the blocked one before it."""
    begins = ~free
    begins[:, 0] = True
    return np.cumsum(begins, dtype=np.intp).reshape(free.shape)


def _fill_runs(reached: BoolArray, labels: IntArray) -> BoolArray:
    touched = np.zeros(labels[-1, -1] + 1, dtype=bool)
    touched[labels[reached]] = True
    return touched[labels]
