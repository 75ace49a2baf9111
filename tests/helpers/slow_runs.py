"""Runs for a sweep's backend, most of them a path: what they leave there says what they met."""

import os
import signal
import time

from curiosity_algos.experiments import RunFolder
from curiosity_algos.experiments.training import train


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


def refuse(path):
    """Raise an error with a note."""
    error = ValueError("no simulator")
    error.add_note("traceback in error.txt")
    raise error


def hang(path):
    """Go on through a first Ctrl-C, which leaves a file, and never end."""
    signal.signal(signal.SIGINT, lambda *_: path.with_suffix(".interrupted").touch())
    path.touch()
    while True:
        time.sleep(0.01)


def fall_after_a_checkpoint(run, folder):
    """Train a run in a process that is killed once, after a checkpoint; a file says after which."""
    commit, killed = RunFolder.commit, folder / "killed"

    def commit_and_fall(self, timesteps, write):
        commit(self, timesteps, write)
        if timesteps and not killed.exists():
            killed.write_text(str(timesteps))
            os.kill(os.getpid(), signal.SIGKILL)

    RunFolder.commit = commit_and_fall
    return train(run, run.folder(folder), interval=1e-6)
