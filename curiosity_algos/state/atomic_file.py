"""Files that appear only once they are whole."""

from __future__ import annotations

import glob
import os
import pathlib
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedWriter

import psutil


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Iterator[BufferedWriter]:
    """Open a file that takes `path`'s place only once it is wholly on disk."""
    target = pathlib.Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    prefix = f".{target.name}.{socket.gethostname()}."
    _remove_stale(target.parent, prefix)
    temporary = target.with_name(f"{prefix}{os.getpid()}.tmp")
    try:
        with open(temporary, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    sync_folder(target.parent)


def _remove_stale(folder: pathlib.Path, prefix: str) -> None:
    """Remove temporary files of processes of this machine that are gone."""
    for path in folder.glob(f"{glob.escape(prefix)}*.tmp"):
        process = path.name[len(prefix) : -len(".tmp")]
        if process.isdecimal() and not psutil.pid_exists(int(process)):
            path.unlink(missing_ok=True)


def sync_folder(folder: pathlib.Path) -> None:
    """Let what was renamed in a folder survive a power cut, where the system can."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
