"""Every keyword of an environment stands in its constructor, with its default and a description."""

import inspect
import re
from pathlib import Path

from curiosity_gym.control.config import configure_control
from curiosity_gym.control.control_env import ControlEnv
from curiosity_gym.control.vector_env import ControlVectorEnv
from curiosity_gym.locomotion.config import configure_locomotion
from curiosity_gym.locomotion.locomotion_env import LocomotionEnv
from curiosity_gym.locomotion.vector_env import LocomotionVectorEnv
from curiosity_gym.maze.config import configure_maze
from curiosity_gym.maze.maze_env import MazeEnv
from curiosity_gym.maze.vector_env import MazeVectorEnv
from curiosity_gym.wrappers.behavior import BehaviorWrapper
from curiosity_gym.wrappers.ready_made import SparseEnv
from curiosity_gym.wrappers.sparse import SparseRewardWrapper

KINDS = {
    "maze": (configure_maze, MazeEnv, MazeVectorEnv),
    "control": (configure_control, ControlEnv, ControlVectorEnv),
    "locomotion": (configure_locomotion, LocomotionEnv, LocomotionVectorEnv),
}
OF_VECTORS = {"num_envs", "autoreset_mode", "max_episode_steps", "copy", "n_threads"}
VECTORS = [MazeVectorEnv, ControlVectorEnv, LocomotionVectorEnv]
ALL = [MazeEnv, MazeVectorEnv, ControlEnv, ControlVectorEnv, LocomotionEnv, LocomotionVectorEnv]
ALL += [SparseEnv, BehaviorWrapper, SparseRewardWrapper]


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
    for cls in ALL:
        assert not any(each[0] is inspect.Parameter.VAR_KEYWORD for each in keywords(cls).values())
        own = OF_VECTORS | {"render_mode"}
        expected = [name for name in keywords(cls) if cls not in VECTORS or name in own]
        assert list(described(cls)) == expected


def test_single_and_vector_environments_take_the_same():
    for kind in KINDS:
        shared, single, vector = map(keywords, KINDS[kind])
        assert list(single.items()) == [*shared.items(), ("render_mode", single["render_mode"])]
        assert {name: each for name, each in vector.items() if name not in OF_VECTORS} == single
        assert set(vector) == set(single) | OF_VECTORS


def test_all_vector_environments_take_the_same_and_say_the_same():
    for kind in ["control", "locomotion"]:
        maze, other = KINDS["maze"][2], KINDS[kind][2]
        for name in OF_VECTORS | {"render_mode"}:
            assert keywords(maze)[name] == keywords(other)[name]
            if (name, kind) != (
                "max_episode_steps",
                "locomotion",
            ):  # it has no sparse reward to tell of
                assert described(maze)[name] == described(other)[name]


PAGES = {
    **{name: {MazeEnv} for name in ["snake", "us", "hard", "labyrinth", "custom"]},
    **{name: {ControlEnv} for name in ["ball_in_cup", "finger", "stacker"]},
    "control": {ControlEnv, ControlVectorEnv},
    "locomotion": {LocomotionEnv, LocomotionVectorEnv},
    "sparse": {SparseEnv, SparseRewardWrapper, BehaviorWrapper},
    "vector": {MazeVectorEnv, ControlVectorEnv},
}


def test_every_page_of_the_documentation_names_the_arguments():
    folder = Path(__file__).parents[2] / "docs" / "environments"
    assert {page.stem for page in folder.glob("*.md")} == {*PAGES, "index"}
    for page, classes in PAGES.items():
        shown = re.findall(r"^\.\. autoclass:: (\S+)", (folder / f"{page}.md").read_text(), re.M)
        assert {f"{cls.__module__}.{cls.__qualname__}" for cls in classes} <= set(shown)
