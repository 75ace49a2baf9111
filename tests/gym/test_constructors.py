"""Every keyword of an environment stands in its constructor, with its default and a description."""

import inspect
import re
from pathlib import Path

import pytest

from curiosity_gym.control.control_env import ControlEnv
from curiosity_gym.control.vector_env import ControlVectorEnv
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.locomotion.locomotion_env import LocomotionEnv
from curiosity_gym.locomotion.vector_env import LocomotionVectorEnv
from curiosity_gym.maze.maze_env import MazeEnv
from curiosity_gym.maze.vector_env import MazeVectorEnv
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


PAGES = {
    **{name: {MazeEnv} for name in ["snake", "us", "hard", "labyrinth", "custom"]},
    **{name: {ControlEnv} for name in ["ball_in_cup", "finger", "stacker"]},
    "control": {ControlEnv, ControlVectorEnv, EpisodicVectorEnv},
    "locomotion": {LocomotionEnv, LocomotionVectorEnv, EpisodicVectorEnv},
    "sparse": {SparseEnv, SparseRewardWrapper, BehaviorWrapper},
    "vector": {MazeVectorEnv, ControlVectorEnv, EpisodicVectorEnv},
}


def test_every_page_of_the_documentation_names_the_arguments():
    folder = Path(__file__).parents[2] / "docs" / "environments"
    assert {page.stem for page in folder.glob("*.md")} == {*PAGES, "index"}
    for page, classes in PAGES.items():
        shown = re.findall(r"^\.\. autoclass:: (\S+)", (folder / f"{page}.md").read_text(), re.M)
        assert {f"{cls.__module__}.{cls.__qualname__}" for cls in classes} <= set(shown)
