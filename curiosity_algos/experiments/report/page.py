"""The report's page: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from importlib import resources
from pathlib import Path

import pandas as pd

from curiosity_algos.experiments.elites import with_archives
from curiosity_algos.experiments.labels import color_labels
from curiosity_algos.experiments.measures import load_compared
from curiosity_algos.experiments.report import pictures
from curiosity_algos.experiments.report.tables import AHEAD, BEHIND, pairs, summary, swatch
from curiosity_algos.experiments.run import StrPath
from curiosity_algos.state.atomic_file import atomic_file
from curiosity_gym.extras import import_extra
from curiosity_gym.validation import check_choice

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Exploration report</title>
<style>{style}</style>
</head>
<body>
<a class="skip" href="#main">Skip to the results</a>
<header><h1>Exploration report</h1><p>{counts}.</p>
<nav aria-label="Environments"><ul>{links}</ul></nav></header>
<main id="main">
<noscript><p>Pictures need JavaScript; the tables do not.</p></noscript>
{sections}
<section class="card" aria-labelledby="notes"><h2 id="notes">How to read this page</h2>
<dl>{notes}</dl></section>
</main>
<script type="application/json" id="figures">{figures}</script>
<script>{plotly}</script>
<script>{script}</script>
</body>
</html>
"""
NOTES = {
    "Runs": (
        "A row, a line and a map are of all runs of an algorithm with the same settings, where a "
        "seed counts once. Settings in which runs differ are named. If runs differ in length, the "
        "table has the shortest and the longest, and its numbers are of the runs' ends."
    ),
    "Intervals": (
        "IQM is the interquartile mean over runs, the mean of their middle half. Brackets contain "
        "95 % intervals of a bootstrap over runs; fewer than three runs have none."
    ),
    "Curves": (
        "Thick lines are interquartile means, up to the end of the shortest run of a label, shaded "
        "areas their 95 % intervals, thin lines single runs. Click on a name to hide it; drag over "
        "a curve to zoom in, and double-click to zoom out."
    ),
    "Who is ahead of whom": (
        "The probability of improvement (Agarwal et al. 2021): the share of the pairs of a run of "
        "the first and a run of the second in which the first has the higher best return, the "
        "higher coverage at its end, or the earlier first success or reward. Ties count one half. "
        "A run without a success counts as later than those with one before the shorter of the two "
        "budgets was spent, and as late as those with one after. The interval says what other "
        "seeds might have given: with three or four runs it is too narrow, and about one of twenty "
        "equal pairs is marked by chance. Every two algorithms with three runs or more have a row."
    ),
    "Success, or reward": (
        "An episode may end in success, if the environment reports it. If no run had a success, a "
        "reward takes its place: a return above 0. Runs without either are not dropped: the "
        "Kaplan-Meier estimate counts them as without it for as long as they ran. The median is "
        "missing if more than half of the runs are without it to the end."
    ),
    "Coverage": (
        "The share of the reachable cells in which an episode has ended. The area under its curve "
        "is the mean coverage from the first timestep of a run to its last."
    ),
    "QD score": (
        "The sum of the returns of the elites in an archive, less the archive's "
        "<code>qd_score_offset</code> for each of them. It compares algorithms that fill the same "
        "archive: the same cells with the same offset. So each archive has a figure of its own. "
        "So has each algorithm whose archive has no cells, as the distance between its elites "
        "decides their number."
    ),
    "Where episodes ended": (
        "A cell has the color of the first episode of any run that ended in it; the way there does "
        "not count. If the environment is not a maze, the map shows the first two entries of the "
        "behavior, and what is beyond 99 % of them along either side counts at the map's edge. "
        "Hover over a cell to read its timesteps and its place."
    ),
}
KEY = (
    '<p class="key">First episode that ended in a cell: at the start <span class="ramp"></span> '
    "after {:,.0f} timesteps{}</p>"
)
PAIRS_KEY = (
    f'<p class="key">How likely a run of the first is ahead of a run of the second; where the 95 % '
    f"interval excludes one half: {AHEAD} the first is ahead, {BEHIND} the second is</p>"
)
MARKS = (
    '<span class="mark" style="background: {}"></span> start '
    '<span class="mark" style="border: 2px solid {}"></span> goal'
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
    page = _Page(load_compared(folders))
    encoded = [f'"{name}":{graphs.Figure(drawn).to_json()}' for name, drawn in page.figures.items()]
    text = PAGE.format(
        style=_asset("page.css"),
        counts=counts(page.begun),
        links="".join(page.links),
        sections="".join(page.sections),
        notes="".join(f"<dt>{name}</dt><dd>{text}</dd>" for name, text in NOTES.items()),
        figures=f"{{{','.join(encoded)}}}".replace("<", "\\u003c"),
        plotly=offline.get_plotlyjs(),
        script=_asset("page.js"),
    )
    with atomic_file(out) as file:
        file.write(text.encode())
    return page.begun.drop(columns="files")


def _asset(name: str) -> str:
    return resources.files(__package__).joinpath("assets", name).read_text(encoding="utf-8")


def counts(runs: pd.DataFrame) -> str:
    """The number of runs, and of their environments, as text."""
    n_envs = runs["env"].nunique()
    return f"{len(runs):,} run{'s' * (len(runs) != 1)} on {n_envs} environment{'s' * (n_envs != 1)}"


class _Page:
    """The HTML of sections, and the figures that a script draws in them."""

    def __init__(self, runs: pd.DataFrame) -> None:
        self.begun = runs[runs["has_begun"] & ~runs["is_repeated"]]
        self.figures: dict[str, pictures.PlotlyFigure] = {}
        self._colors = color_labels(sorted(set(self.begun["label"])))
        self.links, self.sections = [], []
        for i, (env, here) in enumerate(runs.groupby("env")):
            title, name = escape(str(env)), f"environment-{i}"
            self.links.append(f'<li><a href="#{name}">{title}</a></li>')
            left_out = _named(NOT_BEGUN, here[~here["has_begun"]])
            left_out += _named(REPEATED, here[here["is_repeated"]])
            here = self.begun[self.begun["env"] == env]
            parts = self._section(here, str(env)) if len(here) else ""
            for run in here["files"]:
                run.forget_final_states()
            self.sections.append(
                f'<section class="card" aria-labelledby="{name}"><h2 id="{name}">{title}</h2>'
                f"{left_out}{parts}</section>"
            )

    def _section(self, runs: pd.DataFrame, env: str) -> str:
        """The HTML of one environment."""
        curves = pictures.draw_curves(runs, self._colors)
        table = pairs(runs, self._colors)
        ahead = f"<h3>Who is ahead of whom</h3>{PAIRS_KEY}{table}" if table else ""
        about = f"Curves of {', '.join(sorted(set(runs['label'])))} over timesteps"
        return (
            f"{summary(runs, self._colors)}{ahead}<h3>Curves</h3>"
            f"{self._picture(curves, 'curves', about)}{self._elites(runs)}"
            f"{self._maps(runs, env)}"
        )

    def _elites(self, runs: pd.DataFrame) -> str:
        """A figure for each archive: QD scores of different ones are not comparable."""
        figures = "".join(
            f"<figure><figcaption>{escape(str(archive).removeprefix(f'{env}, '))}</figcaption>"
            + self._picture(
                pictures.draw_elites(here, self._colors),
                "curves",
                f"QD score and elites, {archive}",
            )
            + "</figure>"
            for (env, archive), here in with_archives(runs).groupby(["env", "archive"])
        )
        return f'<h3>Elites</h3><div class="stack">{figures}</div>' if figures else ""

    def _maps(self, runs: pd.DataFrame, env: str) -> str:
        plane = pictures.plane_of(runs)
        if plane is None:
            return "<p>No maps: the environment gives no behavior of two entries or more.</p>"
        longest = float(runs["timesteps"].max())
        maps = "".join(
            f"<figure><figcaption>{swatch(self._colors[label])}{escape(label)}</figcaption>"
            + self._picture(
                pictures.draw_map(here, plane, longest), "map", f"Map of {label} on {env}"
            )
            + "</figure>"
            for label, here in runs.groupby("label")
        )
        marks = "" if plane.maze is None else MARKS.format(pictures.START, pictures.GOAL)
        key = KEY.format(longest, marks)
        return f'<h3>Where episodes ended</h3>{key}<div class="grid">{maps}</div>'

    def _picture(self, figure: pictures.PlotlyFigure, kind: str, about: str) -> str:
        """The HTML element of a figure, with a description for those who cannot see it."""
        name = f"figure-{len(self.figures)}"
        self.figures[name] = figure
        height = figure["layout"].get("height")
        style = "" if height is None else f' style="height: {height}px"'
        about = f'role="img" aria-label="{escape(about)}"'
        return f'<div class="plot {kind}" id="{name}" {about}{style}></div>'


def _named(why: str, runs: pd.DataFrame) -> str:
    """A line with the names of runs that are left out; empty without such."""
    return "" if runs.empty else f"<p>{why}: {', '.join(map(escape, runs['run']))}.</p>"
