"""Curiosity-driven policy search behind Stable-Baselines3's API.

What is in here is imported when it is first asked for: PyTorch and pyribs take seconds, which the
command needs neither to print its help nor to complete a word. The names are in `__init__.pyi`,
which is read here and has to be shipped.
"""

import ast
from importlib import import_module
from pathlib import Path

import curiosity_gym  # noqa: F401  registers the ids

_STUB = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
_MODULES = {
    alias.name: str(imported.module)
    for imported in _STUB.body
    if isinstance(imported, ast.ImportFrom)
    for alias in imported.names
}
"""Public name: module that defines it."""
__all__ = sorted(_MODULES)


def __getattr__(name: str) -> object:
    """Import a public name (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value  # asked for once
    return value


def __dir__() -> list[str]:
    return sorted(globals().keys() | set(__all__))
