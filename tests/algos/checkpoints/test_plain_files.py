import io
import zipfile

import numpy as np
import pytest
import torch as th
from saved_files import rewrite

from curiosity_algos.checkpoints.plain_files import (
    is_plain,
    is_whole_zip,
    plain,
    read_plain,
    write_plain,
)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ({"a": [1, 2.0, (True, None, "b")], "c": th.zeros(2)}, True),
        (np.float64(1.0), False),  # a float by inheritance
        ({"a": [np.zeros(2)]}, False),
        ({"a": object()}, False),
    ],
    ids=["plain", "number of numpy", "array", "object"],
)
def test_what_a_file_may_hold(value, expected):
    assert is_plain(value) == expected


def test_numbers_become_pythons_own():
    assert type(plain(np.float32(0.5))) is float
    assert type(plain(np.bool_(True))) is bool
    assert plain("text") == "text"


def test_content_goes_through_a_file(tmp_path, assert_same):
    content = {"a": [{"b": th.arange(3)}], "c": th.tensor([True]), "d": 10**30, "e": None}
    write_plain(tmp_path / "file", content, "kind 1")
    read = read_plain(tmp_path / "file", "kind 1", what="thing")
    assert_same(read, {**content, "format": "kind 1"})


def test_another_kind_is_refused(tmp_path):
    write_plain(tmp_path / "file", {}, "kind 1")
    with pytest.raises(ValueError, match="`path` must be a saved thing"):
        read_plain(tmp_path / "file", "kind 2", what="thing")


def zipped(members, compression=zipfile.ZIP_STORED, n_entries=1):
    """A zip whose index names each member so many times."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
        archive.filelist *= n_entries
    return file


NOUGHTS = bytes(100_000)
BOMB = zipped({"storage": NOUGHTS}, zipfile.ZIP_DEFLATED)


@pytest.mark.parametrize(
    ("file", "expected"),
    [
        (zipped({"data": b"{}", "policy.pth": zipped({"storage": NOUGHTS}).getvalue()}), True),
        (BOMB, False),
        (zipped({"policy.pth": BOMB.getvalue()}), False),
        (zipped({"storage": NOUGHTS}, n_entries=99), False),
    ],
    ids=["stored", "compressed", "compressed within", "named often"],
)
def test_a_zip_is_no_larger_than_it_is(file, expected):
    assert is_whole_zip(file) == expected


def test_a_damaged_file_is_refused(tmp_path):
    path = tmp_path / "file"
    write_plain(path, {"a": th.zeros(9)}, "kind 1")
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(ValueError, match=r"`path` must be a saved thing, .* is not a whole one"):
        read_plain(path, "kind 1", what="thing")


def test_a_compressed_file_is_refused(tmp_path):
    path = tmp_path / "file"
    write_plain(path, {"a": th.zeros(9)}, "kind 1")
    rewrite(path, lambda members: members, zipfile.ZIP_DEFLATED)
    with pytest.raises(ValueError, match="`path` must be a saved thing"):
        read_plain(path, "kind 1", what="thing")
