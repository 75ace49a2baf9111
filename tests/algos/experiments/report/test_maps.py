import base64
from types import SimpleNamespace

import numpy as np
import pytest

from curiosity_algos.experiments.report.arrays import NO_VALUE
from curiosity_algos.experiments.report.maps import MOST_STATES, MOST_STOPS, maps, n_stops
from curiosity_algos.experiments.report.planes import N_CELLS, Plane, plane_of

SQUARE = Plane(np.zeros(2), np.ones(2))


def unpack(packed):
    return np.frombuffer(base64.b64decode(packed["data"]), dtype=f"<{packed['kind']}")


def fake_run(points, timesteps, generations):
    episodes = {
        "behavior": np.array(points, dtype=np.float32),
        "timesteps": np.array(timesteps),
        "generation": np.array(generations),
    }
    return SimpleNamespace(episodes=episodes)


def drawn(run, plane=SQUARE):
    return {name: unpack(packed) for name, packed in maps(run, plane).items()}


def test_states_appear_with_their_generation():
    points = [[0.005, 0.005], [0.015, 0.005], [0.005, 0.995], [0.005, 0.995]]
    found = drawn(fake_run(points, [10, 10, 20, 20], [1, 1, 2, 2]))
    assert found["states"].tolist() == [0, 1, 9900, 9900]
    assert found["timesteps"].tolist() == [10, 20]
    assert found["generations"].tolist() == [1, 2]
    assert found["shown"].tolist() == [2, 4]


def test_a_cell_counts_from_the_first_episode_that_ended_in_it():
    found = drawn(fake_run([[0, 0], [0.99, 0], [0, 0]], [10, 20, 30], [1, 2, 3]))["ended_in"]
    assert found[0] == 0
    assert found[N_CELLS - 1] == 1
    assert (np.delete(found, [0, N_CELLS - 1]) == NO_VALUE).all()


def test_cells_are_those_of_coverage(maze):
    plane = plane_of(maze)
    grid = plane.maze.coverage_grid
    for run in maze.runs:
        cells = drawn(run, plane)["ended_in"].reshape(N_CELLS, N_CELLS).T != NO_VALUE
        share = (cells & grid.reachable).sum() / grid.reachable.sum()
        assert share == pytest.approx(run.coverage)


def test_an_algorithm_without_generations_has_episodes(maze):
    (run,) = maze.of("TD3ICM")
    assert drawn(run, plane_of(maze))["generations"].tolist() == [1, 2, 3, 4]


def test_many_states_are_thinned_and_their_cells_are_not():
    n, rng = 100_000, np.random.default_rng(0)
    run = fake_run(rng.random((n, 2)), np.arange(1, n + 1), np.arange(1, n + 1))
    found = drawn(run)
    assert len(found["states"]) == found["shown"][-1] == MOST_STATES
    assert len(found["timesteps"]) == n_stops(run) == MOST_STOPS
    assert found["generations"][-1] == n
    assert (found["ended_in"] != NO_VALUE).all()


def test_a_state_that_is_not_finite_is_left_out():
    found = drawn(fake_run([[np.nan, 0], [0, 0]], [10, 20], [1, 2]))
    assert found["shown"].tolist() == [0, 1]
