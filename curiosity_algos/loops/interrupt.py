"""Ctrl-C that waits for the end of a generation."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def deferred_interrupt() -> Iterator[None]:
    """Hold the first Ctrl-C back until the block ends; a second one interrupts at once.

    A model is then always interrupted between two generations, where it can be saved and resumed.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []
    previous = signal.getsignal(signal.SIGINT)

    def hold(number: int, frame: FrameType | None) -> None:
        received.append(number)
        signal.signal(signal.SIGINT, previous)

    # Only Python's own Ctrl-C is held: another handler is the user's, and stays in charge.
    is_default = previous is signal.default_int_handler
    if is_default:
        signal.signal(signal.SIGINT, hold)
    try:
        yield
    finally:
        if is_default:
            signal.signal(signal.SIGINT, previous)
    if received:
        raise KeyboardInterrupt
