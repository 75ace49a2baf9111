"""How this project compiles its inner loops and runs them on threads."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, TypeVar, cast

import numba

_F = TypeVar("_F", bound=Callable[..., Any])


def compiled(function: _F) -> _F:
    """Compile on the first call, keep the machine code on disk, release the GIL while it runs.

    Fast-math stays off: reordered sums would give other bits in other callers. Reference counting
    is off too, as its atomic operations took more time than the dynamics: a compiled function works
    on arrays that its Python caller holds, and creates none.
    """
    njit: Any = numba.njit  # its types do not know `_nrt`
    decorate = njit(cache=True, nogil=True, error_model="numpy", forceinline=True, _nrt=False)
    return cast(_F, decorate(function))


def available_cpus() -> int:
    """Number of processors that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class ThreadPool:
    """Runs a compiled function over slices of a range, on Python threads.

    Python threads and not Numba's own: those abort after a fork or on concurrent calls. The
    function must release the GIL and write only to its own slice: results depend on nothing else.
    """

    def __init__(self, n_threads: int | None = None) -> None:
        """Create the pool; its threads start with the first use.

        Args:
            n_threads: At least 1; None: as many as this process has processors.

        Raises:
            ValueError: If `n_threads` is less than 1.
        """
        if n_threads is not None and n_threads < 1:
            raise ValueError(f"`n_threads` must be at least 1 or None, got {n_threads}.")
        self.n_threads = n_threads or available_cpus()
        self._executor: ThreadPoolExecutor | None = None
        self._owner = os.getpid()

    def run(self, function: Callable[[int, int], None], n_items: int, n_slices: int) -> None:
        """Call `function(begin, end)` over `n_slices` slices that cover `range(n_items)`."""
        n_slices = max(1, min(n_slices, n_items))
        bounds = [n_items * i // n_slices for i in range(n_slices + 1)]
        slices = list(pairwise(bounds))
        if self.n_threads == 1 or n_slices == 1:
            for begin, end in slices:
                function(begin, end)
            return
        futures = [self._pool().submit(function, begin, end) for begin, end in slices]
        for future in futures:
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
