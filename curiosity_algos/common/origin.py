"""Where an error arose: in this package and its libraries, or in other code."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Iterator

KNOWN = sys.stdlib_module_names | {
    *("curiosity_algos", "curiosity_gym", "click", "typer", "gymnasium", "stable_baselines3"),
    *("sb3_contrib", "torch", "numpy", "scipy", "sklearn", "numba", "ribs", "pandas", "yaml"),
    *("matplotlib", "PIL", "plotly", "pygame", "moviepy", "imageio", "onnx", "minari", "h5py"),
    *("ray", "mujoco"),
}
"""Packages whose errors are of what they were asked for, unless other code asked."""


def is_foreign(error: BaseException) -> bool:
    """Whether other code takes part in an error, or in one that led to it.

    Its class may be of that code, or the calls that led to it go through some.
    """
    return not {name.partition(".")[0] for name in _modules(error)} <= KNOWN


def _modules(error: BaseException | None) -> Iterator[str]:
    while error is not None:
        yield type(error).__module__
        for frame, _ in traceback.walk_tb(error.__traceback__):
            yield frame.f_globals.get("__name__", "")
        error = error.__cause__ or error.__context__


def message_of(error: BaseException) -> str:
    """What an error says, and its notes."""
    return " ".join([str(error), *(f"({note})" for note in getattr(error, "__notes__", []))])
