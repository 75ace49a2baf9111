"""The curves and maps of a report, as figures of plotly."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from typing import Any, NamedTuple, TypeAlias

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import pandas as pd

from curiosity_algos.common.arrays import Float64Array, Int64Array
from curiosity_algos.experiments.env_spec import make_env
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.measures import (
    Measure,
    Points,
    best_return,
    coverage,
    final_states,
    first_of,
    n_elites,
    qd_score,
    read_curves,
    times_to_first,
)
from curiosity_algos.experiments.report.tables import has_coverage
from curiosity_algos.experiments.statistics import Curve, curve_interval
from curiosity_gym.core import entry_names
from curiosity_gym.maze.maze_env import MazeEnv

PlotlyFigure: TypeAlias = dict[str, Any]
"""`data` and `layout` of a figure."""
Properties: TypeAlias = dict[str, Any]
Panel: TypeAlias = tuple[str, Measure, str]
"""The title of an axis, its measure, and the format of its ticks."""

MOST_ROWS = 200
"""Most points of a single run's curve."""
LEGEND_LINE = 22
"""Height in pixels of a line in the legend."""
N_CELLS = 50
"""Cells along either side of a map: in mazes those that coverage counts."""
SCALE = ("#440154", "#414487", "#2a788e", "#22a884", "#7ad151")
"""Viridis, without the end that is too light."""
FLOOR, WALL, START, GOAL = "#faf9f6", "#3a4254", "#c93b37", "#1f8f5f"
LAYOUT: Properties = {
    "template": "none",
    "paper_bgcolor": "rgba(0,0,0,0)",
    "plot_bgcolor": "rgba(0,0,0,0)",
    "font": {"family": "system-ui, Segoe UI, Roboto, DejaVu Sans, sans-serif", "size": 13},
    "margin": {"l": 8, "r": 12, "t": 8, "b": 8},
    "dragmode": False,
}
GRID = "rgba(136,136,136,0.35)"
AXIS: Properties = {"automargin": True, "gridcolor": GRID, "zerolinecolor": GRID}


# -- curves ---------------------------------------------------------------------------------------


def draw_curves(runs: pd.DataFrame, colors: dict[str, str]) -> PlotlyFigure:
    """Coverage, best return and share of runs without a success or reward, where they are known."""
    panels: list[Panel] = [("best return so far", best_return, "~g")]
    if has_coverage(runs):
        panels.insert(0, ("coverage", coverage, "~%"))
    return _draw(runs, colors, panels, event=first_of(runs))


def draw_elites(runs: pd.DataFrame, colors: dict[str, str]) -> PlotlyFigure:
    """QD score and number of elites of runs with one archive."""
    return _draw(runs, colors, [("QD score", qd_score, "~g"), ("elites", n_elites, "~g")])


def _draw(
    runs: pd.DataFrame, colors: dict[str, str], panels: list[Panel], event: str | None = None
) -> PlotlyFigure:
    """A panel for each measure, one above the other, and for the share without an event."""
    axes = [(title, ticks) for title, _, ticks in panels]
    traces = []
    for label, here in runs.groupby("label"):
        style = {"name": label, "legendgroup": label}, colors[str(label)]
        for i, (_, measure, _) in enumerate(panels):
            curves = read_curves(here, measure)
            traces.append(_runs(curves, *style, i))
            traces += _band_and_mean(curve_interval(curves), *style, i)
        if event:
            survival = times_to_first(here, event).curve
            traces += _band_and_mean(survival, *style, len(panels), "hv")
    if event:
        axes.append((f"runs without {event}", "~%"))
    return {"data": traces, "layout": _panels(axes, runs["label"].nunique())}


