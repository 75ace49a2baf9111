import copy
import math
from collections import deque
from itertools import product

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as sb3_check_env

from curiosity_gym.built_in import BUILT_IN
from curiosity_gym.layouts import MazeLayout, reachable_cells
from curiosity_gym.maze.dynamics import DT, same_maze
from curiosity_gym.maze.maze_env import MazeEnv
from curiosity_gym.registration import SPECS

MAZE_IDS = [
    name
    for name, spec in SPECS.items()
    if "layout" in spec["kwargs"] and name.startswith("Curiosity")
]
FREE = np.zeros(2, dtype=np.float32)
EAST = np.array([1.0, 0.0], dtype=np.float32)

SPACING = 5.0
CLEARANCE = 2.5


def small_layout(goal=(35.0, 20.0)):
    return MazeLayout("small", 40, 40, (5, 20), goal, [])


def plan(layout):
    """Corners of a shortest path from start to goal on a square lattice, clear of the walls."""
    points = np.round(np.array([layout.start, layout.goal]) / SPACING).astype(int)
    start, goal = map(tuple, points.tolist())
    came_from, queue = {start: start}, deque([start])
    while queue:
        node = queue.popleft()
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            neighbor = node[0] + dx, node[1] + dy
            if neighbor not in came_from and is_clear(layout, neighbor):
                came_from[neighbor] = node
                queue.append(neighbor)
    path = [goal]
    while path[-1] != start:
        path.append(came_from[path[-1]])
    path.reverse()
    corners = zip(path, path[1:], path[2:], strict=False)
    return SPACING * np.array([*(b for a, b, c in corners if not is_straight(a, b, c)), goal])


def is_clear(layout, node):
    point = SPACING * np.array(node)
    low = layout.walls[:, :2] - CLEARANCE
    high = layout.walls[:, :2] + layout.walls[:, 2:] + CLEARANCE
    is_inside = (point >= CLEARANCE).all() and (point <= (layout.width, layout.height)).all()
    return is_inside and not ((low < point) & (point < high)).all(axis=1).any()


def is_straight(a, b, c):
    return (b[0] - a[0], b[1] - a[1]) == (c[0] - b[0], c[1] - b[1])


def towards(target, state, maze):
    """The acceleration that comes to rest at the target, as fast as braking in time allows."""
    gap = target - state[:2]
    speed = np.minimum(np.sqrt(1.6 * maze.max_acceleration * np.abs(gap)), maze.max_speed)
    wanted = np.sign(gap) * np.minimum(speed, np.abs(gap) / (2 * DT))
    return ((wanted - state[2:]) / (DT * maze.max_acceleration)).astype(np.float32)


def solve(env):
    """Drive along the plan until the episode ends; all that its last step returned."""
    env.reset()
    state = env.unwrapped.maze.start
    for target in plan(env.unwrapped.layout):
        while np.abs(target - state[:2]).max() > 2.0:
            *result, info = env.step(towards(target, state, env.unwrapped.maze))
            state = info["behavior"]
            assert result[2] or result[3] or result[1] == 0.0
            if result[2] or result[3]:
                return *result, info
    raise AssertionError("The plan ends short of the goal.")


@pytest.mark.parametrize("env_id", MAZE_IDS)
class TestEveryMaze:
    def test_a_plan_is_rewarded_at_the_goal_and_ends_there(self, env_id):
        env = gym.wrappers.RecordEpisodeStatistics(gym.make(env_id))
        _, reward, terminated, truncated, info = solve(env)
        t = info["episode"]["l"]
        assert terminated
        assert not truncated
        assert reward == info["episode"]["r"] == 1.0 - t / 2000
        assert 0.0 < reward < 1.0
        assert info["is_success"] is True
        assert math.dist(info["position"], env.unwrapped.layout.goal) < 2.0

    def test_random_walks_stay_in_reachable_cells_and_within_bounds(self, env_id):
        env = gym.make(env_id).unwrapped
        rng = np.random.default_rng(0)
        observation, info = env.reset()
        behaviors = [info["behavior"]]
        for action in np.repeat(rng.choice([-1.0, 1.0], (40, 2)), 25, axis=0):
            observation, reward, *_, info = env.step(action)
            assert observation in env.observation_space
            assert info["behavior"] in env.behavior_space
            assert reward == 0.0
            behaviors.append(info["behavior"])
        visited = env.coverage_grid.cells(np.array(behaviors))
        assert env.coverage_grid.reachable.ravel()[visited].all()
        assert len(np.unique(visited)) > 5


@pytest.mark.filterwarnings("error")
def test_passes_the_checks_of_gymnasium_and_stable_baselines():
    pytest.importorskip("pygame")
    env = gym.make(MAZE_IDS[0], start_radius=5)
    check_env(env.unwrapped)
    sb3_check_env(env)
    sb3_check_env(env.unwrapped)
    env.close()


