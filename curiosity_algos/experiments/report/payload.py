"""The numbers that the page draws, as JSON."""

from __future__ import annotations

import json
from typing import Any

from curiosity_algos.experiments.report.bonus_maps import Steps, bonus_map, has_bonus, steps_of
from curiosity_algos.experiments.report.collect import Environment, Run
from curiosity_algos.experiments.report.curves import curves
from curiosity_algos.experiments.report.maps import maps, n_stops
from curiosity_algos.experiments.report.planes import Plane, plane_of
from curiosity_algos.experiments.report.replays import replays


def payload(environment: Environment, colors: dict[str, str]) -> dict[str, Any]:
    """All pictures of an environment.

    Raises:
        ValueError: If a run is damaged.
    """
    plane = plane_of(environment)
    return {
        "labels": [{"name": label, "color": colors[label]} for label in environment.labels],
        "timesteps": max(run.result["timesteps"] for run in environment.runs),
        "n_stops": max(n_stops(run) for run in environment.runs),
        "curves": curves(environment),
        "plane": None if plane is None else plane.payload(),
        "runs": [] if plane is None else _runs(environment, plane),
        "replays": [] if plane is None else replays(environment, plane),
    }


def _runs(environment: Environment, plane: Plane) -> list[dict[str, Any]]:
    steps = steps_of(plane) if any(map(has_bonus, environment.runs)) else None
    number = {label: i for i, label in enumerate(environment.labels)}
    return [_run(run, number[run.label], plane, steps) for run in environment.runs]


def _run(run: Run, label: int, plane: Plane, steps: Steps | None) -> dict[str, Any]:
    bonus = {} if steps is None or not has_bonus(run) else {"bonus": bonus_map(run, steps)}
    return {
        "label": label,
        "seed": run.seed,
        "unit": "Generation" if run.episodes["generation"].any() else "Episode",
        **maps(run, plane),
        **bonus,
    }


def as_script(value: Any) -> str:
    """JSON that can stand in a script element."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
