"""Matplotlib figures of a maze: the layout itself, and where a population of robots ended."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from curiosity_gym.layouts import MazeLayout
from curiosity_gym.maze.viewer import FLOOR, WALL

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]


def draw_layout(ax: "Axes", layout: MazeLayout) -> None:
    """Draw walls, start (red dot) and goal (black cross) to scale on axes, in maze units."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle
    from matplotlib.patheffects import withStroke

    boxes = [Rectangle((x, y), width, height) for x, y, width, height in layout.walls]
    ax.add_collection(PatchCollection(boxes, facecolor=WALL, linewidth=0))
    ax.plot(*layout.start, "o", color="red", markersize=7, zorder=4, label="start")
    goal = ax.plot(*layout.goal, "x", color="black", markersize=9, mew=2.5, zorder=4, label="goal")
    goal[0].set_path_effects([withStroke(linewidth=4, foreground=FLOOR)])  # on a dark page, too
    ax.set(xlim=(0, layout.width), ylim=(0, layout.height), aspect="equal", facecolor=FLOOR)
    ax.set(xlabel="x", ylabel="y")


def plot_density(
    positions: FloatArray, layout: MazeLayout, *, ax: "Axes | None" = None, bins: int = 100
) -> "Axes":
    """Plot every position over the maze, colored by how many lie around it.

    Args:
        positions: (n, 2) x, y, usually the final positions of all rollouts; n may be 0.
        layout: The maze.
        ax: Axes to draw on; new ones by default.
        bins: Number of cells along the longer side of the maze in which positions are counted.

    Returns:
        The axes.

    Raises:
        ValueError: `positions` is not (n, 2) or holds something else than finite numbers.
    """
    positions = np.asarray(positions, dtype=np.float64)
    if positions.ndim != 2 or positions.shape[1] != 2 or not np.isfinite(positions).all():
        raise ValueError(f"positions must be finite of shape (n, 2), got shape {positions.shape}.")
    if ax is None:
        from matplotlib import pyplot as plt

        ax = plt.figure(figsize=(7, 6), layout="constrained").add_subplot()
    draw_layout(ax, layout)
    if len(positions):
        draw_densities([ax], [positions], max(layout.width, layout.height) / bins)
    return ax


def draw_densities(
    axes: "Sequence[Axes]", positions: Sequence[FloatArray], cell_size: float
) -> None:
    """Draw positions on one or several axes of a figure, with one bar of colors for all of them.

    Args:
        axes: At least one, each of a maze.
        positions: For each of the axes x, y, (n, 2), at least one in all.
        cell_size: Side of the square cells in which positions are counted (maze units).
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    counts = [_local_counts(each, cell_size) for each in positions]
    norm = LogNorm(1, max(10, np.concatenate(counts).max()))
    for ax, each, numbers in zip(axes, positions, counts, strict=True):
        order = np.argsort(numbers, kind="stable")  # the densest on top
        x, y = each[order].T
        dots = ax.scatter(x, y, c=numbers[order], norm=norm, s=4, alpha=0.5, linewidths=0, zorder=3)
        dots.set_rasterized(True)  # a PDF of 1e5 vector dots hardly opens
    # The dots' own colorbar would be as transparent as they are.
    label = f"positions in a cell of {cell_size:g} x {cell_size:g}"
    shrink = 0.9 if len(axes) == 1 else 0.5
    axes[0].figure.colorbar(ScalarMappable(norm), ax=list(axes), label=label, shrink=shrink)


def _local_counts(positions: FloatArray, cell_size: float) -> NDArray[np.intp]:
    """Return how many positions share the cell of each position, itself included, (n,)."""
    cells = np.floor(positions / cell_size).astype(np.int64)
    _, index, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    return counts[index]