class TestSpaces:
    def test_are_those_of_the_documentation(self):
        env = MazeEnv("hard")
        assert env.action_space == gym.spaces.Box(-1.0, 1.0, (2,), np.float32)
        assert env.observation_space.shape == (36,)
        assert env.observation_space.dtype == np.float32
        np.testing.assert_array_equal(env.observation_space.low[[0, 3, 4, 35]], [-1, -1, 0, 0])
        np.testing.assert_array_equal(env.behavior_space.low, [0, 0, -20, -20])
        np.testing.assert_array_equal(env.behavior_space.high, [200, 200, 20, 20])
        assert env.horizon == 2000

    def test_coverage_counts_x_and_y_among_the_reachable_cells(self):
        grid = MazeEnv("us").coverage_grid
        assert grid.dimensions == (0, 1)
        assert grid.n_cells == 50
        np.testing.assert_array_equal(grid.reachable, reachable_cells(BUILT_IN["us"]))
        behavior = np.array([[199.0, 3.0, -20.0, 20.0]])
        assert grid.cells(behavior) == 49 * 50 + 0


class TestReset:
    def test_starts_at_rest_at_the_start(self):
        observation, info = MazeEnv("hard").reset(seed=3)
        np.testing.assert_array_equal(info["behavior"], [195, 5, 0, 0])
        np.testing.assert_allclose(observation[:4], [0.95, -0.95, 0, 0], atol=1e-6)
        assert info["is_success"] is False

    def test_starts_anywhere_near_if_asked_by_the_seed(self):
        env, twin = (MazeEnv("hard", start_radius=20) for _ in range(2))
        places = [env.reset(seed=3)[1]["position"], *(env.reset()[1]["position"] for _ in range(4))]
        again = [
            twin.reset(seed=3)[1]["position"],
            *(twin.reset()[1]["position"] for _ in range(4)),
        ]
        np.testing.assert_array_equal(places, again)
        assert len(np.unique(places, axis=0)) == 5
        assert env.reset(seed=4)[1]["position"][0] != places[0][0]
        np.testing.assert_array_equal(
            env.reset(options={"state": (100.0, 5.0, 0.0, 0.0)})[1]["behavior"], [100, 5, 0, 0]
        )

    def test_draws_nothing_unless_asked(self):
        env, twin = MazeEnv("hard"), MazeEnv("hard", start_radius=0)
        for each in (env, twin):
            before = each.np_random.bit_generator.state
            each.reset()
            assert each.np_random.bit_generator.state == before
        assert same_maze(env.maze, twin.maze)
        assert not same_maze(env.maze, MazeEnv("hard", start_radius=1).maze)

    def test_starts_at_a_given_state(self):
        env = MazeEnv("hard")
        state = np.array([100.0, 5.0, -3.0, 2.0])
        _, info = env.reset(options={"state": state})
        np.testing.assert_array_equal(info["behavior"], state)
        env.step(EAST)
        np.testing.assert_array_equal(state, [100.0, 5.0, -3.0, 2.0])
        np.testing.assert_array_equal(env.reset()[1]["behavior"], [195, 5, 0, 0])

    def test_rejects_a_bad_state_and_keeps_the_episode(self):
        for state in [
            (100.0, 9.5, 0.0, 0.0),  # too near to a wall
            (0.5, 5.0, 0.0, 0.0),
            (100.0, 5.0, 20.5, 0.0),
            (100.0, 5.0, np.nan, 0.0),
            (np.inf, 5.0, 0.0, 0.0),
            (100.0, 5.0),
        ]:
            env = MazeEnv("hard")
            env.reset()
            env.step(EAST)
            before = env.step(EAST)[4]["behavior"]
            with pytest.raises(ValueError, match="state"):
                env.reset(options={"state": state})
            speed = env.step(FREE)[4]["velocity"]
            np.testing.assert_array_equal(speed, before[2:])


