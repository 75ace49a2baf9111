import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from observations import make_observations
from scipy.spatial.distance import cdist

from curiosity_algos.bonuses.ngu import NGU

SPACE = spaces.Box(-1, 1, (6,)), spaces.Discrete(3)


def make_ngu(*spaces, **changes):
    return NGU(*(spaces or SPACE), **({"n_features": 4, "seed": 0, "device": "cpu"} | changes))


def by_definition(features, n_neighbors, mean):
    """1 / (sqrt(sum K) + c) of all but the first, by scipy's distances; eps, xi, c of the paper."""
    squares = cdist(features, features, "sqeuclidean")
    scores = []
    for t in range(1, len(features)):
        nearest = np.sort(squares[t, :t])[:n_neighbors]
        kernel = 1e-3 / (np.maximum(nearest / mean - 8e-3, 0.0) + 1e-3)
        scores.append(1.0 / (np.sqrt(kernel.sum()) + 1e-3))
    return np.array(scores)


def train_on(ngu, observations):
    before, after = th.from_numpy(observations[:-1]), th.from_numpy(observations[1:])
    return ngu.update(before, th.zeros(len(before), 1), after)


@given(st.integers(0, 1000), st.integers(1, 40), st.integers(1, 12))
def test_it_is_the_papers_formula(seed, n, n_neighbors):
    ngu, observations = make_ngu(n_neighbors=n_neighbors), make_observations(n + 1, seed)
    expected = by_definition(ngu.features(observations), n_neighbors, 1.0)
    scores = ngu.score_trajectory(observations, np.zeros(n, dtype=np.int64))
    np.testing.assert_allclose(scores, expected, rtol=1e-4)


def test_distances_are_measured_by_those_to_the_nearest_in_training():
    ngu = make_ngu(n_neighbors=3)
    led_to, actions = make_observations(), th.zeros(20, 1)
    assert ngu.mean_distance == 1.0
    ngu.update(th.from_numpy(led_to), actions, th.from_numpy(led_to))
    squares = np.sort(cdist(*[ngu.features(led_to)] * 2, "sqeuclidean"), axis=1)
    assert ngu.mean_distance == pytest.approx(squares[:, 1:4].mean(), rel=1e-4)
    ngu.update(th.zeros(1, 6), th.zeros(1, 1), th.zeros(1, 6))  # which has no other
    assert np.isfinite(ngu.mean_distance)


def test_who_trembles_is_not_paid_as_who_goes_far():
    ngu, steps = make_ngu(), np.cumsum(make_observations(60), axis=0)
    train_on(ngu, steps)
    far, near = (
        ngu.score_trajectory(scale * steps, np.zeros(59, dtype=np.int64)).mean()
        for scale in (1.0, 1e-4)
    )
    assert near < 0.2 * far


def test_who_begins_anew_and_stays_is_paid_nothing_for_rounding():
    """One of n is encoded alone at its beginning, and with the others from there on."""
    ngu, observations = make_ngu(), make_observations(8)
    actions, episodes = np.zeros(8, dtype=np.int64), ngu.episodes(8)
    episodes.score(observations, actions, observations)
    episodes.end(np.arange(8) == 3)
    assert episodes.score(observations, actions, observations)[3] < 1.01


def test_who_stays_is_paid_less_and_less():
    observations = np.repeat(make_observations(1), 8, axis=0)
    scores = make_ngu().score_trajectory(observations, np.zeros(7, dtype=np.int64))
    np.testing.assert_allclose(scores, 1.0 / (np.sqrt(np.arange(1, 8)) + 1e-3), rtol=1e-6)


def test_what_is_new_in_training_is_worth_up_to_five_times_as_much():
    ngu, observations = make_ngu(), make_observations()
    assert ngu.ratios(observations).tolist() == [1.0] * 20
    led_to = th.from_numpy(observations)
    ngu.update(th.from_numpy(make_observations(seed=1)), th.zeros(20, 1), led_to)
    errors = ngu.errors(led_to).detach().double().numpy()
    alpha = 1.0 + (errors - errors.mean()) / errors.std()
    np.testing.assert_allclose(ngu.ratios(observations), np.clip(alpha, 1.0, 5.0), rtol=1e-5)
    assert ngu.ratios(100.0 * observations).max() == 5.0


def test_both_factors_are_of_where_a_step_leads():
    ngu, observations = make_ngu(), make_observations(21)
    train_on(ngu, observations)
    led_to = observations[1:]
    within = by_definition(ngu.features(observations), ngu.n_neighbors, ngu.mean_distance)
    scores = ngu.score_trajectory(observations, np.zeros(20, dtype=np.int64))
    np.testing.assert_allclose(scores, within * ngu.ratios(led_to), rtol=1e-4)
    learned = ngu.losses(*map(th.from_numpy, (observations[:-1], np.zeros((20, 1)), led_to)))
    assert learned["rnd_loss"] == ngu.errors(th.from_numpy(led_to)).mean()
