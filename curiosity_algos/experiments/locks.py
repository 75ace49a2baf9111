"""Locks that end with whoever holds them."""

from __future__ import annotations

import os
import sys
import threading
import weakref
from pathlib import Path
from typing import ClassVar

if sys.platform == "win32":
    import msvcrt

    def _lock(file: int) -> None:
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        except PermissionError as error:
            raise BlockingIOError from error
else:
    import fcntl

    def _lock(file: int) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # the open file's, not the process'


class FileLock:
    """Holds a file until `close`, until nobody refers to the lock, or until the process ends.

    What a training that failed has left in the hands of a notebook's traceback must not keep the
    next one out: a thread that asks again takes over from itself, and from threads that have ended.

    Args:
        path: File to hold, which is made where there is none.

    Raises:
        BlockingIOError: If another process holds it, or another thread that is alive.
        OSError: If it cannot be made or held.
    """

    _held: ClassVar[weakref.WeakValueDictionary[Path, FileLock]] = weakref.WeakValueDictionary()

    def __init__(self, path: Path) -> None:
        path, here = path.resolve(), threading.current_thread()
        earlier = self._held.get(path)
        if earlier is not None and (earlier._thread is here or not earlier._thread.is_alive()):
            earlier.close()
        file = os.open(path, os.O_RDWR | os.O_CREAT)
        try:
            _lock(file)
        except OSError:
            os.close(file)
            raise
        self._close = weakref.finalize(self, os.close, file)
        self._thread: threading.Thread = here
        self._held[path] = self

    def close(self) -> None:
        """Let go of the file; of one that is held no more, nothing happens."""
        self._close()
