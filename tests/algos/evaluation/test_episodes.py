import numpy as np
import pytest

from curiosity_algos.evaluation.coverage import BestPolicy, EpisodeRecord, Firsts
from curiosity_algos.evaluation.rollouts import Rollouts
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
    assert (record.firsts.reward, record.firsts.success) == (None, None)
    record.add(infos, np.array([True, True]), 12)
    record.add(infos, np.array([True, False]), 14)
    assert record.coverage.all == 2 / 50
    assert record.best_return == 9.0
    assert (record.firsts.reward, record.firsts.success) == (12, 12)
    assert record.firsts.metrics == {"time/first_reward": 12, "time/first_success": 12}


def test_it_counts_the_cells_of_every_step():
    record = EpisodeRecord(GRID)
    for x in (3.0, 4.0, 4.5):
        record.add([{"behavior": np.array([x])}, {}], np.array([False, True]), 2)
    assert (record.coverage.all, record.coverage.visited) == (0.0, 2 / 50)
    record.add([{"behavior": np.array([9.0])}], np.array([True]), 4)
    assert (record.coverage.all, record.coverage.visited) == (1 / 50, 3 / 50)


def test_where_nothing_is_counted_a_behavior_may_be_anything():
    record = EpisodeRecord(None)
    record.add([{}], np.array([True]), 1)
    assert (record.coverage.all, record.best_return) == (None, -np.inf)
    record.add([{"behavior": "walking", "episode": {"r": 2.0}}], np.array([True]), 1)
    assert record.best_return == 2.0


def test_it_goes_on_from_a_saved_state():
    record, other = EpisodeRecord(GRID), EpisodeRecord(GRID)
    info = {"behavior": np.array([3.0]), "is_success": True, "episode": {"r": 9.0}}
    record.add([info], np.array([True]), 5)
    other.load_state_dict(record.state_dict())
    assert other.coverage.all == 1 / 50
    assert (other.best_return, other.firsts.reward, other.firsts.success) == (9.0, 5, 5)


def test_of_a_generation_each_episode_has_its_own_end():
    firsts = Firsts()
    firsts.add(np.array([10, 15, 35]), np.array([0.0, 0.2, 0.1]), np.array([False, False, True]))
    assert (firsts.reward, firsts.success) == (15, 35)
    firsts.add(np.array([40]), np.ones(1), np.ones(1, dtype=bool))
    assert (firsts.reward, firsts.success) == (15, 35)


@pytest.mark.parametrize("behavior", [np.array([np.nan]), np.array([np.inf])])
def test_a_behavior_that_is_not_finite_is_refused(behavior):
    record = EpisodeRecord(GRID)
    record.add([{"behavior": behavior}], np.array([False]), 1)  # on its way it may be unknown
    with pytest.raises(ValueError, match="`env` must give finite behaviors"):
        record.add([{"behavior": behavior}], np.array([True]), 2)


def test_the_best_policy_is_the_first_of_equals_or_the_first_success():
    best, policies = BestPolicy(1), np.arange(2, dtype=np.float32)[:, None]
    ends, no_behaviors = np.zeros((2, 1), np.float32), np.zeros((2, 0))
    for seed, returns, success, expected in [
        (1, [0.0, 0.0], [False, False], (0.0, 1, 0.0, False)),
        (2, [0.0, 0.0], [False, True], (0.0, 2, 1.0, True)),
        (3, [0.0, 0.0], [True, False], (0.0, 2, 1.0, True)),
        (4, [1.0, 2.0], [True, False], (2.0, 4, 1.0, True)),
        (5, [2.0, 1.0], [True, True], (2.0, 4, 1.0, True)),
    ]:
        one = np.ones(2, dtype=np.int64)
        arrays = np.array(returns), one, np.array(success), one > 0, no_behaviors, ends
        best.add(policies, Rollouts(*arrays), seed)
        assert (best.value, best.seed, best.parameters[0], best.has_reward) == expected
