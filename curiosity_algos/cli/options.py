"""What commands share: options, the completion of names, and the parsing of values."""

from __future__ import annotations

import ast
import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from curiosity_algos.common.names import BONUS_NAMES, ENVIRONMENTS, KNOWN

if TYPE_CHECKING:
    from curiosity_algos.experiments.run_spec import RunSpec, Wrapping


def _completion(known: Iterable[str]) -> Callable[[str], list[str]]:
    """Complete a name, or the last of several with commas between them."""

    def complete(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        return [f"{before}{comma}{name}" for name in known if name.startswith(last)]

    return complete


_WORDS = re.compile(r"(?<=[a-z0-9])(?=[A-Z]\w)|(?<=[A-Z])(?=[A-Z][a-z])")
"""The ends of words of two letters or more within the name of a class."""
ALGOS = _completion([_WORDS.sub("_", name).lower() for name in KNOWN])
ENVS = _completion(ENVIRONMENTS)
BONUSES = _completion(("none", *BONUS_NAMES))

Trust = Annotated[
    bool, typer.Option("--trust", help="Also run code that the run's folder names or contains.")
]

Pretrained = Annotated[
    str | None,
    typer.Option(
        metavar="ALGO",
        help="Algorithm whose best policy the package has, for the run's.",
        autocompletion=ALGOS,
    ),
]


Success = Annotated[
    float, typer.Option(help="Share of unseen starts to succeed from, which ends the training.")
]


def is_terminal() -> bool:
    """Whether somebody watches, so that a bar may be drawn."""
    return sys.stdout.isatty() and sys.stderr.isatty()


def find_own_modules() -> None:
    """Let modules of the working directory be imported, after all others."""
    if (here := os.getcwd()) not in sys.path:
        sys.path.append(here)


def check_all(runs: Sequence[RunSpec]) -> None:
    """Check that one run of each algorithm, bonus and environment can begin, with its last seed."""
    by_seed = sorted(runs, key=lambda run: run.seed)
    kinds = {(run.variant, run.algorithm, run.bonus, run.env): run for run in by_seed}
    for run in kinds.values():
        run.check()


def wrapping(text: str) -> Wrapping:
    """`module:Class` and the keywords of MODULE.CLASS:NAME=VALUE."""
    path, *assignments = text.split(":")
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
