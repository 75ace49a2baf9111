"""Heat maps of an archive over the behavior: the best objectives, or the numbers of elites."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from ribs.archives import CVTArchive, GridArchive

from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.archives.verify import behaviors_of
from curiosity_algos.common.arrays import Float64Array
from curiosity_gym.core import entry_names
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.maze.plots import draw_layout
from curiosity_gym.validation import check_at_least_one, check_choice

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from curiosity_algos.archives.base import EliteArchive

Cells = tuple[Float64Array, Float64Array, Float64Array]
"""Values (nx, ny), and the cells' edges along x (nx + 1,) and y (ny + 1,)."""

STATISTICS = {"objective": ("max", "best objective"), "elites": ("count", "elites in a cell")}
"""What counts of the objectives in a cell, and its label."""
DEFAULT_CELLS = 50


def plot_archive(
    archive: EliteArchive | GridArchive | CVTArchive,
    layout: MazeLayout | None = None,
    *,
    by: str = "objective",
    dimensions: tuple[int, int] = (0, 1),
    behavior_names: Sequence[str] | None = None,
    n_cells: int | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Plot a heat map of an archive's elites over two of the behavior's dimensions.

    Args:
        archive: Holds the elites, one of pyribs' too; it may be empty.
        layout: The maze whose walls are drawn, and which cells span that are not the archive's own;
            without it they span the elites' range.
        by: "objective": the best objective in a cell; "elites": how many there are.
        dimensions: Which entries of the behavior are x and y.
        behavior_names: A name for each entry of the behavior. None: "x" and "y" in a maze, else
            "behavior 1" and so on.
        n_cells: Cells along each of the two. None: those of a grid, else 50.
        ax: Axes to draw on; new ones by default.

    Returns:
        The axes; cells without elites are transparent.

    Raises:
        ValueError: If `by`, `dimensions` or `n_cells` is out of its range, or there are not as many
            names as entries.
    """
    check_choice(tuple(STATISTICS), by=by)
    check_at_least_one(n_cells=DEFAULT_CELLS if n_cells is None else n_cells)
    behaviors = behaviors_of(archive)
    _check_dimensions(dimensions, behaviors.shape[1])
    names = entry_names(behavior_names, behaviors.shape[1])
    if ax is None:
        from matplotlib import pyplot as plt

        ax = plt.figure(figsize=(7, 6), layout="constrained").add_subplot()
    if layout is not None:
        draw_layout(ax, layout)
    if layout is None or behavior_names is not None:
        x, y = dimensions
        ax.set(xlabel=names[x], ylabel=names[y])
    if len(behaviors):
        cells = _count_cells(archive, dimensions, by, n_cells, layout)
        _draw_cells(ax, *cells, by=by)
    return ax


def _check_dimensions(dimensions: Sequence[int], n_dimensions: int) -> None:
    if len(dimensions) != 2 or len({*dimensions} & {*range(n_dimensions)}) != 2:
        raise ValueError(
            f"`dimensions` must be two different whole numbers from 0 to {n_dimensions - 1}, "
            f"got {dimensions!r}."
        )


def _count_cells(
    archive: Any,
    dimensions: Sequence[int],
    by: str,
    n_cells: int | None,
    layout: MazeLayout | None,
) -> Cells:
    from scipy.stats import binned_statistic_2d

    objective, statistic = archive.data("objective"), STATISTICS[by][0]
    is_grid = isinstance(archive, SparseGridArchive | GridArchive)
    if n_cells is None and is_grid and "behavior" not in archive.field_list:
        # By their cells: whoever lies at a border, a rounding would put elsewhere.
        places = archive.int_to_grid_index(archive.data("index"))[:, list(dimensions)]
        edges = [archive.boundaries[dimension] for dimension in dimensions]
        bins = [np.arange(len(each)) - 0.5 for each in edges]
        return (binned_statistic_2d(*places.T, objective, statistic, bins).statistic, *edges)
    positions = behaviors_of(archive)[:, list(dimensions)]
    spans = np.column_stack([positions.min(axis=0), positions.max(axis=0)])
    if layout is not None:
        spans = np.array([[0.0, layout.width], [0.0, layout.height]])
    n = n_cells or DEFAULT_CELLS
    cells = binned_statistic_2d(*positions.T, objective, statistic, n, range=spans)
    return cells.statistic, cells.x_edge, cells.y_edge


def _draw_cells(
    ax: Axes, cells: Float64Array, x_edges: Float64Array, y_edges: Float64Array, *, by: str
) -> None:
    from matplotlib.colors import LogNorm

    norm = None
    if by == "elites":
        norm = LogNorm(1, max(10, cells.max()))
        cells[cells == 0] = np.nan  # as where there is no best objective
    # Below the walls, which cells at their edges would cover.
    mesh = ax.pcolormesh(x_edges, y_edges, cells.T, norm=norm, zorder=0.5)
    ax.figure.colorbar(mesh, ax=ax, label=STATISTICS[by][1], shrink=0.9)
