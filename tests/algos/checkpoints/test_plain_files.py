import numpy as np
import pytest
import torch as th

from curiosity_algos.checkpoints.plain_files import (
    as_arrays,
    as_tensors,
    is_plain,
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


def test_arrays_go_through_a_file(tmp_path, assert_same):
    content = {"a": [{"b": np.arange(3)}], "c": np.array([True]), "d": 10**30, "e": None}
    write_plain(tmp_path / "file", as_tensors(content), "kind 1")
    read = read_plain(tmp_path / "file", "kind 1", what="thing")
    assert_same(as_arrays(read), {**content, "format": "kind 1"})


def test_another_kind_is_refused(tmp_path):
    write_plain(tmp_path / "file", {}, "kind 1")
    with pytest.raises(ValueError, match="`path` must be a saved thing"):
        read_plain(tmp_path / "file", "kind 2", what="thing")
