"""What every test needs: no screen, Python's own answer to Ctrl-C, and the extras that it uses."""

import contextlib
import importlib.util
import os
import re
import signal

import pytest

# PyTorch's CUDA build imports it with the first optimizer: after software OpenGL, that is a crash.
with contextlib.suppress(ImportError):
    import triton  # noqa: F401

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("MPLBACKEND", "Agg")

# A shell that runs the tests in the background makes them ignore Ctrl-C, which some of them press.
signal.signal(signal.SIGINT, signal.default_int_handler)

MODULES = {
    "control": "dm_control",
    "locomotion": "mujoco",
    "ray": "ray",
    "render": "pygame",
    "report": "plotly",
    "robotics": "gymnasium_robotics",
    "tensorboard": "tensorboard",
    "track": "wandb",
}
"""Extra: the module without which it is not installed."""
PARAMETERS = {
    "control": re.compile("CuriosityControl-|SwingUp|dm_control|^control"),
    "locomotion": re.compile("CuriosityLocomotion-"),
    "report": re.compile("write_report"),
    "robotics": re.compile("CuriositySparse-.*Maze|gymnasium_robotics"),
    "track": re.compile("import wandb"),
}
"""Extra: what a test's parameter says that needs it: an environment's id or a program."""


def extras_of(item):
    """The extras that a test needs: what its marks say, or else what its parameters say."""
    marks = list(item.iter_markers("extra"))
    if marks:
        return {extra for mark in marks for extra in mark.args}
    values = item.callspec.params.values() if hasattr(item, "callspec") else ()
    return {
        extra
        for extra, pattern in PARAMETERS.items()
        if any(pattern.search(value) for value in values if isinstance(value, str))
    }


def pytest_collection_modifyitems(items):
    """Skip the tests of extras that are not installed."""
    missing = {extra for extra, name in MODULES.items() if importlib.util.find_spec(name) is None}
    for item in items:
        for extra in sorted(extras_of(item) & missing):
            item.add_marker(pytest.mark.skip(reason=f"the extra {extra} is not installed"))
