"""How this project compiles its inner loops and runs them on threads."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
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
    is off too, as its atomic operations took more time than the dynamics: a compiled function works
    on arrays that its Python caller holds, and creates none.
    """
    _remove_stale_code(Path(inspect.getfile(function)))
    njit: Any = numba.njit  # its types do not know `_nrt`
    decorate = njit(cache=True, nogil=True, error_model="numpy", forceinline=True, _nrt=False)
    return cast(_F, decorate(function))


@cache
def _remove_stale_code(file: Path) -> None:
    """Remove machine code of `file` that is older than a source file it may have inlined.

    Numba looks at the function's own file alone, and would go on with the old code of the others.
    """
    packages = {Path(__file__).parent, _package(file)}
    newest = max(path.stat().st_mtime for each in packages for path in each.rglob("*.py"))
    for stored in (file.parent / "__pycache__").glob(f"{file.stem}.*.nb[ic]"):
        with suppress(OSError):  # another process may have been faster, or the folder is not ours
            if stored.stat().st_mtime < newest:
                stored.unlink()


def _package(file: Path) -> Path:
    """The outermost package that holds `file`."""
    folder = file.parent
    while (folder.parent / "__init__.py").exists():
        folder = folder.parent
    return folder


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
        if n_threads is not None:
            check_at_least_one(n_threads=n_threads)
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
