import copy
import math
import sys
from collections import deque

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled, ResetNeeded
from gymnasium.utils.env_checker import check_env
from scripts import run_without_display
from stable_baselines3.common.env_checker import check_env as sb3_check_env

from curiosity_gym.core import SimulationError
from curiosity_gym.extras import install_command
from curiosity_gym.registration import SPECS
from curiosity_gym.wrappers.ready_made import TASKS

MODULES = {"control": ["dm_control.suite", "shimmy"], "robotics": ["mujoco", "gymnasium_robotics"]}
POINT_MAZES = ["CuriositySparse-PointMaze_UMaze-v0", "CuriositySparse-PointMaze_Large-v0"]
ANT_MAZE = "CuriositySparse-AntMaze_UMaze-v0"
MAZES = [*POINT_MAZES, ANT_MAZE]
CART_POLE = "CuriositySparse-CartPoleSwingUp-v0"
ACROBOT = "CuriositySparse-AcrobotSwingUp-v0"


ALL = [*MAZES, CART_POLE, ACROBOT]


def play(env, act, seed, options=None):
    """One episode, of which every step but the last is checked; the steps and the last step."""
    observation, info = env.reset(seed=seed, options=options)
    assert not info["is_success"]
    t, is_over = 0, False
    while not is_over:
        observation, reward, terminated, truncated, info = env.step(act(observation))
        t += 1
        assert observation in env.observation_space
        is_over = terminated or truncated
        assert info["is_success"] == terminated
        assert reward == (1.0 - t / env.unwrapped.horizon if terminated else 0.0)
    return t, info["is_success"]


def random_actions(env, seed):
    env.action_space.seed(seed)
    return lambda observation: env.action_space.sample()


def test_every_task_has_an_id():
    ids = {env_id for env_id in SPECS if env_id.startswith("CuriositySparse-")}
    assert ids == set(ALL)
    assert {SPECS[env_id]["kwargs"]["env_id"] for env_id in ids} == set(TASKS)


@pytest.mark.parametrize("env_id", ALL)
class TestEveryTask:
    def test_offers_what_this_packages_environments_offer(self, env_id):
        env = gym.make(env_id)
        assert env.spec.max_episode_steps is None
        assert env.observation_space.dtype == env.action_space.dtype == np.float32
        np.testing.assert_array_equal(env.action_space.low, -1.0)
        np.testing.assert_array_equal(env.action_space.high, 1.0)
        space = env.unwrapped.behavior_space
        assert space.dtype == np.float64
        assert space.is_bounded()
        _, info = env.reset(seed=0)
        for _ in range(20):
            assert info["behavior"] in space
            assert info["is_success"] is False
            info = env.step(env.action_space.sample())[4]

    @pytest.mark.filterwarnings(
        "error",
        r"ignore:Setting the shape on::dm_control\.",
        "ignore:.*(minimum value is -|maximum value is )infinity",
    )
    def test_passes_both_checks(self, env_id):
        env = gym.make(env_id)
        check_env(env.unwrapped, skip_render_check=True)
        sb3_check_env(env.unwrapped)
        sb3_check_env(env)

    def test_episodes_end_at_the_horizon(self, env_id):
        env = gym.make(env_id, horizon=30)
        for seed in range(3):
            assert play(env, random_actions(env, seed), seed) == (30, False)

    def test_seeds_reproduce_episodes(self, env_id):
        env, twin = gym.make(env_id), gym.make(env_id)
        for one, other in ((env, twin), (env, copy.deepcopy(env))):
            actions = [env.action_space.sample() for _ in range(10)]
            np.testing.assert_array_equal(one.reset(seed=7)[0], other.reset(seed=7)[0])
            for action in actions:
                mine, theirs = one.step(action), other.step(action)
                np.testing.assert_array_equal(mine[0], theirs[0])
                np.testing.assert_array_equal(mine[4]["behavior"], theirs[4]["behavior"])
        starts = [env.reset(seed=seed)[0].tolist() for seed in (7, 8)]
        assert starts[0] != starts[1]


