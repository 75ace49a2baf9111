"""`python -m benchmarks.opening RUNS` draws the moving picture that README and docs begin with.

Of two runs it shows where episodes ended, as they come: `curiosity sweep --algos curiosity_es
--envs CuriosityMaze-Hard-v0,CuriosityLocomotion-AntTrap-v0 --seeds 0 -n 3e6 -f RUNS`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NamedTuple

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import typer
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

from benchmarks.figures import IMAGES
from benchmarks.gallery import Frame, with_few_colors
from benchmarks.paper import THEMES
from curiosity_algos.experiments import load_final_states
from curiosity_algos.experiments.film import write_film
from curiosity_gym.built_in import resolve_layout
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.locomotion.worlds import TRAP
from curiosity_gym.maze.plots import draw_layout

RUNS = "CuriosityES/{}/0"
WORLDS = {
    "CuriosityMaze-Hard-v0": ("a robot in a maze", resolve_layout("hard"), (0.0, 0.0)),
    "CuriosityLocomotion-AntTrap-v0": ("an ant around a trap", TRAP, TRAP.start),
}
"""By environment what is shown, where, and the place that its positions count from."""
N_STEPS = 3_000_000
"""Of each run."""
N_FRAMES, N_STILL, N_COLORS = 40, 20, 64
DPI = 100


class Ends(NamedTuple):
    """Where the episodes of a run ended, in its world, and after how many steps of the run."""

    positions: npt.NDArray[np.float64]
    timesteps: npt.NDArray[np.int64]


def read_ends(run: Path, origin: tuple[float, float]) -> Ends:
    """The ends of a run's episodes."""
    states = load_final_states(run)
    return Ends(states["behavior"][:, :2] + np.array(origin), states["timesteps"])


def draw_panel(ax: Axes, layout: MazeLayout) -> PathCollection:
    """A world without dots yet, whose colors tell when they came."""
    draw_layout(ax, layout)
    ax.set(xticks=[], yticks=[], xlabel="", ylabel="")
    ax.spines[:].set_visible(False)
    return ax.scatter([], [], s=5, c=[], cmap="viridis", vmin=0, vmax=N_STEPS, linewidths=0)


def frames_of(ends: dict[str, Ends]) -> list[Frame]:
    """One picture for each time, all runs side by side."""
    layouts = [WORLDS[env][1] for env in ends]
    ratios = [layout.width / layout.height for layout in layouts]
    figure = Figure(figsize=(3.6 * sum(ratios), 4.0), dpi=DPI, layout="constrained")
    canvas, axes = FigureCanvasAgg(figure), figure.subplots(1, len(ends), width_ratios=ratios)
    dots = [draw_panel(*each) for each in zip(axes, layouts, strict=True)]
    frames = []
    for now in np.linspace(0.0, N_STEPS, N_FRAMES + 1)[1:]:
        for dot, (env, each) in zip(dots, ends.items(), strict=True):
            show_until(dot, each, now)
            dot.axes.set_title(f"{WORLDS[env][0]}, {now / 1e6:.1f} million steps")
        canvas.draw()
        frames.append(np.asarray(canvas.buffer_rgba())[..., :3].copy())
    return frames


def show_until(dot: PathCollection, ends: Ends, timesteps: float) -> None:
    """Show the episodes that a run has had by then."""
    is_past = ends.timesteps <= timesteps
    dot.set_offsets(ends.positions[is_past])
    dot.set_array(ends.timesteps[is_past])


def main(
    runs: Annotated[Path, typer.Argument(help="Folder of the sweep.")], out: Path = IMAGES
) -> None:
    """Write the picture, for light pages and for dark ones."""
    ends = {
        env: read_ends(runs / RUNS.format(env), origin) for env, (_, _, origin) in WORLDS.items()
    }
    for ending, theme in THEMES.items():
        with mpl.rc_context(theme):
            frames = with_few_colors(frames_of(ends), N_COLORS)
        write_film([*frames, *[frames[-1]] * N_STILL], out / f"opening{ending}.gif")


if __name__ == "__main__":
    typer.run(main)
