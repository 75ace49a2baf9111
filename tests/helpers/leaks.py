"""What a test may leave behind, for which a later one would be blamed."""

import gc
import multiprocessing
import os
import random
import signal
import sys
import threading
from pathlib import Path

import numpy as np

NOT_OURS = ("/dev/", "/memfd:", "/proc/", "/sys/", "/usr/", sys.prefix)
"""Where libraries keep devices and fonts open."""
OWN = {"PYTEST_CURRENT_TEST"}
DESCRIPTORS = Path("/proc/self/fd")


def begin():
    """What is open and set as a test begins, with the generators that belong to nobody seeded."""
    random.seed(0)
    np.random.seed(0)  # noqa: NPY002
    if torch := sys.modules.get("torch"):
        torch.manual_seed(0)
    return opened(), settings()


def left(before):
    """What is open, or set to something else, since `begin`: nothing, as a rule."""
    if not _since(before):
        return []
    gc.collect()  # what nobody holds any more is closed with it
    for thread in opened() - before[0]:
        if isinstance(thread, threading.Thread):
            thread.join(timeout=1.0)
    return _since(before)


def _since(before):
    was_open, was_set = before
    is_set = settings()  # libraries add variables as they are imported: those are left alone
    changed = [
        f"{name}: {is_set.get(name)}" for name in was_set if is_set.get(name) != was_set[name]
    ]
    return [*map(str, opened() - was_open), *changed]


def opened():
    """Files, figures, threads and processes that a test must close, end or wait for."""
    threads = {
        each
        for each in threading.enumerate()  # those of a pool end with it, if not before
        if not each.daemon and not each.name.startswith("ThreadPoolExecutor")
    }
    pyplot = sys.modules.get("matplotlib.pyplot")
    figures = {f"figure {number} of pyplot" for number in pyplot.get_fignums()} if pyplot else set()
    return files() | figures | threads | set(multiprocessing.active_children())


def files():
    """Files that are open: descriptor and path, on Linux."""
    found = set()
    for descriptor in DESCRIPTORS.iterdir() if DESCRIPTORS.is_dir() else ():
        try:
            path = os.readlink(descriptor)
        except OSError:  # that of the listing itself
            continue
        is_of_library = "/ray/session_" in path or "/.onnxruntime/" in path
        if path.startswith("/") and not path.startswith(NOT_OURS) and not is_of_library:
            found.add((descriptor.name, path))
    return found


def settings():
    """What the whole process shares, by name."""
    torch = sys.modules.get("torch")
    return {
        "working directory": os.getcwd(),
        "handler of Ctrl-C": signal.getsignal(signal.SIGINT),
        **({"threads of torch": torch.get_num_threads()} if torch else {}),
        **{name: value for name, value in os.environ.items() if name not in OWN},
    }
