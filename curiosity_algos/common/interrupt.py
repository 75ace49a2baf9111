"""Ctrl-C that waits until what has begun is done, and processes that end with another."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType


class HeldInterrupt(KeyboardInterrupt):
    """Ctrl-C that was held back until what was under way had ended."""


@contextmanager
def deferred_interrupt(what: str) -> Iterator[None]:
    """Hold the first Ctrl-C back until the block ends, and say so; a second one interrupts at once.

    Raises:
        HeldInterrupt: After the block, if Ctrl-C was pressed in it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []
    previous = signal.getsignal(signal.SIGINT)

    def hold(number: int, frame: FrameType | None) -> None:
        received.append(number)
        signal.signal(signal.SIGINT, previous)
        line = f"Ctrl-C: waiting for the end of {what}; press it again to stop at once."
        # A write that the signal came into, or a closed stderr: neither must end the block.
        with suppress(OSError, RuntimeError, ValueError):
            print(line, file=sys.stderr, flush=True)

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
        raise HeldInterrupt


def end_with(parent: int) -> None:
    """End this process as soon as its parent, of this number, is gone, however that ended."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
