import json
from collections import deque
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from curiosity_algos.common.plain_json import decode, encode


def round_trip(value):
    return decode(json.loads(json.dumps(encode(value))))


@pytest.mark.parametrize(
    "value", [None, True, 3, 0.1, -np.inf, "text", [1, [2.5, "a"]], {"a": {"b": [None]}}, {}, []]
)
def test_plain_values_stay(value):
    assert round_trip(value) == value


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int64, np.uint8, np.bool_])
@pytest.mark.parametrize("shape", [(3,), (2, 3), (0, 4)])
def test_arrays_keep_every_bit(dtype, shape):
    array = np.random.default_rng(0).normal(size=shape).astype(dtype)
    read = round_trip({"a": array})["a"]
    assert read.dtype == dtype
    np.testing.assert_array_equal(read, array)
    assert read.flags.writeable


@pytest.mark.parametrize("scalar", [np.float32(0.1), np.int64(3), np.bool_(True)])
def test_numpys_scalars_stay_what_they_are(scalar):
    assert type(round_trip(scalar)) is type(scalar)
    assert round_trip(scalar) == scalar


def test_tuples_and_paths_become_lists_and_text():
    assert round_trip((1, (2,))) == [1, [2]]
    assert round_trip(Path("a") / "b") == str(Path("a") / "b")


@pytest.mark.parametrize(
    "space",
    [
        spaces.Box(-np.inf, 3.0, (2,)),
        spaces.Box(np.array([0.1, 0.2]), np.array([1.0, 2.0]), dtype=np.float64),
        spaces.Box(0, 255, (2, 2, 1), np.uint8),
        spaces.Discrete(4),
        spaces.Discrete(3, start=2),
    ],
    ids=str,
)
def test_spaces_stay_equal(space):
    assert round_trip(space) == space
    assert round_trip(space).dtype == space.dtype


def test_queues_keep_their_length():
    read = round_trip(deque([{"r": 1.0, "l": 3}], maxlen=7))
    assert (read, read.maxlen) == (deque([{"r": 1.0, "l": 3}]), 7)


@pytest.mark.parametrize("env_id", ["CuriosityMaze-Hard-v0", "CuriosityControl-BallInCup-v0"])
def test_coverage_grids_stay_equal(env_id):
    grid = gym.make(env_id).unwrapped.coverage_grid
    assert round_trip(grid) == grid
    assert type(round_trip(grid).dimensions) is tuple


@pytest.mark.parametrize(
    "value", [object(), print, int, np.array([None]), np.array(["a"]), [{"a": {1, 2}}]]
)
def test_other_objects_have_no_description(value):
    with pytest.raises(TypeError, match="JSON has no description of a"):
        encode(value)


@pytest.mark.parametrize(
    "value",
    [
        {":array:": {"dtype": "object", "shape": [1], "bytes": "AAAAAAAAAAA="}},
        {":array:": {"dtype": "float32", "shape": [2], "bytes": "AAAA"}},
        {":array:": {"dtype": "no type", "shape": [2], "bytes": ""}},
        {":array:": [1, 2]},
        {":box:": {"low": [0.0], "high": [1.0]}},
        {":box:": {}},
        {":discrete:": {"n": -1, "start": 0}},
        {":discrete:": {"n": 2, "start": 0, "seed": "x"}},
        {":deque:": {"iterable": 3}},
        {":coverage_grid:": {"dimensions": [0]}},
    ],
    ids=str,
)
def test_damaged_descriptions_are_an_error(value):
    with pytest.raises(ValueError, match=r"The description of a \w+ is damaged"):
        decode({"setting": [value]})
