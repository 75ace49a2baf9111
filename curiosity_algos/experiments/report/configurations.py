"""How runs were made: which settings differ, and the whole description of each run."""

from __future__ import annotations

import json
from html import escape
from typing import Any

from curiosity_algos.experiments.report import numbers
from curiosity_algos.experiments.report.collect import Environment, Run
from curiosity_algos.experiments.report.tables import table

GROUPS = ("settings", "env_kwargs", "versions", "machine")
"""Entries of `run.json` that hold settings; of the others, the revision of the code counts."""


def configurations(environment: Environment) -> str:
    """The settings that differ, a column for each label, and the `run.json` of each run."""
    return _differences(environment) + "".join(map(_description, environment.runs))


def _differences(environment: Environment) -> str:
    """A table of the settings that have more than one value among the runs that have them."""
    values = {label: _values(environment.of(label)) for label in environment.labels}
    names = sorted({name for each in values.values() for name in each})
    rows = [
        [f"<code>{escape(name)}</code>", *(_cell(each.get(name)) for each in values.values())]
        for name in names
        if len(set().union(*(each.get(name, set()) for each in values.values()))) > 1
    ]
    if not rows:
        return "<p>All runs have the same settings.</p>"
    text = table("Settings that differ", ["Setting", *values], rows)
    return f'<div class="settings">{text}</div>'


def _cell(values: set[str] | None) -> str:
    return escape("; ".join(sorted(values))) if values else numbers.NOTHING


def _values(runs: list[Run]) -> dict[str, set[str]]:
    """The values of each setting among runs, as text."""
    found: dict[str, set[str]] = {}
    for run in runs:
        for name, value in _settings(run.description).items():
            text = value if isinstance(value, str) else json.dumps(value)
            found.setdefault(name, set()).add(text)
    return found


def _settings(description: dict[str, Any]) -> dict[str, Any]:
    grouped = {
        f"{group}.{name}": value
        for group in GROUPS
        for name, value in description.get(group, {}).items()
    }
    return grouped | {"git_revision": description.get("git_revision")}


def _description(run: Run) -> str:
    return (
        f"<details><summary>{escape(run.label)}, seed {escape(run.seed)}: {_state(run)}</summary>"
        f'<p class="muted">{escape(str(run.folder.path))}</p>'
        f'<pre tabindex="0">{escape(json.dumps(run.description, indent=2))}</pre></details>'
    )


def _state(run: Run) -> str:
    timesteps, total = run.result["timesteps"], run.result["total_timesteps"]
    done = "ended" if run.has_ended else f"{numbers.percent(timesteps / total)} done"
    return (
        f"{numbers.short(timesteps)} timesteps in {numbers.whole(run.result['seconds'])} s, "
        f"best return {numbers.score(run.best_return)}, {done}"
    )