def way(maze, start, goal):
    """Centers of the cells on a shortest way between two points, and the goal itself."""
    first, last = (tuple(maze.cell_xy_to_rowcol(xy).tolist()) for xy in (start, goal))
    came_from, queue = {last: None}, deque([last])
    while queue:
        i, j = queue.popleft()
        for neighbor in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
            if maze.maze_map[neighbor[0]][neighbor[1]] != 1 and neighbor not in came_from:
                came_from[neighbor] = i, j
                queue.append(neighbor)
    cells = [first]
    while cells[-1] != last:
        cells.append(came_from[cells[-1]])
    return [*(maze.cell_rowcol_to_xy(np.array(cell)) for cell in cells[1:-1]), goal]


def waypoint_controller(maze):
    """Accelerates towards the next corner, and against the speed."""
    points = []

    def act(observation):
        position, goal, velocity = observation[:2], observation[2:4], observation[6:8]
        if not points:
            points.extend(way(maze, position, goal))
        if len(points) > 1 and np.linalg.norm(points[0] - position) < 0.3:
            points.pop(0)
        return np.float32(10.0 * (points[0] - position) - velocity)

    return act


@pytest.mark.parametrize("env_id", POINT_MAZES)
def test_point_mazes_are_solved_along_a_shortest_way(env_id):
    env = gym.make(env_id)
    for seed in range(3):
        controller = waypoint_controller(env.unwrapped.env.unwrapped.maze)
        t, is_success = play(env, controller, seed)
        assert is_success
        assert 50 < t < env.unwrapped.horizon


@pytest.mark.extra("robotics")
class TestMazes:
    @pytest.mark.parametrize("env_id", MAZES)
    def test_start_and_goal_are_far_apart_unless_the_options_say_otherwise(self, env_id):
        env = gym.make(env_id)
        maze = env.unwrapped.env.unwrapped.maze
        lengths = {"own": set(), "near": set(), "random": set()}
        cell = env.unwrapped._options["goal_cell"]
        near = {"reset_cell": cell, "goal_cell": cell}
        anywhere = {"reset_cell": None, "goal_cell": None}
        options = {"own": None, "near": near, "random": anywhere}
        for name, seed in ((name, seed) for name in options for seed in range(12)):
            observation, _ = env.reset(seed=seed, options=options[name])
            lengths[name].add(len(way(maze, observation[:2], observation[2:4])))
        free = [
            maze.cell_rowcol_to_xy(np.array([i, j]))
            for i, row in enumerate(maze.maze_map)
            for j, kind in enumerate(row)
            if kind != 1
        ]
        longest = max(len(way(maze, one, other)) for one in free for other in free)
        assert lengths["own"] == {longest}
        assert lengths["near"] == {1}
        assert len(lengths["random"]) > 2

    @pytest.mark.parametrize("env_id", MAZES)
    def test_the_behavior_is_the_position_in_the_bounds_of_the_map(self, env_id):
        env = gym.make(env_id)
        _, info = env.reset(seed=1)
        base = env.unwrapped.env.unwrapped
        np.testing.assert_array_equal(info["behavior"], base.data.qpos[:2])
        size = np.array([len(base.maze.maze_map[0]), len(base.maze.maze_map)])
        extent = env.unwrapped.behavior_space.high - env.unwrapped.behavior_space.low
        np.testing.assert_array_equal(extent, size * base.maze.maze_size_scaling)

    def test_a_map_of_ones_own_has_its_own_cells(self):
        for start, goal in [((1, 1), (1, 3)), ((1, 3), (1, 1))]:
            cells = [[1] * 5, [1, 0, 0, 0, 1], [1] * 5]
            cells[start[0]][start[1]], cells[goal[0]][goal[1]] = "r", "g"
            env = gym.make(POINT_MAZES[0], env_kwargs={"maze_map": cells})
            observation, _ = env.reset(seed=0)
            maze = env.unwrapped.env.unwrapped.maze
            places = observation[:2], observation[2:4]
            assert [tuple(maze.cell_xy_to_rowcol(each)) for each in places] == [start, goal]

    @pytest.mark.parametrize(
        ("name", "value"), [("qvel", math.nan), ("qpos", math.nan), ("qpos", 1e12)]
    )
    def test_unstable_physics_end_the_episode_with_an_error(
        self, name, value, tmp_path, monkeypatch
    ):
        monkeypatch.chdir(tmp_path)  # where MuJoCo writes its log
        env = gym.make(MAZES[0])
        data = env.unwrapped.env.unwrapped.data
        action = np.zeros(env.action_space.shape, dtype=np.float32)
        expected = [env.reset(seed=4)[0], env.step(action)[0]]
        getattr(data, name)[0] = value
        with pytest.raises(SimulationError, match=f"BAD{name.upper()} .* reset the environment"):
            env.step(action)
        with pytest.raises(ResetNeeded):
            env.step(action)
        again = [env.reset(seed=4)[0]]
        assert not data.warning.number.any()
        again.append(env.step(action)[0])
        np.testing.assert_array_equal(again, expected)


