"""Distance to the nearest states seen, in features that tell what follows what."""

import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from observations import make_observations
from scipy.spatial.distance import cdist
from scipy.special import log_softmax
from torch.nn import functional

from curiosity_algos.bonuses.apt import APT, N_PARTS, InfoNCE, distances, lowest

BOX = spaces.Box(-1, 1, (6,)), spaces.Box(-2, 2, (2,))


def make_apt(space=BOX, **changes):
    chosen = {"n_features": 4, "hidden": 8, "n_neighbors": 3, "seed": 0, "device": "cpu"}
    return APT(*space, **(chosen | changes))


@pytest.mark.parametrize("n_seen", [2, 700])
def test_novelty_equals_scipy(n_seen, numpy_network):
    apt, seen, visited = make_apt(), make_observations(n_seen), 2 * make_observations(600, seed=1)
    apt.observe(th.from_numpy(seen))
    apt.score(None, None, visited)  # in features that the update outdates
    apt.update(*(th.from_numpy(part) for part in (seen, np.zeros((len(seen), 2)), seen)))

    def features(observations):
        standardized = np.clip((observations - seen.mean(axis=0)) / seen.std(axis=0), -5, 5)
        return numpy_network(apt.encoder, standardized)

    distances = np.sort(cdist(features(visited), features(seen)), axis=1)[:, :3]
    scores = apt.score(seen, np.zeros((600, 2)), visited)
    np.testing.assert_allclose(scores, distances.mean(axis=1), rtol=2e-3, atol=1e-3)
    trajectory = apt.score_trajectory(visited, np.zeros((599, 2)))
    np.testing.assert_allclose(trajectory, scores[1:], rtol=1e-3)


def test_a_power_is_that_of_the_distance():
    apt, sharp = make_apt(), make_apt(power=2.5)
    for each in (apt, sharp):
        each.observe(th.from_numpy(make_observations()))
    distances, powers = (each.score(None, None, make_observations(seed=1)) for each in (apt, sharp))
    np.testing.assert_allclose(powers, distances**2.5, rtol=1e-5)


@pytest.mark.parametrize(
    ("n", "n_columns"),
    [
        (10, 1),
        (N_PARTS - 1, N_PARTS + 1),
        (10, 10 * N_PARTS + 7),
        (N_PARTS, 10 * N_PARTS),
        (1_000, 10 * N_PARTS + 7),
    ],
)
def test_the_lowest_are_found_exactly(n, n_columns):
    # Few different numbers, so that equal ones meet, and some columns are all of the lowest.
    values = np.random.default_rng(0).integers(0, 50, (7, n_columns)).astype(np.float32)
    found = lowest(th.from_numpy(values), n).numpy()
    np.testing.assert_array_equal(found, np.sort(values, axis=1)[:, :n])


def test_before_anything_was_observed_all_is_alike():
    assert make_apt().score(None, None, make_observations()).tolist() == [0.0] * 20


def test_the_loss_is_that_of_telling_pairs_apart(numpy_network):
    apt, before, after = make_apt(normalize=False), make_observations(), make_observations(seed=1)
    logits = -cdist(numpy_network(apt.encoder, before), numpy_network(apt.encoder, after))
    ahead, back = (-np.diag(log_softmax(logits, axis=axis)).mean() for axis in (1, 0))
    loss = apt.losses(*map(th.from_numpy, (before, np.zeros((20, 2)), after)))["loss"]
    assert loss.item() == pytest.approx((ahead + back) / 2, rel=1e-4)


def walk(n, n_entries=6):
    """A walker in two entries, before noise in the others."""
    rng = np.random.default_rng(0)
    walked = np.cumsum(rng.normal(0, 0.1, (n, 2)), axis=0)
    return np.hstack([walked, rng.normal(0, 1, (n, n_entries - 2))]).astype(np.float32)


def test_features_tell_what_follows_what_and_leave_out_noise():
    apt, states = make_apt(n_features=8, hidden=32, learning_rate=3e-3), walk(2000)
    apt.observe(th.from_numpy(states))
    rng = np.random.default_rng(1)
    for _ in range(300):
        begins = rng.integers(0, 1990, 256)
        ends = begins + rng.integers(1, 10, 256)
        batch = states[begins], np.zeros((256, 2), np.float32), states[ends]
        apt.update(*map(th.from_numpy, batch))
    moved, noisy = states[:500].copy(), states[:500].copy()
    moved[:, :2] += states[:, :2].std(axis=0)
    noisy[:, 2:] = rng.normal(0, 1, (500, 4))
    with th.no_grad():
        here, there, elsewhere = (apt._features(each) for each in (states[:500], moved, noisy))
    assert (there - here).norm(dim=1).mean() > 3 * (elsewhere - here).norm(dim=1).mean()


