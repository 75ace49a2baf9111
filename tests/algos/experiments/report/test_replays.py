import base64
from types import SimpleNamespace

import numpy as np
import pytest

from curiosity_algos.experiments.report.collect import Environment
from curiosity_algos.experiments.report.planes import plane_of
from curiosity_algos.experiments.report.replays import MOST_POINTS, best_run, replays


def fake_run(best_return, n=3, **columns):
    points = np.linspace([0.0, 0.0], [200.0, 100.0], n)
    trajectory = {"behaviors": points, "rewards": np.full(n - 1, 0.5)} | columns
    folder = SimpleNamespace(trajectory=lambda: trajectory)
    return SimpleNamespace(label="A", seed="7", best_return=best_return, folder=folder)


def test_the_best_run_that_has_a_trajectory():
    best, other = fake_run(0.5), fake_run(0.2)
    under_way = SimpleNamespace(best_return=0.9, folder=SimpleNamespace(trajectory=dict))
    assert best_run([other, best, under_way, fake_run(0.5)]) is best
    assert best_run([under_way]) is None


def test_a_path_is_where_the_robot_was(maze):
    plane = plane_of(maze)
    for path in replays(maze, plane):
        assert path["steps"] == 50
    (path,) = replays(Environment("A", [fake_run(0.5)], []), plane)
    x, y = (np.frombuffer(base64.b64decode(path[name]["data"]), "<u2") / 65534 for name in "xy")
    np.testing.assert_allclose(x * path["x"]["width"], [0, 100, 200], atol=0.01)
    np.testing.assert_allclose(y * path["y"]["width"], [0, 50, 100], atol=0.01)
    assert (path["seed"], path["return"]) == ("7", pytest.approx(1.0))


def test_a_long_path_is_thinned(maze):
    (path,) = replays(Environment("A", [fake_run(0.5, n=9001)], []), plane_of(maze))
    assert len(base64.b64decode(path["x"]["data"])) == 2 * MOST_POINTS
    assert path["steps"] == 9000
