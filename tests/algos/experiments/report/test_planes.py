from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest

from curiosity_algos.experiments.report.collect import Environment
from curiosity_algos.experiments.report.planes import Plane, plane_of


def environment_of(behaviors, path=None, **description):
    """One run whose episodes ended in `behaviors`."""
    trajectory = {} if path is None else {"behaviors": np.array(path, dtype=float)}
    run = SimpleNamespace(
        episodes={"behavior": np.array(behaviors, dtype=np.float32)},
        folder=SimpleNamespace(trajectory=lambda: trajectory),
        description={"env": None, "env_kwargs": {}, "wrappers": {}} | description,
        label="A",
    )
    return Environment("A", [run], [])


def test_a_maze_is_drawn_with_its_walls(maze):
    plane = plane_of(maze)
    drawn = plane.payload()
    assert (drawn["x"], drawn["y"]) == ([0.0, 200.0], [0.0, 200.0])
    assert drawn["maze"]["start"] == (195, 5)
    assert drawn["maze"]["goal_radius"] == 2.0
    assert drawn["maze"]["walls"].count("Z") == len(plane.maze.layout.walls)


def test_another_environment_is_drawn_around_its_final_states_and_paths(mountain):
    plane = plane_of(mountain)
    (run,) = mountain.runs
    points = np.vstack([run.episodes["behavior"], run.folder.trajectory()["behaviors"]])
    np.testing.assert_allclose(plane.low, points.min(axis=0))
    np.testing.assert_allclose(plane.high, points.max(axis=0))
    assert plane.payload()["maze"] is None


@pytest.mark.extra("control")
def test_coverage_says_how_far_a_plane_reaches():
    env = gym.make("CuriosityControl-BallInCup-v0")
    plane = plane_of(environment_of([[0.0, 0.1], [0.1, 99.0]], env=env.spec.id))
    np.testing.assert_allclose(plane.low, [0.0, 0.1], rtol=1e-6)
    np.testing.assert_allclose(plane.high, [0.1, env.unwrapped.coverage_grid.high[1]], rtol=1e-6)


@pytest.mark.parametrize("env", ["CuriosityMaze-v0", "Unknown-v0"])
def test_an_environment_that_cannot_be_made_again_has_no_walls(env):
    plane = plane_of(environment_of([[0.1, 0.2]], env=env))
    assert plane.maze is None
    np.testing.assert_allclose(plane.low, [0.1, 0.2], rtol=1e-6)
    np.testing.assert_allclose(plane.high, [1.1, 1.2], rtol=1e-6)


def test_behaviors_of_fewer_than_two_entries_have_no_plane():
    assert plane_of(environment_of([[0.1]])) is None
    assert plane_of(environment_of([[]])) is None
    assert plane_of(environment_of([[np.nan, 1.0]])) is None


def test_pixels_are_numbered_row_by_row_from_below():
    plane = Plane(np.array([0.0, 0.0]), np.array([10.0, 5.0]))
    points = np.array([[0.0, 0.0], [9.9, 0.0], [0.0, 4.9], [10.0, 5.0], [-1.0, 99.0]])
    assert plane.indices(points, (10, 5)).tolist() == [0, 9, 40, 49, 40]


def test_pixels_of_a_maze_are_squares(maze):
    plane = plane_of(maze)
    assert plane.pixels == (100, 100)
    assert Plane(np.zeros(2), np.array([200.0, 50.0]), plane.maze).pixels == (100, 25)
