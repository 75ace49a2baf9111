"""What becomes of states and zips on a disk: one that is read, changed, or full."""

import errno
import io
import json
import os
import zipfile
from functools import reduce
from operator import getitem

import numpy as np

from curiosity_algos.state.file import ABOUT, read, save


def through_a_file(state):
    """A state as it is read again, without any code that a file may hold."""
    file = io.BytesIO()
    save(file, "state", {}, {"it": state})
    return read(file, "state")[1]["it"]


def rewrite(path, change, compression=zipfile.ZIP_STORED):
    """Give a zip the members that `change` makes of its own, a dictionary of name: content."""
    with zipfile.ZipFile(path) as archive:
        members = {each: archive.read(each) for each in archive.namelist()}
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in change(members).items():
            archive.writestr(name, content)


def with_about(change):
    """What lets `rewrite` change the JSON of a file of settings and state."""

    def rewritten(members):
        about = json.loads(members[ABOUT])
        change(about)
        return members | {ABOUT: json.dumps(about)}

    return rewritten


def with_entry(path, kind, entry, value):
    """Change one entry of a file, such as "state.rng"."""
    settings, state = read(path, kind)
    tree = {"settings": settings, "state": state}
    *outer, last = (int(key) if key.isdigit() else key for key in entry.split("."))
    reduce(getitem, outer, tree)[last] = value
    save(path, kind, **tree)


def npy_header(shape):
    """How a file of numpy's begins that holds so many numbers, whatever follows."""
    file = io.BytesIO()
    header = {"descr": "<f8", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, header)
    return file.getvalue()


def no_space(*arguments, **kwargs):
    """Fails as what writes to a full disk."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def latest_checkpoint(folder):
    """The file of a CheckpointCallback with most timesteps, or None."""
    paths = folder.glob("*_steps.zip")
    return max(paths, key=lambda path: int(path.stem.split("_")[-2]), default=None)
