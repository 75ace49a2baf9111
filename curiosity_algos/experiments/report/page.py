"""The report's page: one HTML file that needs nothing else."""

from __future__ import annotations

import os
from collections.abc import Iterable
from html import escape
from importlib import resources
from pathlib import Path

from curiosity_algos.checkpoints.atomic_file import atomic_file
from curiosity_algos.experiments.labels import color_labels
from curiosity_algos.experiments.report.collect import Environment, collect
from curiosity_algos.experiments.report.maps import MOST_STATES
from curiosity_algos.experiments.report.numbers import counted
from curiosity_algos.experiments.report.payload import as_script, payload
from curiosity_algos.experiments.report.replays import MOST_POINTS
from curiosity_algos.experiments.report.sections import Section, not_begun
from curiosity_gym.extras import import_extra

SCRIPTS = ("core", "curves", "maps", "replay", "sections")
"""In the order in which they build on each other."""
PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Exploration report</title>
<style>{style}</style>
<script>document.documentElement.dataset.theme =
  matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";</script>
</head>
<body>
<a class="skip" href="#main">Skip to the results</a>
<header>
<div class="top"><div><h1>Exploration report</h1><p>{counts}</p></div>
<button type="button" id="theme">Dark colors</button></div>
<nav aria-label="Environments"><ul>{links}</ul></nav>
</header>
<main id="main">
<noscript><p>Pictures need JavaScript; the tables do not.</p></noscript>
{sections}
{notes}
</main>
<script type="application/json" id="data">{data}</script>
<script>{plotly}</script>
<script>{script}</script>
</body>
</html>
"""
NOTES = {
    "Intervals": (
        "IQM is the interquartile mean over runs, the mean of their middle half. In brackets are "
        "95 % intervals of a bootstrap over runs; a single run has none."
    ),
    "Curves": (
        "Thick lines are interquartile means as far as all runs of a label have come, shaded areas "
        "their 95 % intervals, thin lines single runs. Best return is that of all episodes so far. "
        "Drag over a curve to zoom in, and double-click to zoom out."
    ),
    "First reward": (
        "Reward is that of an episode which ended in success, where the environment reports it. "
        "Runs that found none are not dropped: the Kaplan-Meier estimate counts them as without "
        "reward for as long as they ran. The median is the time at which at most half of the runs "
        "are still without reward, and missing where more than half are to the end."
    ),
    "Area under coverage": "Mean coverage from the first timestep of a run to its last.",
    "Final states": (
        f"At most {MOST_STATES:,} final states of each run are drawn, evenly spaced over its "
        "episodes; cells are those of the final states of all episodes, not those that episodes "
        "visited on their way. The slider goes through timesteps in as many steps as the longest "
        "run has generations, at most 300. Of environments that are no mazes, the first two "
        "entries of the behavior are drawn. Of all seeds together, a cell counts from the first "
        "episode of any of them that ended in it."
    ),
    "Best trajectories": (
        f"The path of the run with the highest return of each algorithm, at most {MOST_POINTS:,} "
        "points of it."
    ),
}


def write_report(
    folders: Iterable[str | os.PathLike[str]], path: str | os.PathLike[str]
) -> list[Environment]:
    """Write a page about all runs in folders; the same runs give the same bytes.

    Args:
        folders: Of runs, or with runs in them.
        path: Of the page; its folder need not be there yet.

    Returns:
        What the page is about.

    Raises:
        FileNotFoundError: If there is no run in one of the folders.
        IsADirectoryError: If there is a folder in the page's place.
        ValueError: If a run is of another format, or damaged.
        gymnasium.error.DependencyNotInstalled: If plotly is not installed.
    """
    (plotly,) = import_extra("report", "plotly.offline")
    if Path(path).is_dir():
        raise IsADirectoryError(f"`out` must be a file, {path} is a folder.")
    environments = collect(folders)
    page = _page(environments, plotly.get_plotlyjs())
    with atomic_file(path) as file:
        file.write(page.encode())
    return environments


def _page(environments: list[Environment], plotly: str) -> str:
    colors = color_labels(sorted({label for each in environments for label in each.labels}))
    begun = [environment for environment in environments if environment.runs]
    drawn = [payload(environment, colors) for environment in begun]
    sections = [
        Section(i, environment, its, colors).html()
        for i, (environment, its) in enumerate(zip(begun, drawn, strict=True))
    ]
    empty = [
        f'<section class="notes"><h2>{escape(each.title)}</h2>{not_begun(each)}</section>'
        for each in environments
        if not each.runs
    ]
    return PAGE.format(
        style=_asset("page.css"),
        counts=_counts(environments),
        links="".join(_link(i, each) for i, each in enumerate(begun)),
        sections="".join([*sections, *empty]),
        notes=_notes(),
        data=as_script({"environments": drawn}),
        plotly=plotly,
        script=_script(),
    )


def _asset(name: str) -> str:
    return resources.files(__package__).joinpath("assets", name).read_text(encoding="utf-8")


def _script() -> str:
    """All scripts as one, whose names no one else sees."""
    parts = "".join(_asset(f"{name}.js") for name in SCRIPTS)
    return f'(() => {{\n"use strict";\n{parts}}})();'


def _link(index: int, environment: Environment) -> str:
    return f'<li><a href="#environment-{index}">{escape(environment.title)}</a></li>'


def _counts(environments: list[Environment]) -> str:
    runs = [run for environment in environments for run in environment.runs]
    parts = [
        counted(len(runs), "run"),
        f"of {counted(len({run.description['algorithm'] for run in runs}), 'algorithm')}",
        f"on {counted(len(environments), 'environment')}",
    ]
    under_way = sum(not run.has_ended for run in runs)
    return f"{' '.join(parts)}." + (f" {under_way} not ended yet." if under_way else "")


def _notes() -> str:
    items = [f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>" for name, text in NOTES.items()]
    return (
        '<section class="notes" aria-labelledby="notes"><h2 id="notes">How to read this page</h2>'
        f"<dl>{''.join(items)}</dl></section>"
    )