class TestStep:
    def test_moves_by_the_clipped_action(self):
        env = MazeEnv(small_layout(), max_acceleration=2.0)
        env.reset()
        *_, info = env.step(np.array([7.0, -0.5], dtype=np.float32))
        np.testing.assert_allclose(info["velocity"], [0.2, -0.1])
        np.testing.assert_allclose(info["position"], [5.02, 19.99])

    def test_reward_falls_with_the_steps_taken(self):
        env = MazeEnv(small_layout(), horizon=50)
        rewards = []
        for speed in (20.0, 10.0):
            env.reset(options={"state": (5.0, 20.0, speed, 0.0)})
            terminated = False
            while not terminated:
                _, reward, terminated, truncated, info = env.step(FREE)
                assert truncated is False
                assert info["is_success"] is terminated
                assert terminated or reward == 0.0
            rewards.append(reward)
        # More than 28 units, to the edge of the goal's area, at 2 and at 1 unit a step.
        assert rewards == [1.0 - 15 / 50, 1.0 - 29 / 50]

    def test_reaching_the_goal_at_the_horizon_terminates_alone(self):
        env = MazeEnv(small_layout(), horizon=15)
        env.reset(options={"state": (5.0, 20.0, 20.0, 0.0)})
        for _ in range(14):
            env.step(FREE)
        _, reward, terminated, truncated, info = env.step(FREE)
        assert (reward, terminated, truncated, info["is_success"]) == (0.0, True, False, True)

    @pytest.mark.parametrize("end", ["goal", "horizon"])
    def test_needs_a_reset_after_the_end(self, end):
        env = MazeEnv(small_layout(), horizon=16 if end == "goal" else 3)
        env.reset(options={"state": (5.0, 20.0, 20.0, 0.0)})
        while not any(env.step(FREE)[2:4]):
            pass
        with pytest.raises(ResetNeeded):
            env.step(FREE)
        env.reset()
        env.step(FREE)

    def test_rejects_a_bad_action_and_does_not_move(self):
        for action in [(np.nan, 0.0), (0.0, np.inf), (0.0,), [[0.0, 0.0]], None]:
            env = MazeEnv("hard")
            _, before = env.reset()
            with pytest.raises(ValueError, match="`action` must be 2 finite numbers"):
                env.step(action)
            *_, after = env.step(FREE)
            np.testing.assert_array_equal(after["behavior"], before["behavior"])

    def test_what_it_returned_is_never_overwritten(self):
        env = MazeEnv("hard")
        returned = [env.reset(options={"state": (100.0, 5.0, 0.0, 0.0)})]
        returned += [env.step(EAST) for _ in range(3)]
        kept = copy.deepcopy(returned)
        env.step(EAST)
        env.reset()
        for now, then in zip(returned, kept, strict=True):
            np.testing.assert_array_equal(now[0], then[0])
            for key, value in then[-1].items():
                np.testing.assert_array_equal(now[-1][key], value)


def test_restitution_is_zero_unless_asked_for():
    for keywords, speed in (({}, 0.0), ({"restitution": 1.0}, 20.0)):
        env = MazeEnv(small_layout(), **keywords)
        env.reset(options={"state": (38.0, 5.0, 20.0, 0.0)})
        assert env.step(FREE)[4]["velocity"][0] == -speed


BAD_KEYWORDS = [
    ("horizon", 0),
    ("n_beams", 2.5),
    *product(["max_speed", "max_acceleration", "lidar_range", "goal_radius"], [0.0, np.nan]),
    ("restitution", 1.1),
    *(("start_radius", value) for value in (-1.0, np.nan, np.inf, "far")),
    ("render_mode", "ansi"),
    ("layout", "spiral"),
    ("layout", None),
]


def test_rejects_bad_keywords_by_name():
    for keyword, value in BAD_KEYWORDS:
        with pytest.raises(ValueError, match=keyword):
            MazeEnv(**({"layout": small_layout()} | {keyword: value}))


def test_a_number_of_numpy_is_that_number():
    """One of half the precision, too: walls that were laid out with it let the robot through."""
    layout = MazeLayout("far", 1000, 1000, (10, 10), (990, 10), [(491.611, 491.611, 200, 200)])
    start = {"state": (390.62, 390.62, 1000.0, 1000.0)}
    half = dict.fromkeys(["max_speed", "max_acceleration", "lidar_range", "goal_radius"], 1000)
    one, other = (
        MazeEnv(layout, n_beams=kind(8), **{name: of(value) for name, value in half.items()})
        for kind, of in ((int, float), (np.uint8, np.float16))
    )
    assert same_maze(one.maze, other.maze)
    for env in (one, other):
        env.reset(options=start)
        assert env.step(FREE)[4]["position"][0] < 491.611 - 1.0


def test_rejects_a_goal_radius_that_the_robot_cannot_come_within():
    layout = small_layout(goal=(39.9, 20.0))
    assert MazeEnv(layout, goal_radius=1.0)
    with pytest.raises(ValueError, match="goal_radius"):
        MazeEnv(layout, goal_radius=0.5)


class TestRender:
    def test_rgb_array_shows_the_robot_where_it_is(self):
        env = gym.make("CuriosityMaze-Hard-v0", render_mode="rgb_array")
        env.reset()
        frames = [env.render()]
        env.reset(options={"state": (100.0, 5.0, 0.0, 0.0)})
        frames.append(env.render())
        assert frames[0].shape == (500, 500, 3)
        assert frames[0].dtype == np.uint8
        changed = (frames[0] != frames[1]).any(axis=2)
        assert changed[487, 250]
        assert changed[487, 487]
        assert not changed[:300, :300].any()

    def test_needs_a_mode_and_an_episode(self):
        env = MazeEnv("hard", render_mode="rgb_array")
        with pytest.raises(ResetNeeded):
            env.render()
        env = MazeEnv("hard")
        env.reset()
        with pytest.warns(UserWarning, match="render_mode"):
            assert env.render() is None
