"""Entries whose changes others foretell, against least squares of numpy."""

import numpy as np
import pytest
import torch as th

from curiosity_algos.bonuses.foretold import RIDGE, ForetoldEntries

N_EPISODES, LENGTH = 60, 100


def make(n_entries=6, n_actions=2, seed=0):
    return ForetoldEntries(n_entries, n_actions, generator=th.Generator().manual_seed(seed))


def learn(entries, before, actions, after, n_batches=1):
    parts = (np.array_split(each, n_batches) for each in (before, actions, after))
    for batch in zip(*parts, strict=True):
        entries.learn(*(th.from_numpy(each) for each in batch))
    return entries


def walks(noise, horizon=1, seed=0):
    """Transitions of a walk in two entries by its actions, beside a noise in four: (n, O)."""
    rng = np.random.default_rng(seed)
    actions = rng.uniform(-1, 1, (N_EPISODES, LENGTH, 2))
    walked = np.cumsum(actions, axis=1) / 4
    states = np.concatenate([walked, noise(rng)], axis=2)
    before, after = (part.reshape(-1, 6) for part in (states[:, :-horizon], states[:, horizon:]))
    return before, actions[:, 1 : LENGTH - horizon + 1].reshape(-1, 2), after


def constant(rng):
    return rng.normal(0, 1, (N_EPISODES, 1, 4)).repeat(LENGTH, axis=1)


def white(rng):
    return rng.normal(0, 1, (N_EPISODES, LENGTH, 4))


def drifting(rng):
    drift = constant(rng)
    for step in range(1, LENGTH):
        drift[:, step] = 0.99 * drift[:, step - 1] + 0.14 * rng.normal(size=(N_EPISODES, 4))
    return drift


def test_shares_are_those_of_least_squares():
    before, actions, after = walks(drifting)
    entries = learn(make(), before, actions, after, n_batches=7)
    known = np.hstack([before, actions])
    random = np.tanh(known @ entries.weights.numpy() + entries.biases.numpy())
    known = np.hstack([known, random, np.ones((len(known), 1))])
    changes = after - before
    ridge = RIDGE * len(known) * np.eye(known.shape[1])
    slopes = np.linalg.solve(known.T @ known + ridge, known.T @ changes)
    left = ((changes - known @ slopes) ** 2).mean(axis=0)
    pairs = zip(before.T, changes.T, strict=True)
    alone = [np.polyfit(x, y, 1, full=True)[1][0] / len(x) for x, y in pairs]
    np.testing.assert_allclose(entries.shares(), 1 - left / alone, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("horizon", [1, 3])
@pytest.mark.parametrize("noise", [constant, white, drifting])
def test_noise_of_its_own_does_not_count_and_what_actions_move_does(noise, horizon):
    entries = learn(make(), *walks(noise, horizon))
    entries.settle()
    assert entries.gate.tolist() == [1.0, 1.0, 0.0, 0.0, 0.0, 0.0]


def test_products_are_foretold_too():
    rng = np.random.default_rng(0)
    angles, speeds = rng.uniform(-np.pi, np.pi, 5000), rng.normal(0, 1, 5000)

    def observed(angles):
        return np.stack([np.cos(angles), np.sin(angles), speeds], axis=1)

    before, after = observed(angles), observed(angles + 0.05 * speeds)
    shares = learn(make(3, 1), before, np.zeros((5000, 1)), after).shares()
    assert shares[:2].min() > 0.5


def test_before_anything_was_seen_all_count():
    entries = make()
    entries.settle()
    assert entries.gate.tolist() == [1.0] * 6


@pytest.mark.parametrize("is_constant", [True, False])
def test_where_nothing_is_foretold_all_count(is_constant):
    rng = np.random.default_rng(0)
    before, after = rng.normal(0, 1, (2, 20_000, 6))
    entries = learn(make(), before, np.zeros((20_000, 2)), before if is_constant else after)
    entries.settle()
    assert entries.gate.tolist() == [1.0] * 6
