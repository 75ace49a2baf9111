import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from observations import make_observations
from scipy.spatial.distance import cdist
from torch.nn.functional import log_softmax

from curiosity_algos.bonuses.etd import ETD

SPACE = spaces.Box(-1, 1, (6,)), spaces.Discrete(3)


def make_etd(**changes):
    return ETD(*SPACE, **({"n_features": 4, "seed": 0, "device": "cpu"} | changes))


def by_definition(features, others):
    """Distances (n, m) of features (n, F) to others (m, F), by numpy's maximum and scipy's."""
    n = features.shape[1] // 2
    ahead = np.maximum(features[:, None, :n] - others[None, :, :n], 0.0).max(axis=2)
    return ahead + cdist(features[:, n:], others[:, n:])


@given(st.integers(0, 1000), st.integers(1, 40))
def test_it_is_the_papers_formula(seed, n):
    etd, observations = make_etd(), make_observations(n + 1, seed)
    distances = by_definition(*[etd.features(observations)] * 2)
    expected = [distances[:t, t].min() for t in range(1, n + 1)]
    scores = etd.score_trajectory(observations, np.zeros(n, dtype=np.int64))
    np.testing.assert_allclose(scores, expected, rtol=1e-4)


def test_the_loss_tells_what_followed_from_what_did_not():
    etd, observations = make_etd(), make_observations(65)
    before, after = observations[:-1], observations[1:]
    batch = map(th.from_numpy, (before, np.zeros((64, 1), np.float32), after))
    outputs = etd.encoder(etd.inputs(th.from_numpy(after)))
    distances = by_definition(etd.features(before), etd.features(after))
    logits = outputs[:, -1].detach() - th.from_numpy(distances)
    expected = [-log_softmax(logits, dim=i).diagonal().mean().item() for i in (0, 1)]
    assert etd.losses(*batch)["loss"].item() == pytest.approx(np.mean(expected), rel=1e-4)


def test_distances_grow_with_the_steps_between_and_more_so_against_the_stream():
    """On a ring of 24 places that is walked in one direction."""
    etd = make_etd(n_features=16, learning_rate=3e-3)
    angles = 2.0 * np.pi * np.arange(24) / 24
    ring = np.stack([f(k * angles) for k in (1, 2, 3) for f in (np.cos, np.sin)], axis=1)
    ring = ring.astype(np.float32)
    etd.observe(th.from_numpy(ring))
    rng = np.random.default_rng(0)
    for _ in range(400):
        begins = rng.integers(0, 24, 128)
        steps = rng.geometric(0.3, 128)
        batch = ring[begins], np.zeros((128, 1), np.float32), ring[(begins + steps) % 24]
        etd.update(*map(th.from_numpy, batch))
    distances = by_definition(*[etd.features(ring)] * 2)
    ahead = [distances[np.arange(24), (np.arange(24) + k) % 24].mean() for k in (1, 3, 6, 12)]
    assert ahead == sorted(ahead)
    back = distances[np.arange(24), np.arange(24) - 1].mean()
    assert back > 1.5 * ahead[0]


def test_who_stays_or_comes_back_is_paid_nothing():
    observations = make_observations(5)[[0, 0, 1, 2, 1, 0]]
    scores = make_etd().score_trajectory(observations, np.zeros(5, dtype=np.int64))
    np.testing.assert_allclose(scores[[0, 3, 4]], 0.0, atol=1e-6)
    assert (scores[[1, 2]] > 0.01).all()


@pytest.mark.parametrize("seed", range(6))
def test_no_number_is_the_same_for_all_images(seed):
    images = spaces.Box(0, 255, (7, 7, 3), np.uint8)
    etd = ETD(images, SPACE[1], n_features=8, seed=seed, device="cpu")
    seen = np.random.default_rng(0).integers(0, 256, (200, 7, 7, 3), dtype=np.uint8)
    etd.observe(th.from_numpy(seen))
    spread = etd.encoder(etd.inputs(th.from_numpy(seen))).std(dim=0)
    assert (spread > 0.0).all()