def _panels(axes: list[tuple[str, str]], n_labels: int) -> Properties:
    """The layout of panels with one x axis, from the titles and tick formats of their y axes."""
    layout = LAYOUT | {
        "xaxis": AXIS | {"title": "timesteps", "tickformat": "~s", "anchor": f"y{len(axes)}"},
        # The legend has room for a line for each label, as on a narrow page.
        "height": 90 + 240 * len(axes) + LEGEND_LINE * (n_labels - 1),
        "hovermode": "x",
        "dragmode": "zoom",
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0.0},
    }
    height = 1.0 / len(axes)
    for i, (name, ticks) in enumerate(axes):
        domain = [1.0 - (i + 1) * height + (i < len(axes) - 1) * 0.06, 1.0 - i * height]
        about = {"title": name, "tickformat": ticks, "domain": domain}
        layout[f"yaxis{i + 1}"] = AXIS | about | {"rangemode": "tozero", "fixedrange": True}
    return layout


def _runs(curves: list[Points], named: Properties, color: str, panel: int) -> Properties:
    """The curves of all runs as one trace, with a gap after each."""
    thinned = [(x[rows], y[rows]) for x, y in curves for rows in [evenly(len(x), MOST_ROWS)]]
    x, y = (np.concatenate([np.r_[run[axis], np.nan] for run in thinned]) for axis in (0, 1))
    line = {"color": color, "width": 1, "shape": "hv"}
    return _line(x, y, panel, line=line, opacity=0.45, hoverinfo="skip", **named)


def _band_and_mean(
    curve: Curve, named: Properties, color: str, panel: int, shape: str = "linear"
) -> Iterator[Properties]:
    edge = {"line": {"width": 0, "shape": shape}, "hoverinfo": "skip", **named}
    if not np.isnan(curve.low).all():
        yield _line(curve.x, curve.low, panel, **edge)
        fill = {"fill": "tonexty", "fillcolor": _faint(color)}
        yield _line(curve.x, curve.high, panel, **edge, **fill)
    line = {"color": color, "width": 2.5, "shape": shape}
    yield _line(curve.x, curve.estimate, panel, line=line, **named | {"showlegend": panel == 0})


def _faint(color: str) -> str:
    red, green, blue = bytes.fromhex(color[1:])
    return f"rgba({red},{green},{blue},0.2)"


def _line(x: npt.ArrayLike, y: npt.ArrayLike, panel: int = 0, **style: Any) -> Properties:
    points = {"x": np.asarray(x, dtype=np.float32), "y": np.asarray(y, dtype=np.float32)}
    line = {"type": "scatter", "mode": "lines", "showlegend": False, **points, **style}
    return line | {"yaxis": f"y{panel + 1}"}


