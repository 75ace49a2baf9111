"""Options that several commands share, and the parsing of their values."""

from __future__ import annotations

import ast
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import gymnasium as gym
import typer

from curiosity_algos.common.names import BONUS_NAMES, KNOWN
from curiosity_algos.common.presets import PRESETS

if TYPE_CHECKING:
    from curiosity_algos.experiments.run_envs import Wrapping
    from curiosity_algos.experiments.run_spec import RunSpec


def completion(known: Iterable[str]) -> Callable[[str], list[str]]:
    """Complete a name, or the last of several with commas between them; import nothing slow."""

    def complete(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        return [f"{before}{comma}{name}" for name in known if name.startswith(last)]

    return complete


WORDS = re.compile("(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
"""The ends of words within the name of a class."""
ALGOS = completion([WORDS.sub("_", name).lower() for name in KNOWN])
ENVS = completion(gym.registry)
BONUSES = completion(("none", *BONUS_NAMES))
PRESET = completion(PRESETS)


def _pairs(name: str, more: str = "") -> Any:
    """An option of names and their values."""
    text = f"{name} and its value. Repeat the option for others{more}."
    return typer.Option(metavar="NAME:VALUE", help=text)


Timesteps = Annotated[
    float,
    typer.Option(
        *("--timesteps", "-n", "--n-timesteps", "--total-timesteps"),
        help="Environment steps of a run.",
    ),
]
LogFolder = Annotated[
    Path,
    typer.Option(
        "--log-folder", "-f", help="Folder for the runs, which go to FOLDER/algorithm/env/seed."
    ),
]
EnvKeywords = Annotated[list[str] | None, _pairs("A keyword of the environment")]
Keywords = Annotated[list[str] | None, _pairs("A setting of the algorithm")]
Alternatives = Annotated[
    list[str] | None,
    _pairs("A setting of the algorithm", "; of several values of one setting, all are tried"),
]
BonusKeywords = Annotated[
    list[str] | None,
    _pairs("A keyword of the bonus or of what adds it to the reward, such as weight:0.5,"),
]
Preset = Annotated[
    str | None,
    typer.Option(
        help="Settings to begin with, paper or tuned. Without it, the defaults.",
        autocompletion=PRESET,
    ),
]
Device = Annotated[
    str | None, typer.Option(help="Device that neural networks are on: auto, cpu or cuda.")
]
Trust = Annotated[
    bool, typer.Option("--trust", help="Also run code that the run's folder names or contains.")
]
NEnvs = Annotated[
    int,
    typer.Option(
        help="Environments side by side, for an algorithm of Stable-Baselines3's own. Mazes, "
        "control tasks and robots of this package are stepped at once."
    ),
]
RepeatAction = Annotated[
    int,
    typer.Option(help="Steps for which an action is repeated. Timesteps then count actions."),
]
Wrappers = Annotated[
    list[str] | None,
    typer.Option(
        "--wrapper",
        metavar="CLASS[:NAME=VALUE...]",
        help="Wrapper of the environment, such as minigrid.wrappers.FlatObsWrapper, and its "
        "keywords. Repeat the option for others, from the inside out.",
    ),
]
Interval = Annotated[float, typer.Option(help="Seconds between two checkpoints of a run.")]


def make_runs(
    algos: Sequence[str],
    envs: Sequence[str],
    seeds: Sequence[int],
    *,
    env_kwargs: list[str] | None,
    hyperparams: list[str] | None,
    settings: Mapping[str, Any],
    bonuses: Sequence[str],
    bonus_kwargs: list[str] | None,
    wrappers: list[str] | None,
    **common: Any,
) -> list[RunSpec]:
    """A run of each algorithm, bonus, environment, seed and setting.

    `settings` have an option of their own, and are None without it. They override `hyperparams`.
    All runs have the `common` fields.
    """
    if wrappers or any(":" in env for env in envs):
        find_own_modules()
    from curiosity_algos.experiments.sweep import grid

    values = alternatives("hyperparams", hyperparams)
    values |= {name: [value] for name, value in settings.items() if value is not None}
    swept = {name: several for name, several in values.items() if len(several) > 1}
    fixed = {name: only[0] for name, only in values.items() if name not in swept}
    return grid(
        algos,
        envs,
        seeds,
        swept,
        settings=fixed,
        bonuses=[None if name.lower() == "none" else name for name in bonuses],
        env_kwargs=keywords("env-kwargs", env_kwargs),
        bonus_kwargs=keywords("bonus-kwargs", bonus_kwargs),
        wrappers=[_wrapping(text) for text in wrappers or []],
        **common,
    )


def find_own_modules() -> None:
    """Let modules of the working directory be imported, after all others."""
    if (here := os.getcwd()) not in sys.path:
        sys.path.append(here)


def check_all(runs: Sequence[RunSpec]) -> None:
    """Check that one run of each algorithm, bonus and environment can begin, with its last seed."""
    in_order = sorted(runs, key=lambda run: run.seed)
    kinds = {(run.variant, run.algorithm, run.bonus, run.env): run for run in in_order}
    for run in kinds.values():
        run.check()


def _wrapping(text: str) -> Wrapping:
    """`module:Class` and the keywords of MODULE.CLASS:NAME=VALUE; MODULE:CLASS is the same."""
    path, *assignments = text.split(":")
    if assignments and "=" not in assignments[0]:
        path = f"{path}.{assignments.pop(0)}"
    module, _, name = path.rpartition(".")
    pairs = [assignment.partition("=") for assignment in assignments]
    if not (module and name and all(key.isidentifier() and sign for key, sign, _ in pairs)):
        raise ValueError(f"--wrapper must be MODULE.CLASS or MODULE.CLASS:NAME=VALUE, got {text}.")
    return f"{module}:{name}", {key: _value(value) for key, _, value in pairs}


def keywords(option: str, pairs: list[str] | None) -> dict[str, Any]:
    """Keywords of `NAME:VALUE`, with one value for a name."""
    values = alternatives(option, pairs)
    for name, several in values.items():
        if len(several) > 1:
            raise ValueError(f"--{option} must give {name} one value, got {several}.")
    return {name: value for name, (value,) in values.items()}


def alternatives(option: str, pairs: list[str] | None) -> dict[str, list[Any]]:
    """The different values of the keywords of `NAME:VALUE`: literals of Python, or text."""
    alternatives: dict[str, list[Any]] = {}
    for pair in pairs or []:
        name, colon, text = pair.partition(":")
        if not colon or not name.isidentifier():
            raise ValueError(f"--{option} must be NAME:VALUE, got {pair}.")
        value, values = _value(text), alternatives.setdefault(name, [])
        if repr(value) not in map(repr, values):  # True equals 1, and is another value
            values.append(value)
    return alternatives


def _value(text: str) -> Any:
    try:
        return ast.literal_eval(text)
    except (MemoryError, RecursionError, SyntaxError, TypeError, ValueError):
        return text


def names(option: str, text: str) -> list[str]:
    """The names in a text with commas."""
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise ValueError(f"--{option} must be names with commas between them, got {text!r}.")
    return names


def numbers(option: str, text: str) -> list[int]:
    """The whole numbers in a text with commas; `0-4` stands for all from 0 to 4."""
    numbers: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        ends = [first, last] if dash else [first, first]
        if not all(end.isdecimal() for end in ends) or int(ends[0]) > int(ends[1]):
            raise ValueError(f"--{option} must be whole numbers such as 0,1,2 or 0-4, got {text}.")
        numbers += range(int(ends[0]), int(ends[1]) + 1)
    return numbers
