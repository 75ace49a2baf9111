"""The HTML of an environment's section."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from typing import Any

from curiosity_algos.experiments.report import controls
from curiosity_algos.experiments.report.collect import Environment
from curiosity_algos.experiments.report.configurations import configurations
from curiosity_algos.experiments.report.numbers import score, whole
from curiosity_algos.experiments.report.tables import summary_table

CURVES = {
    "coverage": "Coverage",
    "best_return": "Best return",
    "survival": "Runs still without reward",
}
AXES = {"timesteps": "timesteps", "seconds": "seconds of training"}
PICTURES = {"states": "final states", "cells": "cells of final states"}
MARKS = (
    '<span><span class="mark"></span> start</span><span><span class="mark goal"></span> goal</span>'
    '<span><span class="mark wall"></span> wall</span>'
)
BONUS = (
    "The exploration bonus at each place by a run's last checkpoint: that of one step of a robot "
    "at rest there, averaged over five actions (none, and full acceleration along x and y, either "
    "way). Each map has its own colors, which end at the 2nd and 98th percentile of its bonuses."
)


NO_MAPS = "<p>No maps: the environment gives no behavior of two entries or more.</p>"


@dataclass(frozen=True, eq=False)
class Section:
    """One environment on the page.

    Attributes:
        index: Its number on the page, from 0.
        environment: Its runs.
        drawn: What its pictures show, as `payload` gives it.
        colors: Of labels.
    """

    index: int
    environment: Environment
    drawn: dict[str, Any]
    colors: dict[str, str]

    def html(self) -> str:
        """All of it."""
        name = f"environment-{self.index}"
        pictures = self._pictures() if self.drawn["plane"] else [NO_MAPS]
        parts = [
            f'<h2 id="{name}">{escape(self.environment.title)}</h2>',
            summary_table(self.environment, self.colors),
            not_begun(self.environment),
            controls.legend(self.environment.labels, self.colors),
            self._curves(),
            *pictures,
            "<h3>Configurations</h3><details><summary>Settings that differ, and each run's "
            f"<code>run.json</code></summary>{configurations(self.environment)}</details>",
        ]
        return (
            f'<section class="environment" data-index="{self.index}" aria-labelledby="{name}">'
            f"{''.join(parts)}</section>"
        )

    def _curves(self) -> str:
        labels = self.environment.labels
        about = f"of {', '.join(labels)} over timesteps or seconds"
        figures = "".join(
            controls.picture("curve", title, f"{title} {about}", kind=kind)
            for kind, title in CURVES.items()
        )
        return (
            "<h3>Curves</h3>"
            f'<div class="controls">{controls.select("over", "Against", AXES)}</div>'
            f'<div class="grid wide">{figures}</div>'
        )

    def _pictures(self) -> list[str]:
        return [self._maps(), self._bonus_maps(), self._replays()]

    def _maps(self) -> str:
        bar = (
            controls.select("picture", "Show", PICTURES)
            + controls.select("map-seed", "Seed", _with_all(_seeds(self.drawn["runs"])))
            + controls.player("Generations", self.drawn["n_stops"])
        )
        figures = self._map_figures("states", range(len(self.environment.labels)))
        return (
            f'<div class="maps"><h3>Where episodes ended</h3><div class="controls">{bar}</div>'
            f"{controls.key('', '', '', self._marks)}{figures}</div>"
        )

    def _bonus_maps(self) -> str:
        runs = [run for run in self.drawn["runs"] if "bonus" in run]
        if not runs:
            return ""
        bar = controls.select("bonus-seed", "Seed", _seeds(runs))
        figures = self._map_figures("bonus-map", sorted({run["label"] for run in runs}))
        return (
            f'<h3>What the bonus says</h3><p>{BONUS}</p><div class="controls">{bar}</div>'
            f"{controls.key('Bonus:', 'lowest', 'highest', self._marks)}{figures}"
        )

    def _replays(self) -> str:
        shown = {i: each for i, each in enumerate(self.drawn["replays"]) if each is not None}
        if not shown:
            return "<p>No replays: no run has ended with a trajectory of its best policy.</p>"
        names = ", ".join(self.environment.labels[i] for i in shown)
        figure = controls.picture(
            "map replay", "Paths of the best policies", f"Paths of the best policies of {names}"
        )
        bar = controls.player("Steps", max(each["steps"] for each in shown.values()))
        lines = "".join(f"<li>{self._replay_line(i, each)}</li>" for i, each in shown.items())
        return (
            f'<div class="replays"><h3>Best trajectories</h3><div class="controls">{bar}</div>'
            f'<div class="beside">{figure}<ul class="paths">{lines}</ul></div></div>'
        )

    def _replay_line(self, label: int, replay: dict[str, Any]) -> str:
        return (
            f"{self._named(label)}<span class='muted'>seed {escape(replay['seed'])}, return "
            f"{score(replay['return'])} in {whole(replay['steps'])} steps</span>"
        )

    def _map_figures(self, kind: str, labels: Iterable[int]) -> str:
        figures = "".join(
            controls.picture(
                f"map {kind}",
                f'{self._named(label)}<span class="muted"></span>',
                f"Map of {self.environment.labels[label]} on {self.environment.title}",
                label=label,
            )
            for label in labels
        )
        return f'<div class="grid">{figures}</div>'

    def _named(self, label: int) -> str:
        name = self.environment.labels[label]
        return controls.swatch(self.colors[name]) + escape(name)

    @property
    def _marks(self) -> str:
        return MARKS if self.drawn["plane"]["maze"] else ""


def not_begun(environment: Environment) -> str:
    """A line that names the runs that are left out; empty where there are none."""
    if not environment.not_begun:
        return ""
    names = ", ".join(map(escape, environment.not_begun))
    return f"<p>Not begun, and left out, as there is no checkpoint yet: {names}.</p>"


def _seeds(runs: Iterable[dict[str, Any]]) -> dict[str, str]:
    """The seeds of runs, numbers in their order."""
    seeds = {run["seed"] for run in runs}
    return {seed: seed for seed in sorted(seeds, key=lambda seed: (len(seed), seed))}


def _with_all(seeds: dict[str, str]) -> dict[str, str]:
    """One seed is all there is."""
    return {"all": "all"} | seeds if len(seeds) > 1 else seeds
