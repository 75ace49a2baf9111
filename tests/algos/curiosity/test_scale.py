import numpy as np
import pytest

from curiosity_algos.curiosity.curiosity import LARGEST, RewardScale


def scaled(scale, bonus, gamma=0.99):
    """What is paid of a step that the scale has learned of."""
    scale.learn(bonus, gamma=gamma)
    return scale.scaled(bonus)


@pytest.mark.parametrize(
    ("n_envs", "gamma", "size", "n_steps", "close"),
    [
        (3, 0.9, 4.0, 500, 0.02),
        *[(n_envs, 0.99, size, 300, 0.2) for n_envs in (1, 16) for size in (1e-4, 1e6)],
    ],
)
def test_it_comes_to_the_deviation_of_the_discounted_sums(n_envs, gamma, size, n_steps, close):
    scale, rng = RewardScale(n_envs, bounds_sums=True), np.random.default_rng(0)
    sums, seen = np.zeros(n_envs), []
    for _ in range(n_steps):
        bonus = rng.exponential(size, n_envs)
        paid = scaled(scale, bonus, gamma)
        sums = gamma * sums + bonus
        seen.append(sums)
    assert paid == pytest.approx(bonus / np.std(seen), rel=close)


def test_a_sum_ends_with_its_episode():
    scale, rng = RewardScale(2, bounds_sums=True), np.random.default_rng(0)
    sums, seen = np.zeros(2), []
    for t in range(1000):
        rewards = rng.exponential(1.0, 2)
        scale.learn(rewards, gamma=0.9)
        scale.end(ended := np.array([t % 3 == 2, t % 5 == 4]))
        sums = 0.9 * sums + rewards
        seen.append(sums)
        sums = np.where(ended, 0.0, sums)
    assert scale.scaled(np.ones(1)) == pytest.approx(1.0 / np.std(seen), rel=0.02)


def test_it_is_bounded():
    scale = RewardScale(1, bounds_sums=True)
    for _ in range(50):
        scale.learn(np.ones(1), gamma=0.0)
    assert scale.scaled(np.full(1, 1e9)) == [LARGEST]
    assert scale.scaled(np.full(1, -1e9)) == [-LARGEST]


@pytest.mark.parametrize("n_envs", [1, 16])
@pytest.mark.parametrize("before", [0, 3, 300])
def test_one_bonus_like_no_other_hardly_moves_it(n_envs, before):
    scale, spared = RewardScale(n_envs, bounds_sums=True), RewardScale(n_envs, bounds_sums=True)
    rng, means = np.random.default_rng(0), []
    for step in range(before + 1001):
        bonus = outlying = rng.exponential(1.0, n_envs) ** 3
        if step == before:
            outlying = np.r_[1e9, bonus[1:]]
        means.append([scaled(scale, outlying).mean(), scaled(spared, bonus).mean()])
    moved, ordinary = np.mean(means[before + 1 :], axis=0)
    assert ordinary / 4.0 < moved < 4.0 * ordinary


def test_it_forgets_what_was_long_ago(monkeypatch):
    monkeypatch.setattr("curiosity_algos.curiosity.curiosity.MEMORY", 100)
    scale, fresh = RewardScale(1, bounds_sums=True), RewardScale(1, bounds_sums=True)
    for size, both in ((1e3, [scale]), (1.0, [scale, fresh])):
        for _ in range(2000):
            paid = [scaled(each, np.full(1, size), gamma=0.5).item() for each in both]
    assert paid[0] == pytest.approx(paid[1], rel=0.1)
