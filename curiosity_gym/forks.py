"""Keeps forked processes from freeing threads and drawing contexts of their parent."""

from __future__ import annotations

import ctypes
import os
import weakref
from typing import Any

_held: weakref.WeakKeyDictionary[Any, tuple[Any, ...]] = weakref.WeakKeyDictionary()


def keep_in_children(owner: object, *resources: object) -> None:
    """Let no forked process free `resources`, as long as `owner` lives when it forks.

    Freeing them there would wait for threads that are not there.
    """
    _held[owner] = resources


def _keep() -> None:
    for resources in _held.values():
        for resource in resources:
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(resource))


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_keep)
