import json
from collections import Counter, OrderedDict, deque
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

import gymnasium as gym
import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from curiosity_algos.checkpoints.plain_json import decode, encode


def round_trip(value):
    return decode(json.loads(json.dumps(encode(value))))


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int64, np.uint8, np.bool_])
def test_arrays_keep_every_bit(dtype):
    for shape in ((3,), (2, 3), (0, 4)):
        array = np.random.default_rng(0).normal(size=shape).astype(dtype)
        read = round_trip({"a": array})["a"]
        assert read.dtype == dtype
        np.testing.assert_array_equal(read, array)
        assert read.flags.writeable


def test_arrays_of_another_byte_order_keep_their_numbers():
    numbers = np.arange(3, dtype=np.dtype(np.float32).newbyteorder())
    np.testing.assert_array_equal(round_trip(numbers), [0, 1, 2])


def test_numpys_scalars_stay_what_they_are(assert_same):
    for scalar in (np.float32(0.1), np.int64(3), np.bool_(True)):
        assert_same(round_trip(scalar), scalar)


PLAIN = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.text()
    | st.builds(Path)
)
NAMES = st.text().filter(lambda name: not name.startswith(":"))
NESTED = st.recursive(
    PLAIN,
    lambda inner: st.lists(inner) | st.lists(inner).map(tuple) | st.dictionaries(NAMES, inner),
    max_leaves=8,
)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(value=NESTED)
def test_types_and_values_stay(value, assert_same):
    assert_same(round_trip(value), value)


class Point(NamedTuple):
    x: int


OTHERS = [
    Point(1),
    Counter("aab"),
    OrderedDict(a=1),
    IntEnum("Color", ["RED"])(1),
    np.ma.masked_array([1.0], [True]),
    np.array([None]),
    th.zeros(1, requires_grad=True),
    th.zeros(1, dtype=th.bfloat16),
    th.zeros(1).to_sparse(),
    {0: object()},
    object(),
]
"""Values that would come back as others, or not at all."""


def test_keys_may_be_anything_that_is_described(assert_same):
    for value in ({0: 1.0, (1, 2): 2.0}, {":array:": 3}, {":serialized:": "code"}, {"0": 1, 0: 2}):
        assert_same(round_trip({"a": value}), {"a": value})


@pytest.mark.parametrize("shape", [(), (2, 3)])
def test_tensors_stay_equal(shape):
    for tensor in (th.rand(shape), th.ones(shape, dtype=th.int64)):
        read = round_trip(tensor)
        assert read.dtype == tensor.dtype
        assert th.equal(read, tensor)


def test_what_would_change_its_type_has_no_description():
    for value in OTHERS:
        for whole in (value, {"a": [value]}):
            with pytest.raises(TypeError, match="JSON has no description of a"):
                encode(whole)


@pytest.mark.parametrize(
    "space",
    [
        spaces.Box(-np.inf, 3.0, (2,)),
        spaces.Box(np.array([0.1, 0.2]), np.array([1.0, 2.0]), dtype=np.float64),
        spaces.Box(0, 255, (2, 2, 1), np.uint8),
        spaces.Box(-1.0, 1.0, ()),
        spaces.Dict(speed=spaces.Box(0, 3, (), np.int64)),
        spaces.Discrete(4),
        spaces.Discrete(3, start=2),
        spaces.MultiBinary(3),
        spaces.MultiBinary([2, 3]),
        spaces.MultiDiscrete([2, 3], start=[1, 0]),
        spaces.MultiDiscrete([2, 3], dtype=np.int32),
        spaces.Tuple([spaces.Discrete(4), spaces.Box(-1.0, 1.0, (2,))]),
        spaces.Dict({"z": spaces.Discrete(4), "a": spaces.Box(-1.0, 1.0, (2,))}),
    ],
    ids=str,
)
def test_spaces_stay_equal(space):
    assert round_trip(space) == space
    assert round_trip(space).dtype == space.dtype


def test_entries_keep_their_order():
    space = spaces.Dict(OrderedDict(z=spaces.Discrete(4), a=spaces.Discrete(2)))
    assert list(round_trip(space)) == ["z", "a"]


def test_queues_keep_their_length():
    read = round_trip(deque([{"r": 1.0, "l": 3}], maxlen=7))
    assert (read, read.maxlen) == (deque([{"r": 1.0, "l": 3}]), 7)


def test_layouts_stay_equal():
    layout = gym.make("CuriosityMaze-Hard-v0").unwrapped.layout
    assert round_trip({"layout": layout}) == {"layout": layout}


def test_coverage_grids_stay_equal():
    grid = gym.make("CuriosityMaze-Hard-v0").unwrapped.coverage_grid
    assert round_trip(grid) == grid
    assert type(round_trip(grid).dimensions) is tuple


def test_generators_go_on():
    rng = np.random.default_rng(3)
    rng.standard_normal(5)
    np.testing.assert_array_equal(round_trip(rng).standard_normal(9), rng.standard_normal(9))
    with pytest.raises(TypeError, match="a generator of Philox"):
        encode(np.random.Generator(np.random.Philox(3)))


@pytest.mark.parametrize(
    "value",
    [
        {":array:": {"dtype": "object", "shape": [1], "bytes": "AAAAAAAAAAA="}},
        {":array:": {"dtype": "float32", "shape": [2], "bytes": "AAAA"}},
        {":array:": {"dtype": "no type", "shape": [2], "bytes": ""}},
        {":array:": [1, 2]},
        {":box:": {"low": [0.0], "high": [1.0]}},
        {":discrete:": {"n": -1, "start": 0}},
        {":deque:": {"iterable": 3}},
        {":coverage_grid:": {"dimensions": [0]}},
        {":generator:": {"kind": "os", "state": {}}},
        {":generator:": {"kind": "PCG64", "state": {}}},
    ],
    ids=str,
)
def test_damaged_descriptions_are_an_error(value):
    with pytest.raises(ValueError, match=r"The description of a \w+ is damaged"):
        decode({"setting": [value]})
