import numpy as np
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.disagreement import Disagreement

SPACE, ACTIONS = spaces.Box(-1, 1, (6,)), spaces.Box(-1, 1, (2,))


def make(**changes):
    return Disagreement(SPACE, ACTIONS, **({"seed": 0, "device": "cpu"} | changes))


def make_batch(n=40, seed=0):
    rng = np.random.default_rng(seed)
    before, after = rng.normal(0, 1, (2, n, 6)).astype(np.float32)
    return before, rng.uniform(-1, 1, (n, 2)).astype(np.float32), after


def test_it_is_the_variance_of_the_models(numpy_network):
    bonus, (before, actions, after) = make(n_models=3, normalize=False), make_batch()
    steps = np.concatenate([numpy_network(bonus.encoder, before.astype(float)), actions], axis=1)
    foreseen = np.array([numpy_network(model, steps) for model in bonus.models])
    expected = foreseen.var(axis=0).sum(axis=1)
    np.testing.assert_allclose(bonus.score(before, actions, after), expected, rtol=1e-4)


def test_models_agree_on_the_mean_of_noise():
    """The ICM's error would stay: what comes next is drawn anew each time."""
    bonus = make(n_features=4, hidden=16, normalize=False)
    rng = np.random.default_rng(0)
    before, actions = np.zeros((64, 6), np.float32), np.zeros((64, 2), np.float32)
    first = bonus.score(before[:1], actions[:1], before[:1])[0]
    for _ in range(1000):
        after = rng.normal(0, 1, (64, 6)).astype(np.float32)
        losses = bonus.update(*map(th.from_numpy, (before, actions, after)))
    assert bonus.score(before[:1], actions[:1], before[:1])[0] < 0.01 * first
    assert losses["loss"] > 0.01  # the noise itself


def test_only_the_models_learn():
    bonus = make()
    encoder = [each.clone() for each in bonus.encoder.parameters()]
    models = [each.clone() for each in bonus.models.parameters()]
    bonus.update(*map(th.from_numpy, make_batch()))
    assert all(map(th.equal, encoder, bonus.encoder.parameters()))
    assert not any(map(th.equal, models, bonus.models.parameters()))
