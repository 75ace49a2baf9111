"""Locks that end with the process that holds them."""

from __future__ import annotations

import sys
from typing import BinaryIO


def lock_file(file: BinaryIO) -> None:
    """Lock an open file for this process alone, until it is closed.

    Raises:
        OSError: If another process holds it.
    """
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # the process', not the file's
