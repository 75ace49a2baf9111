"""Algorithms by any spelling of their names."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

from curiosity_gym.registration import SPECS

ALGORITHMS = (
    "AURORA",
    "CMAME",
    "CanonicalES",
    "CuriosityES",
    "CuriosityMAPElites",
    "MAPElites",
    "NSES",
    "NSLC",
    "TD3ICM",
)
ENVIRONMENTS = tuple(SPECS)


def find_algorithm(name: str) -> type[Any]:
    """The class of a name: case, `-` and `_` do not count (`curiosity_es`, `CuriosityES`).

    Raises:
        ValueError: If there is none; the nearest name is suggested.
    """
    import curiosity_algos

    spelled = {_plain(known): known for known in ALGORITHMS}
    check_known("algo", _plain(name), spelled, shown=name, choices=ALGORITHMS)
    found: type[Any] = getattr(curiosity_algos, spelled[_plain(name)])
    return found


def _plain(name: str) -> str:
    return name.lower().replace("-", "").replace("_", "")


def check_known(
    argument: str, name: str, known: Iterable[str], *, shown: str, choices: Iterable[str]
) -> None:
    """Check that a name is among those that are known.

    Args:
        argument: What the name was given for.
        name: As it is looked for.
        known: Names to find it in.
        shown: As the user wrote it.
        choices: What the user may write, in the order of `known`.

    Raises:
        ValueError: If it is not; the nearest is suggested.
    """
    by_name = dict(zip(known, choices, strict=True))
    if name in by_name:
        return
    near = get_close_matches(name, by_name, n=1)
    if near:
        raise ValueError(f"`{argument}` {shown} is unknown: did you mean {by_name[near[0]]}?")
    raise ValueError(f"`{argument}` must be one of {', '.join(by_name.values())}, got {shown}.")
