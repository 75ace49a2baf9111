"""Every keyword of an environment stands in its constructor, with its default and a description."""

import inspect
import re

import pytest

from curiosity_gym.control.control_env import ControlEnv, ControlVectorEnv
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.locomotion.locomotion_env import LocomotionEnv, LocomotionVectorEnv
from curiosity_gym.maze.maze_env import MazeEnv, MazeVectorEnv
from curiosity_gym.wrappers.behavior import BehaviorWrapper
from curiosity_gym.wrappers.ready_made import SparseEnv
from curiosity_gym.wrappers.sparse import SparseRewardWrapper

SINGLE = [MazeEnv, ControlEnv, LocomotionEnv]
VECTORS = [MazeVectorEnv, ControlVectorEnv, LocomotionVectorEnv]
OTHERS = [SparseEnv, BehaviorWrapper, SparseRewardWrapper]


def keywords(function):
    """Name: kind, default and type, in their order."""
    parameters = inspect.signature(function).parameters.values()
    return {each.name: (each.kind, each.default, each.annotation) for each in parameters}


def described(cls):
    """Name: what the class's docstring says of an argument."""
    text = re.search(r"^Args:\n((?:    .*\n|\n)+)", inspect.getdoc(cls) + "\n", flags=re.M).group(1)
    entries = re.findall(r"^    (\w+): ((?:.*\n(?:        .*\n)*))", text, flags=re.M)
    return {name: " ".join(description.split()) for name, description in entries}


def test_every_argument_is_spelled_out_and_described():
    for cls in SINGLE + OTHERS:
        assert list(described(cls)) == list(keywords(cls))
    own = keywords(EpisodicVectorEnv)
    assert {"args", "keywords", *described(EpisodicVectorEnv)} == set(own)
    assert not set(own) - {"render_mode"} & {name for cls in SINGLE for name in keywords(cls)}


def test_vector_environments_take_what_single_ones_take_and_nothing_else():
    for single, vector in zip(SINGLE, VECTORS, strict=True):
        assert keywords(vector) == keywords(EpisodicVectorEnv)
        assert vector.single_class is single
        with pytest.raises(TypeError, match=f"{single.__name__}.*'n_beam'"):
            vector(n_beam=3)