def train(apt, n_updates=40):
    """Train in front of a walk with noise beside it; the states of it."""
    rng = np.random.default_rng(0)
    actions = rng.uniform(-2, 2, (5000, 2)).astype(np.float32)
    walked, noise = np.cumsum(actions, axis=0), rng.normal(0, 1, (5000, 4))
    states = np.hstack([walked, noise]).astype(np.float32)
    apt.observe(th.from_numpy(states))
    for i in range(n_updates):
        if i == n_updates // 2:
            apt.observe(th.from_numpy(states))  # after which the gate closes
        rows = rng.integers(0, 4999, 256)
        batch = states[rows], actions[rows + 1], states[rows + 1]
        apt.update(*map(th.from_numpy, batch))
    return states


def test_a_selective_one_is_blind_to_what_nothing_foretells():
    for selective in (False, True):
        apt = make_apt(selective=selective)
        states = train(apt)
        others = states.copy()
        others[:, 2:] += 0.5
        is_same = np.array_equal(apt.features(states), apt.features(others))
        assert is_same is selective
        assert np.ptp(apt.features(states), axis=0).max() > 0.1
    squares = apt.foretold.by_itself[1] / apt.foretold.count
    np.testing.assert_allclose(squares, 1.0, atol=0.05)  # of what it is blind to, too


def test_a_selective_one_goes_on_as_it_was(assert_same):
    one, other = make_apt(selective=True), make_apt(selective=True, seed=1)
    train(one, 10)
    other.load_state_dict(one.state_dict())
    states = train(one, 10)
    train(other, 10)
    assert_same(one.state_dict(), other.state_dict())
    np.testing.assert_array_equal(one.features(states), other.features(states))


def test_images_have_no_entries_to_select():
    images = spaces.Box(0, 255, (3, 36, 36), np.uint8), BOX[1]
    with pytest.raises(ValueError, match="`selective` must be False where observations are images"):
        make_apt(images, selective=True)


def test_a_state_that_does_not_fit_changes_nothing(assert_same):
    apt, other = make_apt(), make_apt(memory_size=10, seed=1)
    apt.observe(th.from_numpy(make_observations(300)))
    before = other.state_dict()
    damaged = {**before["memory"], "rng": None}
    for state in (
        apt.state_dict(),
        {**apt.state_dict(), "memory": {}},
        {**before, "memory": damaged},
    ):
        with pytest.raises(ValueError, match="must"):
            other.load_state_dict(state)
    assert_same(other.state_dict(), before)


def test_what_is_remembered_is_known_until_the_next_training():
    apt, rng = make_apt(n_neighbors=1), np.random.default_rng(3)
    seen = make_observations(200)
    apt.observe(th.from_numpy(seen))
    apt.update(*(th.from_numpy(part) for part in (seen, np.zeros((200, 2)), seen)))
    apt.score(None, None, seen)
    for _ in range(5):  # wider than before, as where a walker gets further
        later = rng.normal(0, 5, (100, 6)).astype(np.float32)
        apt.observe(th.from_numpy(later))
        for known in (seen, later):
            assert apt.score(None, None, known).max() < 1e-2


def make_features(n=7, n_features=3, dtype=th.float64):
    generator = th.Generator().manual_seed(0)
    both = th.randn(2, n, n_features, generator=generator, dtype=dtype)
    return [each.requires_grad_() for each in both]


def test_the_gradient_is_that_of_differences():
    assert th.autograd.gradcheck(InfoNCE.apply, make_features())


def by_autograd(features, next_features):
    logits = -th.cdist(features, next_features)
    pairs = th.arange(len(logits))
    ahead, back = (functional.cross_entropy(each, pairs) for each in (logits, logits.T))
    return (ahead + back) / 2


def test_distances_are_scipys():
    one, other = (each.detach() for each in make_features())
    np.testing.assert_allclose(distances(one, other), cdist(one, other))
    assert distances(one[:1], one[:1]).item() == pytest.approx(1e-3)


@pytest.mark.parametrize("scale", [1e-2, 1.0, 300.0])  # distances of 2,400, too
def test_loss_and_gradient_are_autograds(scale):
    features = make_features(n=64, n_features=32, dtype=th.float32)

    def loss_and_gradients(loss):
        found = loss(*(scale * each for each in features))
        return found.item(), th.autograd.grad(3.0 * found, features)

    loss, gradients = loss_and_gradients(InfoNCE.apply)
    expected_loss, expected_gradients = loss_and_gradients(by_autograd)
    assert loss == pytest.approx(expected_loss, rel=1e-4)
    for found, expected in zip(gradients, expected_gradients, strict=True):
        close = 1e-4 * expected.abs().max().item()
        np.testing.assert_allclose(found, expected, rtol=1e-3, atol=close)


def test_features_that_collapsed_are_pulled_on():
    one, other = (each.detach() for each in make_features(dtype=th.float32))
    features, next_features = (1e-6 * one).requires_grad_(), (1e-6 * other).requires_grad_()
    gradients = th.autograd.grad(InfoNCE.apply(features, next_features), features)[0]
    assert th.isfinite(gradients).all()
    assert gradients.abs().max() > 0.0