def evenly(n: int, most: int) -> Int64Array:
    """At most `most` evenly spaced indices of n entries, with the first and the last."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(np.int64))


# -- maps -----------------------------------------------------------------------------------------


class Plane(NamedTuple):
    """A rectangle of the first two entries of the behavior.

    Attributes:
        low: (2,) its lower left corner.
        high: (2,) its upper right corner.
        names: Of the two entries.
        maze: If the entries are a robot's position in it.
    """

    low: Float64Array
    high: Float64Array
    names: tuple[str, ...]
    maze: MazeEnv | None = None


def plane_of(runs: pd.DataFrame) -> Plane | None:
    """The plane of final states; None if behaviors have fewer than two entries."""
    maze = _maze_of(runs["files"].iloc[0].description)
    if maze is not None:
        size = np.array([maze.layout.width, maze.layout.height])
        return Plane(np.zeros(2), size, maze.behavior_names[:2], maze)
    points = [_ends(run)[0] for run in runs["files"]]
    if any(ends.shape[1] < 2 for ends in points) or not sum(map(len, points)):
        return None
    # One final state far away would leave all others in a corner.
    low, high = np.percentile(np.concatenate(points), [0.5, 99.5], axis=0)
    described = (run.description.get("behavior_names") for run in runs["files"])
    names = next((entries[:2] for entries in described if entries is not None), None)
    return Plane(low, np.where(high > low, high, low + 1.0), entry_names(names, 2))


def _maze_of(described: dict[str, Any]) -> MazeEnv | None:
    """The maze of a run, if that is its environment, and is known here."""
    try:
        with closing(make_env(described, trust=False)) as wrapped:
            env = wrapped.unwrapped
    except (gym.error.Error, ValueError):
        return None
    return env if isinstance(env, MazeEnv) else None


def _ends(run: Run) -> tuple[Float64Array, Float64Array]:
    """The finite final states (n, 2 or fewer) of a run, and their timesteps (n,)."""
    states = final_states(run)
    points = states["behavior"][:, :2].astype(np.float64)
    is_finite = np.isfinite(points).all(axis=1)
    return points[is_finite], states["timesteps"][is_finite].astype(np.float64)


def draw_map(runs: pd.DataFrame, plane: Plane, longest: float) -> PlotlyFigure:
    """The cells in which episodes ended, colored by the first of any run, up to `longest` steps."""
    first = np.full((N_CELLS, N_CELLS), np.nan, dtype=np.float32)  # rows from below
    for points, timesteps in map(_ends, runs["files"]):
        shares = (points - plane.low) / (plane.high - plane.low)
        columns, rows = np.clip(shares * N_CELLS, 0, N_CELLS - 1).astype(np.int64).T
        np.fmin.at(first, (rows, columns), timesteps)
    width, height = ((plane.high - plane.low) / N_CELLS).tolist()
    x_name, y_name = plane.names
    cells = {
        "type": "heatmap",
        "z": first,
        **{"x0": plane.low[0] + width / 2, "dx": width},
        **{"y0": plane.low[1] + height / 2, "dy": height},
        **{"zmin": 0.0, "zmax": longest, "colorscale": SCALE, "showscale": False},
        "hoverongaps": False,
        "hovertemplate": "first after %{z:,.0f} timesteps<br>"
        f"{x_name}: %{{x:.3~g}}<br>{y_name}: %{{y:.3~g}}<extra></extra>",
    }
    layout = LAYOUT | {"plot_bgcolor": FLOOR}
    if plane.maze is None:
        fixed = AXIS | {"zeroline": False, "fixedrange": True}
        axes = {"xaxis": fixed | {"title": x_name}, "yaxis": fixed | {"title": y_name}}
        return {"data": [cells], "layout": layout | axes}
    x, y = ({"range": [0.0, side], "visible": False, "fixedrange": True} for side in plane.high)
    margin = {"l": 1, "r": 1, "t": 1, "b": 1}
    layout |= {"xaxis": x, "yaxis": y, "shapes": _shapes(plane.maze), "margin": margin}
    return {"data": [cells, _start(plane.maze)], "layout": layout}


def _start(maze: MazeEnv) -> Properties:
    marker = {"color": START, "size": 9, "line": {"color": "white", "width": 1}}
    x, y = np.array(maze.layout.start)[:, None]
    return _line(x, y, mode="markers", marker=marker, hovertemplate="start<extra></extra>")


def _shapes(maze: MazeEnv) -> list[Properties]:
    """Goal, walls and border."""
    layout = maze.layout
    (x, y), r = layout.goal, maze.maze.goal_radius
    walls = "".join(
        f"M{x:.6g},{y:.6g}H{x + width:.6g}V{y + height:.6g}H{x:.6g}Z"
        for x, y, width, height in layout.walls
    )
    goal = {"x0": x - r, "x1": x + r, "y0": y - r, "y1": y + r}
    border = {"x0": 0, "x1": layout.width, "y0": 0, "y1": layout.height}
    green = {"fillcolor": _faint(GOAL), "line": {"color": GOAL, "width": 2}}
    return [
        {"type": "circle", **goal, **green},
        {"type": "path", "path": walls, "fillcolor": WALL, "line": {"width": 0}},
        {"type": "rect", **border, "line": {"color": WALL, "width": 2}},
    ]
