"""Compiles inner loops and runs them on threads."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

from curiosity_gym.processors import available_cpus
from curiosity_gym.validation import check_at_least_one

_F = TypeVar("_F", bound=Callable[..., Any])


def compiled(function: _F) -> _F:
    """Compile on the first call, keep the machine code on disk, release the GIL while it runs.

    Fast-math stays off: reordered sums would give other bits in other callers. Reference counting
    is off too, as it took more time than the dynamics: a compiled function creates no arrays.

    Functions of a module in no package are compiled anew in every process: what they inline is not
    known.
    """
    return _compiled(function, forceinline=True, _nrt=False)


def compiled_product(function: _F) -> _F:
    """Compile as `compiled` does a function around `np.dot`, which needs the counting.

    It stays a function of its own: a copy in every caller would take long to compile.
    """
    return _compiled(function, forceinline=False, _nrt=True)


def _compiled(function: _F, **options: bool) -> _F:
    njit: Any = numba.njit  # its types do not know `_nrt`
    dispatcher = njit(nogil=True, error_model="numpy", **options)(function)
    package = function.__module__.partition(".")[0]
    if hasattr(sys.modules[package], "__path__"):
        _keep_on_disk(dispatcher, package)
    return cast(_F, dispatcher)


def _keep_on_disk(dispatcher: Any, package: str) -> None:
    """Keep machine code on disk, valid for the sources of the packages that it may have inlined.

    Numba looks at the function's own file alone, and would go on with the old code of the others.
    """
    try:
        dispatcher.enable_caching()
    except RuntimeError:  # no folder to keep it in: it is compiled anew in every process
        return
    index = dispatcher._cache._cache_file
    inlined = sorted({__name__.partition(".")[0], package})
    # Numba compares its version before it unpickles what may name a class that has moved.
    index._version = (index._version, *map(_digest, inlined))


@cache
def _digest(package: str) -> bytes:
    """A digest of the contents of every source file in a package."""
    digest = hashlib.sha256()
    for folder in map(Path, sys.modules[package].__path__):
        for source in sorted(folder.rglob("*.py")):
            digest.update(source.name.encode() + source.read_bytes())
    return digest.digest()


class ThreadPool:
    """Runs a compiled function over slices of a range, on `n_threads` or as many as processors.

    Python threads and not Numba's own: those abort after a fork or on concurrent calls. The
    function must release the GIL and write only to its own slice: results depend on nothing else.
    """

    def __init__(self, n_threads: int | None = None) -> None:
        if n_threads is not None:
            check_at_least_one(n_threads=n_threads)
        self.n_threads = int(n_threads or available_cpus())
        self._executor: ThreadPoolExecutor | None = None
        self._owner = os.getpid()

    def run(self, function: Callable[[int, int], None], n_items: int, n_slices: int) -> None:
        """Call `function(begin, end)` over `n_slices` slices that cover `range(n_items)`."""
        n_slices = max(1, min(n_slices, n_items))
        bounds = [n_items * i // n_slices for i in range(n_slices + 1)]
        left = iter(list(pairwise(bounds)))  # each thread takes the next: `next` holds the GIL

        def work() -> None:
            for begin, end in left:
                function(begin, end)

        # The caller's own thread is one of them, which saves a hand-over.
        others = min(self.n_threads, n_slices) - 1
        futures = [self._pool().submit(work) for _ in range(others)]
        try:
            work()
        finally:
            begun = [future for future in futures if not future.cancel()]  # those had nothing to do
            wait(begun)
        for future in begun:
            future.result()

    def _pool(self) -> ThreadPoolExecutor:
        # Threads do not survive a fork: a child process starts its own.
        if self._executor is None or self._owner != os.getpid():
            self._executor = ThreadPoolExecutor(self.n_threads)
            self._owner = os.getpid()
        return self._executor

    def __getstate__(self) -> dict[str, Any]:
        """Pickle without the threads."""
        return {**self.__dict__, "_executor": None}
