import numpy as np

from curiosity_algos.evaluation.episodes import EpisodeRecord
from curiosity_gym.core import CoverageGrid

GRID = CoverageGrid((0,), np.zeros(1), np.full(1, 50.0))


def test_it_counts_ended_episodes_alone():
    record = EpisodeRecord(GRID)
    infos = [
        {"behavior": np.array([3.0]), "is_success": True, "episode": {"r": 9.0}},
        {"behavior": np.array([7.0]), "is_success": False, "episode": {"r": -1.0}},
    ]
    record.add(infos, np.array([False, True]), 10)
    assert record.coverage.all == 1 / 50
    assert record.best_return == -1.0
    assert record.first_success_timesteps is None
    record.add(infos, np.array([True, True]), 12)
    record.add(infos, np.array([True, False]), 14)
    assert record.coverage.all == 2 / 50
    assert record.best_return == 9.0
    assert record.first_success_timesteps == 12


def test_it_counts_the_cells_of_every_step():
    record = EpisodeRecord(GRID)
    for x in (3.0, 4.0, 4.5):
        record.add([{"behavior": np.array([x])}, {}], np.array([False, True]), 2)
    assert (record.coverage.all, record.coverage.visited) == (0.0, 2 / 50)
    record.add([{"behavior": np.array([9.0])}], np.array([True]), 4)
    assert (record.coverage.all, record.coverage.visited) == (1 / 50, 3 / 50)


def test_infos_may_say_nothing():
    record = EpisodeRecord(None)
    record.add([{}], np.array([True]), 1)
    assert record.coverage.all is None
    assert record.best_return == -np.inf


def test_where_nothing_is_counted_a_behavior_may_be_anything():
    record = EpisodeRecord(None)
    record.add([{"behavior": "walking", "episode": {"r": 2.0}}], np.array([True]), 1)
    assert record.best_return == 2.0


def test_it_goes_on_from_a_saved_state():
    record, other = EpisodeRecord(GRID), EpisodeRecord(GRID)
    info = {"behavior": np.array([3.0]), "is_success": True, "episode": {"r": 9.0}}
    record.add([info], np.array([True]), 5)
    other.load_state_dict(record.state_dict())
    assert other.coverage.all == 1 / 50
    assert (other.best_return, other.first_success_timesteps) == (9.0, 5)
