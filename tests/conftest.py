"""What every test needs: no screen, Python's own answer to Ctrl-C, and the extras that it uses.

Beside that, the examples that hypothesis draws, the order of the tests, and which files are slow.
"""

import contextlib
import ctypes
import importlib.util
import os
import random
import re
import signal
import sys
from pathlib import Path

import leaks
import pytest
from hypothesis import settings

from curiosity_gym.processors import available_cpus

# PyTorch's CUDA build imports it with the first optimizer: after software OpenGL, that is a crash.
with contextlib.suppress(ImportError):
    import triton  # noqa: F401  to be there before OpenGL

# Beside other tests, torch's threads only wait for each other.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# Ray's workers yield to whatever else runs: beside other tests one would take a minute to start.
os.environ.setdefault("RAY_worker_niceness", "0")
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("MPLBACKEND", "Agg")

# A shell that runs the tests in the background makes them ignore Ctrl-C, which some of them press.
signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples in every run: a gate does not fail by chance. `make fuzz` draws others.
settings.register_profile("gate", derandomize=True, database=None, deadline=None, max_examples=50)
settings.register_profile("fuzz", database=None, deadline=None, max_examples=1000, print_blob=True)
settings.load_profile("gate")

TESTS = Path(__file__).parent
SLOW = [
    "algos/algorithms/test_cma_me.py",
    "algos/archives/test_sparse_grid.py",
    "algos/bonuses/test_checks.py",
    "algos/bonuses/test_noveld.py",
    "algos/state/test_foreign_state.py",
    "algos/cli",
    "algos/common/test_interrupt.py",
    "algos/common/test_presets.py",
    "algos/evaluation/test_environments.py",
    "algos/evaluation/test_ray.py",
    "algos/evaluation/test_simulation.py",
    "algos/evaluation/test_sparse_envs.py",
    "algos/experiments",
    "algos/loops/test_quality_diversity.py",
    "algos/sb3",
    "algos/test_imports.py",
    "algos/test_resume.py",
    "algos/test_spaces.py",
    "algos/test_stable_baselines.py",
    "gym/control",
    "gym/locomotion",
    "gym/test_compiled.py",
    "gym/test_state.py",
    "gym/wrappers/test_ready_made.py",
    "test_benchmark_results.py",
    "test_benchmarks.py",
    "test_examples.py",
    "test_extras.py",
    "test_paper_evidence.py",
    "test_reproduce.py",
    "test_rl_zoo3.py",
]
"""Files and folders that start processes, compile emitters, or train: not in `make check`."""
APART = {
    "nightly": "run the tests that are slow and rarely break, and no others",
    "pages": "run the snippets of the pages and the examples, and nothing else",
}
"""Marks of tests that run where an option of the same name asks for them, and what that does."""

MODULES = {
    "control": "dm_control",
    "locomotion": "mujoco",
    "minari": "minari",
    "onnx": "onnx",
    "ray": "ray",
    "render": "pygame",
    "robotics": "gymnasium_robotics",
    "tensorboard": "tensorboard",
    "track": "wandb",
    "video": "moviepy",
}
"""Extra: the module without which it is not installed."""
PARAMETERS = {
    "control": re.compile("CuriosityControl-|SwingUp|dm_control|^control"),
    "locomotion": re.compile("CuriosityLocomotion-"),
    "minari": re.compile("export_minari"),
    "onnx": re.compile("import onnxruntime"),
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


def marks_apart(item):
    """The marks that keep a test out of `make test`."""
    return {mark.name for mark in item.iter_markers()} & set(APART)


def pytest_addoption(parser):
    """Add the options that tests run in another order, and that only some of them do."""
    for name, text in APART.items():
        parser.addoption(f"--{name}", action="store_true", help=text)
    parser.addoption("--fast", action="store_true", help="leave out what SLOW lists")
    parser.addoption("--gpu", action="store_true", help="let the tests see the GPU")
    parser.addoption("--shuffle", metavar="SEED", help="run the tests in the order that SEED draws")


def pytest_configure(config):
    """Hide the GPU from tests that do not ask for it: the bits they expect are the processor's."""
    if not config.getoption("gpu"):
        os.environ["CUDA_VISIBLE_DEVICES"] = ""


@pytest.hookimpl(optionalhook=True)  # of pytest-xdist
def pytest_xdist_auto_num_workers():
    """One more than processors, as tests often wait for a process, but four at most."""
    return min(4, available_cpus() + 1)


def pytest_ignore_collect(collection_path, config):
    """Leave out slow files where that is asked for, and with them what only they import."""
    is_slow = any(collection_path.is_relative_to(TESTS / path) for path in SLOW)
    return True if is_slow and config.getoption("fast") else None


def pytest_collection_modifyitems(config, items):
    """Leave out what runs elsewhere, skip what lacks its extras, and put all in order."""
    asked = {name for name in APART if config.getoption(name)}
    config.hook.pytest_deselected(items=[item for item in items if marks_apart(item) != asked])
    items[:] = [item for item in items if marks_apart(item) == asked]
    missing = {extra for extra, name in MODULES.items() if importlib.util.find_spec(name) is None}
    for item in items:
        for extra in sorted(extras_of(item) & missing):
            item.add_marker(pytest.mark.skip(reason=f"the extra {extra} is not installed"))
    if (seed := config.getoption("shuffle")) is not None:
        items.sort(key=lambda item: _place(seed, item))


def _place(seed, item):
    """Where a test stands in a drawn order: files stay whole, as their fixtures are shared."""
    file = item.nodeid.partition("::")[0]
    return [random.Random(f"{seed} {name}").random() for name in (file, item.nodeid)]


@pytest.fixture(autouse=True)
def _nothing_is_left():
    """Fail the test that leaves a file open or a setting of the process changed."""
    before = leaks.begin()
    yield
    if left := leaks.left(before):
        pytest.fail(f"The test left: {left}", pytrace=False)


@pytest.fixture(autouse=True, scope="module")
def _memory_goes_back():
    """Give what a file's tests have freed back to the system: glibc keeps gigabytes of MuJoCo's."""
    yield
    if sys.platform == "linux":
        getattr(ctypes.CDLL(None), "malloc_trim", int)(0)  # other libraries have none


@pytest.fixture
def has_ink():
    """Whether a figure shows more than a grid within each of some axes."""

    def check(figure, *axes):
        import numpy as np
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        for ax in axes:
            ax.grid(False)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        picture = np.asarray(canvas.buffer_rgba())[::-1, :, :3]  # y points up
        insides = []
        for ax in axes:
            left, bottom, right, top = map(int, ax.get_window_extent().extents)
            insides.append(picture[bottom + 3 : top - 3, left + 3 : right - 3])
        return all((inside != inside[0, 0]).any() for inside in insides)

    return check
