"""Runs for a sweep's backend, each a path: what they leave there says what became of them."""

import os
import signal
import time


def touch(path):
    """Take a while."""
    path.touch()
    time.sleep(1.0)
    return True


def fall(path):
    """Be killed as often as the name of the path says; each beginning leaves a byte."""
    with path.open("ab") as file:
        file.write(b".")
    if path.stat().st_size <= int(path.name):
        os.kill(os.getpid(), signal.SIGKILL)
    return True


def leave(path):
    """End the process, without a result, unless the path is named as one that stays."""
    path.touch()
    if path.name != "stays":
        os._exit(3)
    return True


def hang(path):
    """Go on through a first Ctrl-C, and never end."""
    path.touch()
    while True:
        try:
            time.sleep(0.01)
        except KeyboardInterrupt:
            path.with_suffix(".interrupted").touch()
