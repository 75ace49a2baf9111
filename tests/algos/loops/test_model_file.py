"""Spaces in files come back, but for those of a user's own class."""

import io

import numpy as np
import pytest
from gymnasium import spaces

from curiosity_algos.loops.model_file import decode_space, encode_space
from curiosity_algos.state.file import read, save

BOX = spaces.Box(np.array([-1.0, -np.inf]), np.array([1.0, np.inf]), dtype=np.float64)
SPACES = [
    BOX,
    spaces.Box(0, 255, (3, 2), np.uint8),
    spaces.Discrete(4, start=-1),
    spaces.MultiBinary(3),
    spaces.MultiBinary((2, 3)),
    spaces.MultiDiscrete([2, 5], start=[1, 0]),
    spaces.Tuple([BOX, spaces.Discrete(2)]),
    spaces.Dict({"b": BOX, "a": spaces.Dict({"c": spaces.Discrete(3)})}),
]


class Own(spaces.Box):
    """A user's own."""


@pytest.mark.parametrize("space", SPACES, ids=str)
def test_a_space_comes_back(space):
    file = io.BytesIO()
    save(file, "space", {"space": encode_space(space)}, {})
    again = decode_space(read(file, "space")[0]["space"])
    assert again == space
    assert str(again) == str(space)


def test_one_of_ones_own_is_none():
    own = Own(-1, 1, (2,))
    for space in (own, spaces.Tuple([BOX, own]), spaces.Dict({"own": own}), None):
        assert encode_space(space) is None
    assert decode_space(None) is None
