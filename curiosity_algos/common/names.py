"""Names of algorithms, bonuses and environments, and what is meant by any spelling of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from difflib import get_close_matches
from importlib import import_module
from typing import Any

from curiosity_gym.registration import SPECS

ALGORITHMS = (
    "AURORA",
    "CMAME",
    "CanonicalES",
    "CuriosityES",
    "CuriosityMAPElites",
    "GoExplore",
    "MAPElites",
    "NSES",
    "NSLC",
    "TD3ICM",
)
"""Those of this package."""
STABLE_BASELINES = ("A2C", "DDPG", "DQN", "PPO", "SAC", "TD3")
"""Those of Stable-Baselines3."""
CONTRIB = ("CrossQ", "QRDQN", "TQC", "TRPO")
"""Those of sb3-contrib, which need not be installed."""
_PACKAGES: dict[str, str] = {
    **dict.fromkeys(ALGORITHMS, "curiosity_algos"),
    **dict.fromkeys(STABLE_BASELINES, "stable_baselines3"),
    **dict.fromkeys(CONTRIB, "sb3_contrib"),
}
KNOWN = tuple(_PACKAGES)
"""All of them."""
BONUS_NAMES = ("apt", "disagreement", "e3b", "etd", "icm", "ngu", "noveld", "ramp", "rnd")
"""Bonuses, as `curiosity_algos.bonuses.make` makes them: with PyTorch, which takes seconds."""
ENVIRONMENTS = tuple(SPECS)


def find_algorithm(name: str) -> type[Any]:
    """The class of a name; case, `-` and `_` do not count (`curiosity_es`, `CuriosityES`).

    Raises:
        ValueError: If there is none; the nearest name is suggested.
        ImportError: If it is of sb3-contrib, which is not installed.
    """
    name = find_known("algo", name, KNOWN, spelled=plain_name)
    try:
        package = import_module(_PACKAGES[name])
    except ImportError as error:
        raise ImportError(f"`algo` {name} needs sb3-contrib: pip install sb3-contrib") from error
    found: type[Any] = getattr(package, name)
    return found


def plain_name(name: str) -> str:
    """A name without what does not count in its spelling."""
    return name.lower().replace("-", "").replace("_", "")


def find_known(
    argument: str,
    name: str,
    known: Iterable[str],
    *,
    spelled: Callable[[str], str] = str,
    hint: str = "",
) -> str:
    """The known name that `spelled` makes the same of; ValueError suggests the nearest."""
    by_spelling = {spelled(each): each for each in known}
    if spelled(name) in by_spelling:
        return by_spelling[spelled(name)]
    near = get_close_matches(spelled(name), by_spelling, n=1)
    if near:
        hint = f"did you mean {by_spelling[near[0]]}? {hint}".rstrip()
    if hint:
        raise ValueError(f"`{argument}` {name} is unknown: {hint}")
    raise ValueError(f"`{argument}` must be one of {', '.join(known)}, got {name}.")
