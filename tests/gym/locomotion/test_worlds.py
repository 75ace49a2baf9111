"""Robots among walls: the walls are where the layout has them, and the goals can be reached."""

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from robots import changed_model

from curiosity_gym import MazeLayout
from curiosity_gym.layouts import GOAL_RADIUS
from curiosity_gym.locomotion.locomotion_env import LocomotionEnv
from curiosity_gym.locomotion.worlds import TRAP, WORLDS, World

pytestmark = pytest.mark.extra("locomotion")

TASKS = ["AntTrap", "AntMaze", "HumanoidTrap"]
SOLUTIONS = Path(__file__).parent / "solutions.npz"
"""Actions of an episode that each task was solved by, found by planning with its own physics."""


def make(name, **keywords):
    return gym.make(f"CuriosityLocomotion-{name}-v0", **keywords).unwrapped


def boxes_of(model):
    """Lower left corner, width and height of the walls in a model."""
    import mujoco

    is_box = (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX) & (model.geom_bodyid == 0)
    center, half = model.geom_pos[is_box, :2], model.geom_size[is_box, :2]
    # They stand on the floor.
    assert (model.geom_pos[is_box, 2] == model.geom_size[is_box, 2]).all()
    stop, drawn = np.split(np.concatenate([center - half, 2.0 * half], axis=1), 2)
    np.testing.assert_array_equal(stop, drawn)
    touches = model.geom_contype[is_box] & model.geom_conaffinity[is_box]
    assert touches.tolist() == [-1] * len(stop) + [0] * len(drawn)
    return stop


class TestWalls:
    @pytest.mark.parametrize("layout", WORLDS.values(), ids=WORLDS)
    def test_are_those_of_the_layout_around_the_start(self, layout):
        env = LocomotionEnv("Ant-v5", world=layout)
        walls, border = np.split(boxes_of(env.task.model), [len(layout.walls)])
        start = np.array(layout.start)
        np.testing.assert_allclose(walls[:, :2] + start, layout.walls[:, :2], atol=1e-12)
        np.testing.assert_allclose(walls[:, 2:], layout.walls[:, 2:], atol=1e-12)
        # Together the border's boxes enclose the world, and leave no gap at a corner.
        low, high = border[:, :2] + start, border[:, :2] + border[:, 2:] + start
        inside = (low < [layout.width, layout.height]) & (high > 0.0)
        assert not inside.all(axis=1).any()
        area = (border[:, 2] * border[:, 3]).sum()
        assert area == pytest.approx(
            (layout.width + 2) * (layout.height + 2) - layout.width * layout.height
        )

    @pytest.mark.parametrize("bits", [1, 2, -(2**31)])
    def test_stop_the_robot(self, tmp_path, bits):
        everything = 'contype="-1" conaffinity="-1"'
        own = f'contype="{bits}" conaffinity="{bits}"'
        changes = ('conaffinity="1"', everything), ('conaffinity="0"', own)
        xml = changed_model(tmp_path, "ant.xml", *changes)
        keywords = {"terminate_when_unhealthy": False, "xml_file": xml}
        env = LocomotionEnv("Ant-v5", world="trap", env_kwargs=keywords)
        env.reset(seed=0)
        data = env.simulation.data[0]
        for _ in range(100):  # through a wall, it would end at the goal
            data.qvel[:2] = 4.0, 0.0
            env.step(np.zeros(8, np.float32))
        assert 10.0 < data.qpos[0] < 11.5  # the face of the U's back

    def test_can_be_anybodys(self):
        text = "#####\n#S.G#\n#####"
        drawn = MazeLayout.from_ascii(text, cell_size=4.0)
        env = LocomotionEnv("Ant-v5", world=drawn)
        assert env.task.world == World(drawn)
        assert env.behavior_space.low.tolist() == [-6.0, -6.0]
        assert env.behavior_space.high.tolist() == [14.0, 6.0]


@pytest.mark.parametrize("robot", ["Ant-v5", "Humanoid-v5"])
def test_observations_are_gymnasiums_after_the_place_in_the_world(robot):
    ours, theirs = LocomotionEnv(robot, world="trap"), gym.make(robot).unwrapped
    observation, expected = ours.reset(seed=4)[0], theirs.reset(seed=4)[0]
    rng = np.random.default_rng(0)
    for _ in range(10):
        place = 2.0 * (theirs.data.qpos[:2] + TRAP.start) / [TRAP.width, TRAP.height] - 1.0
        np.testing.assert_allclose(observation[:2], place, atol=1e-12)
        np.testing.assert_allclose(observation[2:], expected, atol=1e-9)
        action = rng.uniform(-0.4, 0.4, theirs.action_space.shape).astype(np.float32)
        observation, expected = ours.step(action)[0], theirs.step(action)[0]


class TestRewards:
    def test_are_gymnasiums_with_the_speed_towards_the_goal(self):
        env, plain = make("AntTrap", sparse=False), gym.make("Ant-v5").unwrapped
        env.reset(seed=1)
        plain.reset(seed=1)
        goal = np.array(TRAP.goal) - TRAP.start
        rng = np.random.default_rng(0)
        for _ in range(20):
            before = plain.data.body(1).xpos[:2].copy()
            action = rng.uniform(-1, 1, 8).astype(np.float32)
            reward = env.step(action)[1]
            expected = plain.step(action)[1]
            after = plain.data.body(1).xpos[:2]
            x_speed = (after - before)[0] / plain.dt
            speed = (np.linalg.norm(before - goal) - np.linalg.norm(after - goal)) / plain.dt
            assert reward == pytest.approx(expected - x_speed + speed, abs=1e-9)

    @pytest.mark.parametrize("sparse", [True, False])
    def test_end_at_the_goal(self, sparse):
        env = make("AntTrap", sparse=sparse, horizon=100)
        env.reset(seed=0)
        data = env.simulation.data[0]
        goal = np.array(TRAP.goal) - TRAP.start
        for offset, is_reached in ((GOAL_RADIUS + 0.3, False), (GOAL_RADIUS - 0.3, True)):
            data.qpos[:2] = goal[0] + offset, goal[1]
            data.qvel[:] = 0.0
            _, reward, terminated, truncated, info = env.step(np.zeros(8, np.float32))
            assert (terminated, truncated, info["is_success"]) == (is_reached, False, is_reached)
        assert (reward == 1.0 - 2 / 100) == sparse


@pytest.mark.parametrize("name", TASKS)
def test_is_solved_by_a_plan(name):
    with np.load(SOLUTIONS) as solutions:
        actions, seed = solutions[name].astype(np.float32), int(solutions[f"{name} seed"])
    env = make(name)
    env.reset(seed=seed)
    for t, action in enumerate(actions, 1):
        _, reward, terminated, truncated, info = env.step(action)
        assert not truncated
        assert terminated == (t == len(actions))
    assert info["is_success"]
    assert reward == 1.0 - len(actions) / env.horizon > 0.0
