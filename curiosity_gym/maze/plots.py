"""Matplotlib figures of a maze: the layout itself, and where a population of robots ended."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from curiosity_gym.core import Float64Array
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.maze.viewer import FLOOR, WALL

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
    positions: Float64Array, layout: MazeLayout, *, ax: "Axes | None" = None, bins: int = 100
) -> "Axes":
    """Plot how many positions are in each square of a maze; squares without one are left out.

    Args:
        positions: (n, 2) x, y, usually the final positions of all rollouts; n may be 0.
        layout: The maze.
        ax: Axes to draw on; new ones by default.
        bins: Number of squares along the longer side of the maze.

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
    side = max(layout.width, layout.height) / bins
    if len(positions):
        draw_counts([ax], [count(positions, layout, side)], side)
    return ax


def count(positions: Float64Array, layout: MazeLayout, side: float) -> NDArray[np.int64]:
    """How many positions (n, 2) are in each square of so many maze units, by y and x."""
    edges = [side * np.arange(np.ceil(size / side) + 1) for size in (layout.height, layout.width)]
    counts, _, _ = np.histogram2d(positions[:, 1], positions[:, 0], bins=edges)
    return counts.astype(np.int64)


def draw_counts(axes: "Sequence[Axes]", counts: Sequence[NDArray[np.int64]], side: float) -> None:
    """Draw counts, by y and x, in squares of a side on axes of a figure, with one bar of colors."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    norm = LogNorm(1, max(10, *(squares.max() for squares in counts)))
    for ax, squares in zip(axes, counts, strict=True):
        y, x = (side * np.arange(n + 1) for n in squares.shape)
        positive = np.ma.masked_equal(squares, 0)
        ax.pcolormesh(x, y, positive, norm=norm, zorder=0.5, rasterized=True)  # below the walls
    label = f"positions in a square of {side:g} x {side:g}"
    shrink = 0.9 if len(axes) == 1 else 0.5
    axes[0].figure.colorbar(ScalarMappable(norm), ax=list(axes), label=label, shrink=shrink)
