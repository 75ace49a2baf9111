"""Maps of where episodes ended, of each final state and of each cell, over the generations."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from curiosity_algos.experiments.report.arrays import NO_VALUE, evenly, pack
from curiosity_algos.experiments.report.collect import Run
from curiosity_algos.experiments.report.planes import N_CELLS, Plane

MOST_STATES = 15_000
"""Final states of a run that are drawn, evenly spaced over its episodes."""
MOST_STOPS = 300
"""Moments of a run that the slider stops at, evenly spaced over its generations."""


def maps(run: Run, plane: Plane) -> dict[str, Any]:
    """Final states of a run, and the cells that they are in.

    Returns:
        `states`, the pixel of each final state that is drawn, in the order of episodes; `ended_in`,
        the first stop by which an episode had ended in each cell; of each stop its `timesteps`,
        `generations` and how many `states` are drawn by then. Cells are those of all episodes.
    """
    is_finite = np.isfinite(run.episodes["behavior"]).all(axis=1)
    points, timesteps = (run.episodes[name][is_finite] for name in ("behavior", "timesteps"))
    stops = _stops(run)
    shown = evenly(len(points), MOST_STATES)
    return {
        "states": pack(plane.indices(points[shown], plane.pixels), "u2"),
        "ended_in": pack(_first_stops(points, timesteps, stops, plane), "u2"),
        "timesteps": pack(stops, "f4"),
        "generations": pack(_generations(run, stops), "u4"),
        "shown": pack(np.searchsorted(timesteps[shown], stops, side="right"), "u4"),
    }


def n_stops(run: Run) -> int:
    """How many moments of a run a slider stops at."""
    return len(_stops(run))


def _stops(run: Run) -> npt.NDArray[Any]:
    """Timesteps at which generations ended, (n,)."""
    ends = np.unique(run.episodes["timesteps"])
    return ends[evenly(len(ends), MOST_STOPS)]


def _first_stops(
    points: npt.NDArray[Any], timesteps: npt.NDArray[Any], stops: npt.NDArray[Any], plane: Plane
) -> npt.NDArray[np.int64]:
    """The stop at which an episode first ended in each cell, `NO_VALUE` where none did."""
    first = np.full(N_CELLS * N_CELLS, NO_VALUE)
    cells = plane.indices(points, (N_CELLS, N_CELLS))
    np.minimum.at(first, cells, np.searchsorted(stops, timesteps))
    return first


def _generations(run: Run, stops: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The generation that has ended at each stop; of an algorithm without, the episode."""
    number = run.episodes["generation"]
    if not number.any():
        number = np.arange(1, len(number) + 1)
    return number[np.searchsorted(run.episodes["timesteps"], stops, side="right") - 1]
