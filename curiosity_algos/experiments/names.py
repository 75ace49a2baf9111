"""Algorithms by any spelling of their names."""

from __future__ import annotations

from collections.abc import Callable, Iterable
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
    """The class of a name; case, `-` and `_` do not count (`curiosity_es`, `CuriosityES`).

    Raises:
        ValueError: If there is none; the nearest name is suggested.
    """
    import curiosity_algos

    name = find_known("algo", name, ALGORITHMS, spelled=_plain)
    found: type[Any] = getattr(curiosity_algos, name)
    return found


def _plain(name: str) -> str:
    return name.lower().replace("-", "").replace("_", "")


def find_known(
    argument: str, name: str, known: Iterable[str], *, spelled: Callable[[str], str] = str
) -> str:
    """The known name that `spelled` makes the same of, for an argument.

    Raises:
        ValueError: If there is none; the nearest is suggested.
    """
    by_spelling = {spelled(each): each for each in known}
    if spelled(name) in by_spelling:
        return by_spelling[spelled(name)]
    near = get_close_matches(spelled(name), by_spelling, n=1)
    if near:
        raise ValueError(f"`{argument}` {name} is unknown: did you mean {by_spelling[near[0]]}?")
    raise ValueError(f"`{argument}` must be one of {', '.join(known)}, got {name}.")
