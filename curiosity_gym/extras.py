"""Packages that only some environments need."""

from __future__ import annotations

import importlib
import warnings
from types import ModuleType

from gymnasium.error import DependencyNotInstalled


def import_extra(extra: str, *modules: str) -> tuple[ModuleType, ...]:
    """Import modules that the extra `extra` of this package installs, and return them.

    Raises:
        gymnasium.error.DependencyNotInstalled: If one of them cannot be imported.
    """
    with warnings.catch_warnings():
        # dm_control tries a window first: error 65550 says that there is no display to open it on.
        warnings.filterwarnings("ignore", r"\(65550\)", UserWarning, r"glfw(\.|$)")
        return tuple(_import(extra, module) for module in modules)


def _import(extra: str, module: str) -> ModuleType:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise DependencyNotInstalled(
            f"This needs {module}, which cannot be imported ({error}): run "
            f'`pip install "curiosity[{extra}]"`.'
        ) from error
