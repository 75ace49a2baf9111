"""Packages that only some environments need."""

from __future__ import annotations

import importlib
import sys
import warnings
from types import ModuleType

from gymnasium.error import DependencyNotInstalled

DM_CONTROL = "dm-control>=1.0.50,<2"
"""The distribution that the extra `control` asks for, where it can."""


def import_extra(extra: str, *modules: str) -> tuple[ModuleType, ...]:
    """Import modules that the extra `extra` of this package installs, and return them.

    Raises:
        gymnasium.error.DependencyNotInstalled: If one of them cannot be imported.
    """
    try:
        with warnings.catch_warnings():
            # dm_control tries a window first: error 65550 says that there is no display for it.
            warnings.filterwarnings("ignore", r"\(65550\)", UserWarning, r"glfw(\.|$)")
            return tuple(map(importlib.import_module, modules))
    except ImportError as error:
        raise DependencyNotInstalled(
            f"This needs {', '.join(modules)}, which cannot be imported ({error}): run "
            f"`{install_command(extra)}`."
        ) from error


def install_command(extra: str) -> str:
    """The command that installs the extra `extra` of this package on this Python."""
    command = f'pip install "curiosity-search[{extra}]"'
    if extra == "control" and sys.version_info >= (3, 13):
        # Its labmaze has no wheel there, and nothing here uses that.
        return f'{command} && pip install --no-deps "{DM_CONTROL}"'
    return command
