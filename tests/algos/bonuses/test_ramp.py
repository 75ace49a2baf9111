import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from scipy.stats import wasserstein_distance

from curiosity_algos.bonuses.ramp import RAMP

ACTIONS = spaces.Discrete(2)
CORRIDOR = spaces.Box(-40, 40, (1,))


def make(space=CORRIDOR, **changes):
    return RAMP(space, ACTIONS, **({"seed": 0, "device": "cpu"} | changes))


def train_in_a_corridor(bonus, now, n_updates=2000):
    """Places 0 to 10 were visited alike before; one is `now`; a step leads to the next place."""
    rng = np.random.default_rng(0)
    bonus.observe(th.from_numpy(rng.integers(0, 11, (640, 1)).astype(np.float32)))
    bonus.observe(th.full((len(bonus.newest), 1), float(now)))
    for _ in range(n_updates):
        before = rng.integers(0, 11, (256, 1)).astype(np.float32)
        after = np.clip(before + rng.choice([-1, 1], (256, 1)), 0, 10).astype(np.float32)
        losses = bonus.update(*map(th.from_numpy, (before, np.zeros_like(before), after)))
    return losses


@pytest.mark.parametrize("now", [10, 0])
def test_it_leads_from_where_one_was_to_where_one_is_a_unit_a_step(now):
    bonus = make(n_newest=64)
    losses = train_in_a_corridor(bonus, now)
    places = np.arange(11, dtype=np.float32)[:, None]
    gains = bonus.score(places[:-1], np.zeros(10, dtype=np.int64), places[1:])
    np.testing.assert_allclose(gains, 1.0 if now else -1.0, atol=0.6)
    exact = wasserstein_distance(np.arange(11), [now])
    assert losses["distance"] == pytest.approx(exact, rel=0.25)


def test_over_an_episode_it_adds_up_to_the_difference_of_its_ends():
    bonus = make(spaces.Box(-1, 1, (6,)))
    observations = np.random.default_rng(0).normal(0, 1, (30, 6)).astype(np.float32)
    gains = bonus.score_trajectory(observations, np.zeros(29, dtype=np.int64))
    ends = observations[[0]], np.zeros(1, dtype=np.int64), observations[[-1]]
    assert gains.sum() == pytest.approx(bonus.score(*ends)[0], abs=1e-4)


def test_what_is_now_are_the_newest_and_no_others():
    bonus = make(n_newest=4)
    bonus.observe(th.arange(3.0)[:, None])
    assert bonus.newest[:3, 0].tolist() == [0.0, 1.0, 2.0]
    bonus.observe(th.arange(3.0, 6.0)[:, None])
    assert sorted(bonus.newest[:, 0].tolist()) == [2.0, 3.0, 4.0, 5.0]


def test_of_more_at_once_than_it_holds_it_keeps_some_of_all():
    """In CuriosityES they come individual by individual: the last would be a few of them."""
    bonus = make(n_newest=4)
    bonus.observe(th.arange(14.0)[:, None])
    assert sorted(bonus.newest[:, 0].tolist()) == [0.0, 3.0, 7.0, 10.0]
    bonus.observe(th.zeros(0, 1))
    assert sorted(bonus.newest[:, 0].tolist()) == [0.0, 3.0, 7.0, 10.0]


def test_a_steep_step_raises_the_multiplier_and_a_flat_one_lowers_it():
    for scale, is_higher in ((100.0, True), (1e-3, False)):
        bonus = make(normalize=False)
        before, after = th.zeros(8, 1), th.full((8, 1), scale)
        bonus.update(before, before, after)
        assert (bonus.log_multiplier.item() > 0.0) is is_higher
