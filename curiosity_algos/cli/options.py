"""Options that several commands share, and what is read from them."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Annotated, Any

import typer

Algo = Annotated[
    str,
    typer.Option("--algo", help="An algorithm, in any spelling: curiosity_es, NSES, map-elites."),
]
Env = Annotated[str, typer.Option("--env", help="Id of an environment.")]
Timesteps = Annotated[
    float,
    typer.Option(
        "--timesteps", "-n", "--n-timesteps", "--total-timesteps", help="Budget, such as 1e7."
    ),
]
LogFolder = Annotated[
    Path, typer.Option("--log-folder", "-f", help="Where runs are: FOLDER/algorithm/env/seed.")
]
Keywords = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME:VALUE", help="A keyword and its value; may be given many times."),
]
Preset = Annotated[str | None, typer.Option(help="Settings to begin with: paper or tuned.")]
Device = Annotated[str, typer.Option(help="Where networks are, as in Stable-Baselines3.")]


def settings(
    hyperparams: list[str] | None, preset: str | None, device: str, n_threads: int | None
) -> dict[str, Any]:
    """Keywords of an algorithm."""
    found = {"device": device, **keywords("hyperparams", hyperparams)}
    if preset is not None:
        found["preset"] = preset
    if n_threads is not None:
        found["n_threads"] = n_threads
    return found


def keywords(option: str, pairs: list[str] | None) -> dict[str, Any]:
    """Keywords of `NAME:VALUE`, values as Python writes them, or text."""
    found = {}
    for pair in pairs or []:
        name, colon, value = pair.partition(":")
        if not colon or not name.isidentifier():
            raise ValueError(f"--{option} must be NAME:VALUE, got {pair}.")
        found[name] = _value(value)
    return found


def _value(text: str) -> Any:
    try:
        return ast.literal_eval(text)
    except (MemoryError, RecursionError, SyntaxError, TypeError, ValueError):
        return text


def numbers(option: str, text: str) -> list[int]:
    """Whole numbers of a text with commas."""
    if not all(part.strip().isdecimal() for part in text.split(",")):
        raise ValueError(f"--{option} must be whole numbers with commas, got {text}.")
    return [int(part) for part in text.split(",")]


def summary(folder: Path) -> str:
    """A run's result in a line."""
    from curiosity_algos.experiments import RunFolder

    result = RunFolder(folder).result()
    first = result["first_success_timesteps"]
    found = "no reward" if first is None else f"first reward after {first:,} timesteps"
    shares = [f"{name} {share:.1%}" for name, share in result["coverage"].items()]
    coverage = f", coverage {', '.join(shares)}" if shares else ""
    best = result["best_return"]
    return f"{folder}: best return {'none' if best is None else f'{best:.3f}'}, {found}{coverage}"