def pump_pole(observation):
    """Raises the pole's energy to a little above upright's, and keeps the cart at the middle."""
    position, cosine, _, velocity, angular_velocity = observation
    # In units of m g l / 2, where a rod of length 1 has a moment of inertia of m / 3.
    energy = angular_velocity**2 / (3 * 9.81) + cosine - 1.1
    pump = 2.0 * np.sign(angular_velocity * cosine) * energy
    return np.float32([pump - position - 0.3 * velocity])


@pytest.mark.extra("control")
class TestControl:
    def test_the_pole_swings_up(self):
        env = gym.make(CART_POLE)
        for seed in range(3):
            t, is_success = play(env, pump_pole, seed)
            assert is_success
            assert t < 500

    @pytest.mark.parametrize("env_id", [CART_POLE, ACROBOT])
    def test_the_horizon_may_be_longer_than_the_original(self, env_id):
        env = gym.make(env_id, horizon=1005, env_kwargs={"task_kwargs": {"random": 3}})
        assert play(env, lambda observation: np.zeros(1, dtype=np.float32), 0) == (1005, False)

    @pytest.mark.parametrize(("env_id", "angles"), [(CART_POLE, np.array), (ACROBOT, np.cumsum)])
    def test_behaviors_are_as_the_physics_say(self, env_id, angles):
        env = gym.make(env_id)
        env.reset(seed=0)
        for _ in range(200):
            behavior = env.step(env.action_space.sample())[4]["behavior"]
            expected = angles(env.unwrapped.env.unwrapped.physics.data.qpos)
            for mine, joint in zip(behavior, expected, strict=True):
                assert math.remainder(mine - joint, 2 * math.pi) == pytest.approx(0, abs=1e-9)


class TestExtras:
    @pytest.mark.extra
    @pytest.mark.parametrize(
        ("env_id", "extra"), [(POINT_MAZES[0], "robotics"), (CART_POLE, "control")]
    )
    @pytest.mark.parametrize("position", [0, -1])
    def test_a_missing_one_is_one_sentence_with_the_command(
        self, env_id, extra, position, monkeypatch
    ):
        monkeypatch.setitem(sys.modules, MODULES[extra][position], None)
        with pytest.raises(DependencyNotInstalled) as caught:
            gym.make(env_id)
        assert any(f"needs {name}, " in str(caught.value) for name in MODULES[extra])
        assert str(caught.value).endswith(f"`{install_command(extra)}`.")
        assert "\n" not in str(caught.value)

    @pytest.mark.extra("control")
    def test_no_display_is_no_warning(self):
        code = (
            "import gymnasium as gym\n"
            f"env = gym.make('curiosity_gym:{CART_POLE}')\n"
            "print(env.reset(seed=0)[1]['is_success'])"
        )
        printed, complaint = run_without_display(code, MUJOCO_GL="")
        # Without labmaze shimmy prints before it that it leaves locomotion out.
        assert printed.splitlines()[-1:] == ["False"], complaint
        assert "GLFW" not in complaint
