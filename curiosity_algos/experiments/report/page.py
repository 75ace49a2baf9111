"""The report's page: one HTML file that needs nothing else."""

from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Iterable
from html import escape
from importlib import resources
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from curiosity_algos.experiments.canvas import DPI
from curiosity_algos.experiments.labels import color_labels
from curiosity_algos.experiments.loading import StrPath
from curiosity_algos.experiments.measures import left_out, load_compared, with_archives
from curiosity_algos.experiments.report import pictures
from curiosity_algos.experiments.report.tables import AHEAD, BEHIND, named, pairs, summary
from curiosity_algos.state.atomic_file import atomic_file
from curiosity_gym.validation import check_choice

PAIRS_KEY = (
    f'<p class="key">How likely a run of the first is ahead of a run of the second; where the 95 % '
    f"interval excludes one half: {AHEAD} the first is ahead, {BEHIND} the second is</p>"
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
    """
    if Path(out).is_dir():
        raise IsADirectoryError(f"`out` must be a file, {out} is a folder.")
    check_choice((".html", ".htm"), out=Path(out).suffix.lower())
    runs = load_compared(folders)
    begun = runs[runs["has_begun"] & ~runs["is_repeated"]]
    colors = color_labels(sorted(set(begun["label"])))
    groups = [
        (f"environment-{i}", str(env), here) for i, (env, here) in enumerate(runs.groupby("env"))
    ]
    links = [f'<li><a href="#{name}">{escape(env)}</a></li>' for name, env, _ in groups]
    text = _asset("page.html").format(
        style=_asset("page.css"),
        counts=counts(begun),
        links="".join(links),
        sections="".join(_section(name, env, here, colors) for name, env, here in groups),
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


def _section(name: str, env: str, runs: pd.DataFrame, colors: dict[str, str]) -> str:
    """The HTML of one environment, which frees the memory of its runs."""
    here = runs[runs["has_begun"] & ~runs["is_repeated"]]
    notes = [f"<p>{escape(reason)}</p>" for reason in left_out(runs)]
    parts = _parts(env, here, colors) if len(here) else ""
    for run in here["files"]:
        run.forget_final_states()
    return (
        f'<section class="card" aria-labelledby="{name}"><h2 id="{name}">{escape(env)}</h2>'
        f"{''.join(notes)}{parts}</section>"
    )


def _parts(env: str, runs: pd.DataFrame, colors: dict[str, str]) -> str:
    table = pairs(runs, colors)
    ahead = f"<h3>Who is ahead of whom</h3>{PAIRS_KEY}{table}" if table else ""
    about = f"Curves of {', '.join(sorted(set(runs['label'])))} over timesteps"
    curves = _picture(pictures.draw_curves(runs, colors), about)
    return (
        f"{summary(runs, colors)}{ahead}<h3>Curves</h3>{curves}"
        f"{_elites(runs, colors)}{_maps(env, runs, colors)}"
    )


def _elites(runs: pd.DataFrame, colors: dict[str, str]) -> str:
    """A figure for each archive: QD scores of different ones are not comparable."""
    figures = ""
    for (env, archive), here in with_archives(runs).groupby(["env", "archive"]):
        drawn = pictures.draw_elites(here, colors)
        picture = _picture(drawn, f"QD score and elites, {archive}")
        figures += _figure(escape(str(archive).removeprefix(f"{env}, ")), picture)
    return f'<h3>Elites</h3><div class="stack">{figures}</div>' if figures else ""


def _maps(env: str, runs: pd.DataFrame, colors: dict[str, str]) -> str:
    plane = pictures.plane_of(runs)
    if plane is None:
        return "<p>No maps: the environment gives no behavior of two entries or more.</p>"
    longest = float(runs["timesteps"].max())
    maps = ""
    for label, here in runs.groupby("label"):
        picture = _picture(pictures.draw_map(here, plane, longest), f"Map of {label} on {env}")
        maps += _figure(named(str(label), colors), picture)
    return f'<h3>Where episodes ended</h3><div class="grid">{maps}</div>'


def _picture(figure: Figure, about: str) -> str:
    """The HTML element of a figure, with a description for those who cannot see it."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=DPI, bbox_inches="tight")
    data = b64encode(file.getvalue()).decode()
    return f'<img alt="{escape(about)}" src="data:image/png;base64,{data}">'


def _figure(caption: str, picture: str) -> str:
    return f"<figure><figcaption>{caption}</figcaption>{picture}</figure>"
