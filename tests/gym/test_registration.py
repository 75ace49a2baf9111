import json
import re

import gymnasium as gym
import pytest
from scripts import run_python

from curiosity_gym import register_envs
from curiosity_gym.built_in import BUILT_IN
from curiosity_gym.maze.maze_env import MazeVectorEnv
from curiosity_gym.registration import SPECS

NAMES = ["Snake", "US", "Hard", "Labyrinth"]
TASKS = ["BallInCup", "Finger", "Stacker"]
ROBOTS = [
    *("Ant", "AntMaze", "AntTrap", "HalfCheetah", "Hopper", "Humanoid", "HumanoidTrap", "Swimmer"),
    "Walker2d",
]
READY_MADE = [
    "PointMaze_UMaze",
    "PointMaze_Large",
    "AntMaze_UMaze",
    "CartPoleSwingUp",
    "AcrobotSwingUp",
]
UNITS = ("maze units", "maze units/s", "m", "rad")
HEAVY = ["numba", "torch", "dm_control", "pygame", "mujoco", "matplotlib"]
TEXT = """
#####
#S.G#
#####
"""


def test_every_id_makes_its_maze_without_a_time_limit():
    for name in NAMES:
        for prefix in ["CuriosityMaze", "Maze"]:
            env_id = f"{prefix}-{name}-v0"
            env = gym.make(env_id)
            assert env.unwrapped.layout is BUILT_IN[name.lower()]
            assert env.unwrapped.horizon == 2000
            assert env.spec.max_episode_steps is None
            envs = gym.make_vec(env_id, num_envs=2, vectorization_mode="vector_entry_point")
            assert isinstance(envs, MazeVectorEnv)
            assert envs.layout is BUILT_IN[name.lower()]


def test_the_ids_are_those_of_the_documentation_and_no_others():
    mazes = {f"{prefix}-{name}-v0" for prefix in ("CuriosityMaze", "Maze") for name in NAMES}
    control = {f"CuriosityControl-{name}-v0" for name in TASKS}
    robots = {f"CuriosityLocomotion-{name}-v0" for name in ROBOTS}
    sparse = {f"CuriositySparse-{name}-v0" for name in READY_MADE}
    assert set(SPECS) == mazes | {"CuriosityMaze-v0"} | control | robots | sparse


@pytest.mark.parametrize("env_id", SPECS)
def test_every_entry_of_a_behavior_has_a_name_and_a_unit(env_id):
    keywords = {"layout": TEXT} if env_id == "CuriosityMaze-v0" else {}
    env = gym.make(env_id, **keywords).unwrapped
    names = env.behavior_names
    assert type(names) is tuple
    assert len(set(names)) == len(names) == env.behavior_space.shape[0]
    for name in names:
        assert re.fullmatch(rf"[a-z][a-z ]* \(({'|'.join(UNITS)})\)", name), name
    if gym.spec(env_id).vector_entry_point is not None:
        envs = gym.make_vec(env_id, 2, "vector_entry_point", **keywords)
        assert envs.behavior_names == names


@pytest.mark.filterwarnings("error")
def test_registering_again_neither_warns_nor_replaces():
    specs = {env_id: gym.spec(env_id) for env_id in SPECS}
    register_envs()
    assert all(gym.spec(env_id) is spec for env_id, spec in specs.items())


def test_importing_the_package_imports_nothing_heavy_and_can_be_repeated():
    code = (
        "import importlib, json, sys\n"
        "import curiosity_gym\n"
        "from curiosity_gym import MazeLayout\n"
        "importlib.reload(curiosity_gym)\n"
        f"print(json.dumps([name for name in {HEAVY} if name in sys.modules]))"
    )
    assert json.loads(run_python(code)) == []
