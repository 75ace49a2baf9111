"""Every keyword of an environment stands in its constructor, with its default and a description."""

import inspect

import pytest

from curiosity_gym.control.control_env import ControlEnv, ControlVectorEnv
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.locomotion.locomotion_env import LocomotionEnv, LocomotionVectorEnv
from curiosity_gym.maze.maze_env import MazeEnv, MazeVectorEnv

SINGLE = [MazeEnv, ControlEnv, LocomotionEnv]
VECTORS = [MazeVectorEnv, ControlVectorEnv, LocomotionVectorEnv]


def keywords(function):
    """Name: kind, default and type, in their order."""
    parameters = inspect.signature(function).parameters.values()
    return {each.name: (each.kind, each.default, each.annotation) for each in parameters}


def test_vector_environments_take_what_single_ones_take_and_nothing_else():
    own = keywords(EpisodicVectorEnv)
    assert not set(own) - {"render_mode"} & {name for cls in SINGLE for name in keywords(cls)}
    for single, vector in zip(SINGLE, VECTORS, strict=True):
        assert keywords(vector) == own
        assert vector.single_class is single
        with pytest.raises(TypeError, match=f"{single.__name__}.*'n_beam'"):
            vector(n_beam=3)
