import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from observations import make_observations

from curiosity_algos.bonuses.e3b import E3B

SPACE = spaces.Box(-1, 1, (6,)), spaces.Discrete(3)


def make_e3b(*spaces, **changes):
    return E3B(*(spaces or SPACE), **({"n_features": 4, "seed": 0, "device": "cpu"} | changes))


def by_definition(features, ridge):
    """The bonus of all but the first, with the inverse of a sum made anew at each step."""
    n = features.shape[1]
    scores = []
    for t, each in enumerate(features[1:], start=1):
        covariance = ridge * np.eye(n) + features[:t].T @ features[:t]
        scores.append(each @ np.linalg.inv(covariance) @ each)
    return np.array(scores)


@given(st.integers(0, 1000), st.integers(1, 40), st.sampled_from([0.01, 0.1, 3.0]), st.booleans())
def test_it_is_the_papers_formula_or_what_a_step_adds_to_the_logarithm_of_the_volume(
    seed, n, ridge, log
):
    e3b, observations = make_e3b(ridge=ridge, log=log), make_observations(n + 1, seed)
    expected = by_definition(e3b.features(observations), ridge)
    scores = e3b.score_trajectory(observations, np.zeros(n, dtype=np.int64))
    expected = np.log1p(expected) if log else expected
    np.testing.assert_allclose(scores, expected, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("actions", [spaces.Discrete(3), spaces.Box(-1, 1, (2,))])
def test_features_learn_what_actions_change(actions):
    """The action is the first entry's change, the others are noise."""
    rng = np.random.default_rng(0)
    e3b = make_e3b(SPACE[0], actions, learning_rate=3e-3)
    is_discrete = isinstance(actions, spaces.Discrete)
    losses = []
    for _ in range(300):
        before, after = rng.normal(0, 1, (2, 64, 6)).astype(np.float32)
        taken = rng.integers(0, 3, 64)
        after[:, 0] = before[:, 0] + taken - 1.0
        given = taken[:, None] if is_discrete else np.repeat(taken[:, None] - 1.0, 2, axis=1)
        batch = (before, given.astype(np.float32), after)
        losses.append(e3b.update(*map(th.from_numpy, batch))["loss"])
    assert np.mean(losses[-20:]) < 0.5 * np.mean(losses[:20])
