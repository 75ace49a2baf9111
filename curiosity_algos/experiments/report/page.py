"""The report's page: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from importlib import resources
from pathlib import Path

import pandas as pd

from curiosity_algos.experiments.labels import color_labels
from curiosity_algos.experiments.loading import StrPath
from curiosity_algos.experiments.measures import load_compared, with_archives
from curiosity_algos.experiments.report import pictures
from curiosity_algos.experiments.report.tables import AHEAD, BEHIND, named, pairs, summary
from curiosity_algos.state.atomic_file import atomic_file
from curiosity_gym.extras import import_extra
from curiosity_gym.validation import check_choice

KEY = (
    '<p class="key">First episode that ended in a cell: at the start <span class="ramp"></span> '
    "after {:,.0f} timesteps{}</p>"
)
PAIRS_KEY = (
    f'<p class="key">How likely a run of the first is ahead of a run of the second; where the 95 % '
    f"interval excludes one half: {AHEAD} the first is ahead, {BEHIND} the second is</p>"
)
MARKS = (
    f'<span class="mark" style="background: {pictures.START}"></span> start '
    f'<span class="mark" style="border: 2px solid {pictures.GOAL}"></span> goal'
)
NOT_BEGUN = "Left out, as no episode had ended at the last checkpoint"
REPEATED = (
    "Left out, as another run of the same seed, algorithm and settings is there, which counts once"
)


def write_report(folders: StrPath | Iterable[StrPath], out: StrPath) -> pd.DataFrame:
    """Write a page about all runs in folders; the same runs give the same bytes.

    Args:
        folders: One or several folders of runs, or folders that contain such.
        out: HTML file of the page; its folder need not exist yet.

    Returns:
        A row for each run on the page, as of `load_runs`.

    Raises:
        FileNotFoundError: If there is no run in one of the folders.
        IsADirectoryError: If `out` is a folder.
        ValueError: If `out` does not end in .html, or a run is of another format or damaged.
        gymnasium.error.DependencyNotInstalled: If plotly is not installed.
    """
    graphs, offline = import_extra("report", "plotly.graph_objects", "plotly.offline")
    if Path(out).is_dir():
        raise IsADirectoryError(f"`out` must be a file, {out} is a folder.")
    check_choice((".html", ".htm"), out=Path(out).suffix.lower())
    runs = load_compared(folders)
    begun = runs[runs["has_begun"] & ~runs["is_repeated"]]
    page = _Page(color_labels(sorted(set(begun["label"]))))
    sections = [page.section(*group) for group in runs.groupby("env")]
    # plotly's JSON has no character that could end the script.
    encoded = [f'"{name}":{graphs.Figure(drawn).to_json()}' for name, drawn in page.figures.items()]
    text = _asset("page.html").format(
        style=_asset("page.css"),
        counts=counts(begun),
        links="".join(page.links),
        sections="".join(sections),
        figures=f"{{{','.join(encoded)}}}",
        plotly=offline.get_plotlyjs(),
        script=_asset("page.js"),
    )
    with atomic_file(out) as file:
        file.write(text.encode())
    return begun.drop(columns="files")


def _asset(name: str) -> str:
    return resources.files(__package__).joinpath("assets", name).read_text(encoding="utf-8")


def counts(runs: pd.DataFrame) -> str:
    """The number of runs, and of their environments, as text."""
    n_envs = runs["env"].nunique()
    return f"{len(runs):,} run{'s' * (len(runs) != 1)} on {n_envs} environment{'s' * (n_envs != 1)}"


class _Page:
    """Makes sections, and collects their links, and the figures that a script draws in them."""

    def __init__(self, colors: dict[str, str]) -> None:
        self.links: list[str] = []
        self.figures: dict[str, pictures.PlotlyFigure] = {}
        self._colors = colors

    def section(self, env: str, runs: pd.DataFrame) -> str:
        """The HTML of one environment, which frees the memory of its runs."""
        title, name = escape(env), f"environment-{len(self.links)}"
        self.links.append(f'<li><a href="#{name}">{title}</a></li>')
        here = runs[runs["has_begun"] & ~runs["is_repeated"]]
        left_out = {NOT_BEGUN: runs[~runs["has_begun"]], REPEATED: runs[runs["is_repeated"]]}
        notes = [
            f"<p>{why}: {', '.join(map(escape, those['run']))}.</p>"
            for why, those in left_out.items()
            if len(those)
        ]
        parts = self._parts(env, here) if len(here) else ""
        for run in here["files"]:
            run.forget_final_states()
        return (
            f'<section class="card" aria-labelledby="{name}"><h2 id="{name}">{title}</h2>'
            f"{''.join(notes)}{parts}</section>"
        )

    def _parts(self, env: str, runs: pd.DataFrame) -> str:
        table = pairs(runs, self._colors)
        ahead = f"<h3>Who is ahead of whom</h3>{PAIRS_KEY}{table}" if table else ""
        about = f"Curves of {', '.join(sorted(set(runs['label'])))} over timesteps"
        curves = self._picture(pictures.draw_curves(runs, self._colors), "curves", about)
        return (
            f"{summary(runs, self._colors)}{ahead}<h3>Curves</h3>{curves}"
            f"{self._elites(runs)}{self._maps(env, runs)}"
        )

    def _elites(self, runs: pd.DataFrame) -> str:
        """A figure for each archive: QD scores of different ones are not comparable."""
        figures = ""
        for (env, archive), here in with_archives(runs).groupby(["env", "archive"]):
            drawn = pictures.draw_elites(here, self._colors)
            plot = self._picture(drawn, "curves", f"QD score and elites, {archive}")
            figures += _figure(escape(str(archive).removeprefix(f"{env}, ")), plot)
        return f'<h3>Elites</h3><div class="stack">{figures}</div>' if figures else ""

    def _maps(self, env: str, runs: pd.DataFrame) -> str:
        plane = pictures.plane_of(runs)
        if plane is None:
            return "<p>No maps: the environment gives no behavior of two entries or more.</p>"
        longest = float(runs["timesteps"].max())
        maps = ""
        for label, here in runs.groupby("label"):
            drawn = pictures.draw_map(here, plane, longest)
            plot = self._picture(drawn, "map", f"Map of {label} on {env}")
            maps += _figure(named(str(label), self._colors), plot)
        key = KEY.format(longest, "" if plane.maze is None else MARKS)
        return f'<h3>Where episodes ended</h3>{key}<div class="grid">{maps}</div>'

    def _picture(self, figure: pictures.PlotlyFigure, kind: str, about: str) -> str:
        """The HTML element of a figure, with a description for those who cannot see it."""
        name = f"figure-{len(self.figures)}"
        self.figures[name] = figure
        height = figure["layout"].get("height")
        style = "" if height is None else f' style="height: {height}px"'
        about = f'role="img" aria-label="{escape(about)}"'
        return f'<div class="plot {kind}" id="{name}" {about}{style}></div>'


def _figure(caption: str, plot: str) -> str:
    return f"<figure><figcaption>{caption}</figcaption>{plot}</figure>"
