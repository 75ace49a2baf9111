import numpy as np
import pytest

from curiosity_algos.curiosity.scale import LARGEST, BonusScale


def test_it_is_the_deviation_of_the_discounted_sums():
    scale, rng = BonusScale(3, gamma=0.9), np.random.default_rng(0)
    sums, seen = np.zeros(3), []
    for _ in range(500):
        bonus = rng.exponential(4.0, 3)
        scaled = scale.scaled(bonus, is_learning=True)
        sums = 0.9 * sums + bonus
        seen.append(sums)
    assert scaled == pytest.approx(bonus / np.std(seen), rel=0.02)


def test_it_is_bounded():
    scale = BonusScale(1, gamma=0.0)
    for _ in range(50):
        scale.scaled(np.ones(1), is_learning=True)
    assert scale.scaled(np.full(1, 1e9), is_learning=False) == [LARGEST]
    assert scale.scaled(np.full(1, -1e9), is_learning=False) == [-LARGEST]


@pytest.mark.parametrize("n_envs", [1, 16])
@pytest.mark.parametrize("before", [0, 3, 30, 300, 3000])
def test_one_bonus_like_no_other_hardly_moves_it(n_envs, before):
    scale, spared = BonusScale(n_envs, gamma=0.99), BonusScale(n_envs, gamma=0.99)
    rng, means = np.random.default_rng(0), []
    for step in range(before + 1001):
        bonus = outlying = rng.exponential(1.0, n_envs) ** 3
        if step == before:
            outlying = np.r_[1e9, bonus[1:]]
        scaled = scale.scaled(outlying, is_learning=True), spared.scaled(bonus, is_learning=True)
        means.append([each.mean() for each in scaled])
    moved, ordinary = np.mean(means[before + 1 :], axis=0)
    assert ordinary / 4.0 < moved < 4.0 * ordinary


@pytest.mark.parametrize("n_envs", [1, 16])
@pytest.mark.parametrize("size", [1e-4, 1.0, 1e6])
def test_it_comes_from_a_bad_start_to_the_deviation_that_an_unbounded_one_has(n_envs, size):
    scale, rng = BonusScale(n_envs, gamma=0.99), np.random.default_rng(0)
    sums, seen = np.zeros(n_envs), []
    for _ in range(300):
        bonus = rng.exponential(size, n_envs)
        scaled = scale.scaled(bonus, is_learning=True)
        sums = 0.99 * sums + bonus
        seen.append(sums)
    assert scaled == pytest.approx(bonus / np.std(seen), rel=0.2)


def test_it_grows_by_orders_of_magnitude_with_its_bonus():
    scale = BonusScale(1, gamma=0.99)
    for n, size in ((5000, 1e-3), (200, 1e3)):
        for _ in range(n):
            scaled = scale.scaled(np.full(1, size), is_learning=True)
    assert scaled < 0.2


def test_it_may_only_look(assert_same):
    scale = BonusScale(1, gamma=0.5)
    scale.scaled(np.ones(1), is_learning=True)
    before = scale.state_dict()
    scale.scaled(np.full(1, 7.0), is_learning=False)
    assert_same(scale.state_dict(), before)
    scale.reset()
    assert scale.state_dict()["sums"].tolist() == [0.0]


def test_it_goes_on_from_a_saved_state(assert_same):
    scale, other = BonusScale(2, gamma=0.5), BonusScale(2, gamma=0.5)
    for bonus in np.random.default_rng(0).random((9, 2)):
        scale.scaled(bonus, is_learning=True)
    other.load_state_dict(scale.state_dict())
    for bonus in np.random.default_rng(1).random((9, 2)):
        one, twin = (each.scaled(bonus, is_learning=True) for each in (scale, other))
        np.testing.assert_array_equal(one, twin)
    assert_same(scale.state_dict(), other.state_dict())
