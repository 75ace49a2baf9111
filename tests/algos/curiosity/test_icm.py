import copy

import numpy as np
import pytest
import torch as th
from gymnasium import spaces

from curiosity_algos.curiosity.icm import ICM

OBSERVATIONS = spaces.Box(-1, 1, (6,))
CONTINUOUS, DISCRETE = spaces.Box(-1, 1, (2,)), spaces.Discrete(3)
SPACES = pytest.mark.parametrize("action_space", [CONTINUOUS, DISCRETE], ids=["box", "discrete"])


def make_icm(action_space=CONTINUOUS, **changes):
    settings = {"n_features": 4, "hidden": 8, "normalize": False, "seed": 0, "device": "cpu"}
    return ICM(OBSERVATIONS, action_space, **(settings | changes))


def make_batch(action_space=CONTINUOUS, n=20, seed=0):
    rng = np.random.default_rng(seed)
    observations = rng.normal(0, 1, (n + 1, 6)).astype(np.float32)
    actions = rng.uniform(-1, 1, (n, 2)).astype(np.float32)
    if action_space is DISCRETE:
        actions = rng.integers(0, 3, n)
    return observations[:-1], actions, observations[1:]


def tensors(batch):
    return [th.from_numpy(part) for part in batch]


def numpy_network(network, x):
    for layer in network:
        if isinstance(layer, th.nn.Linear):
            weights, biases = (p.detach().double().numpy() for p in layer.parameters())
            x = x @ weights.T + biases
        else:
            x = np.maximum(x, 0)
    return x


def numpy_errors(icm, observations, actions, next_observations):
    """Forward and inverse error of each transition, by the definition."""
    standardize = lambda x: x  # noqa: E731
    if hasattr(icm.normalizer, "mean"):
        mean, variance = icm.normalizer.mean.numpy(), icm.normalizer.variance.numpy()
        standardize = lambda x: np.clip((x - mean) / np.sqrt(variance), -5, 5)  # noqa: E731
    features = numpy_network(icm.encoder, standardize(observations))
    next_features = numpy_network(icm.encoder, standardize(next_observations))
    encoded = np.eye(3)[actions] if icm.is_discrete else actions
    forward = numpy_network(icm.forward_model, np.concatenate([features, encoded], axis=1))
    inverse = numpy_network(icm.inverse_model, np.concatenate([features, next_features], axis=1))
    if icm.is_discrete:
        chosen = inverse[np.arange(len(actions)), actions]
        inverse_error = np.log(np.exp(inverse).sum(axis=1)) - chosen
    else:
        inverse_error = np.sqrt(np.square(inverse - actions).sum(axis=1))
    return np.sqrt(np.square(forward - next_features).sum(axis=1)), inverse_error


@SPACES
@pytest.mark.parametrize("normalize", [True, False])
def test_curiosity_and_losses_equal_numpy(action_space, normalize):
    icm, batch = make_icm(action_space, normalize=normalize), make_batch(action_space)
    icm.observe(th.from_numpy(3 + 2 * batch[0]))
    forward, inverse = numpy_errors(icm, *batch)
    np.testing.assert_allclose(icm.score(*batch), forward, rtol=1e-4, atol=1e-5)
    losses = [loss.item() for loss in icm.losses(*tensors(batch))]
    np.testing.assert_allclose(losses, [forward.mean(), inverse.mean()], rtol=1e-4)


@SPACES
def test_a_trajectory_scores_like_its_pairs(action_space):
    icm, (observations, actions, next_observations) = (
        make_icm(action_space),
        make_batch(action_space),
    )
    trajectory = np.concatenate([observations, next_observations[-1:]])
    np.testing.assert_allclose(
        icm.score_trajectory(trajectory, actions),
        icm.score(observations, actions, next_observations),
        rtol=1e-4,
        atol=1e-6,
    )


@SPACES
@pytest.mark.parametrize("beta", [0.0, 0.2, 1.0])
def test_an_update_is_a_step_of_adam_on_the_weighted_loss(action_space, beta):
    icm = make_icm(action_space, beta=beta, learning_rate=1e-2)
    twin, batch = copy.deepcopy(icm), tensors(make_batch(action_space))
    optimizer = th.optim.Adam(twin.parameters(), lr=1e-2)
    for _ in range(3):
        forward_loss, inverse_loss = twin.losses(*batch)
        loss = (1 - beta) * inverse_loss + beta * forward_loss
        metrics = icm.update(*batch)
        assert metrics == pytest.approx(
            {
                "loss": loss.item(),
                "forward_loss": forward_loss.item(),
                "inverse_loss": inverse_loss.item(),
            },
            rel=1e-4,
        )
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    for parameter, expected in zip(icm.parameters(), twin.parameters(), strict=True):
        np.testing.assert_allclose(parameter.detach(), expected.detach(), atol=1e-5)


def test_curiosity_falls_where_it_was_trained_and_stays_high_elsewhere():
    rng = np.random.default_rng(0)
    icm = make_icm(DISCRETE, n_features=8, hidden=32, learning_rate=3e-3)
    states = rng.normal(0, 1, (20, 6)).astype(np.float32)
    successors = rng.integers(0, 20, (20, 3))
    state, action = (grid.ravel() for grid in np.meshgrid(np.arange(20), np.arange(3)))
    mdp = states[state], action, states[successors[state, action]]
    is_seen = state < 10
    seen = [part[is_seen] for part in mdp]
    before = icm.update(*tensors(seen))
    for _ in range(400):
        after = icm.update(*tensors(seen))
    assert after["loss"] < 0.5 * before["loss"]
    curiosity = icm.score(*mdp)
    assert np.median(curiosity[~is_seen]) > 3 * np.median(curiosity[is_seen])


@SPACES
def test_seeds_decide_and_torchs_own_draws_stay(action_space):
    before = th.get_rng_state()
    one, same, other = (make_icm(action_space, seed=seed) for seed in (1, 1, 2))
    assert th.equal(before, th.get_rng_state())
    batch = make_batch(action_space)
    np.testing.assert_array_equal(one.score(*batch), same.score(*batch))
    assert not np.array_equal(one.score(*batch), other.score(*batch))


@SPACES
def test_a_state_resumes_training(action_space):
    one, other = (make_icm(action_space, normalize=True, seed=seed) for seed in (0, 1))
    batch = tensors(make_batch(action_space))
    one.observe(batch[0])
    one.update(*batch)
    state = copy.deepcopy(one.state_dict())
    other.load_state_dict(state)
    for icm in (one, other):
        icm.observe(batch[2])
        for _ in range(3):
            icm.update(*batch)
    scores = [icm.score(*make_batch(action_space, seed=1)) for icm in (one, other)]
    np.testing.assert_array_equal(*scores)


def test_a_state_belongs_to_nobody():
    one, other = make_icm(seed=0), make_icm(seed=1)
    batch = tensors(make_batch())
    one.update(*batch)
    state = one.state_dict()
    kept = copy.deepcopy(state)
    other.load_state_dict(state)
    for icm in (one, other):
        icm.update(*batch)
    for part, expected in zip(state["modules"].values(), kept["modules"].values(), strict=True):
        assert th.equal(part, expected)
    for index, expected in kept["optimizer"]["state"].items():
        for name in ("step", "exp_avg", "exp_avg_sq"):
            assert th.equal(state["optimizer"]["state"][index][name], expected[name])


def test_observations_enter_the_statistics_only_if_normalized():
    batch = make_batch()
    for normalize in (True, False):
        icm = make_icm(normalize=normalize)
        before = icm.score(*batch)
        icm.observe(th.full((10, 6), 3.0))
        assert np.array_equal(before, icm.score(*batch)) is not normalize


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("beta", -0.1),
        ("beta", 1.1),
        ("beta", float("nan")),
        ("learning_rate", 0.0),
        ("learning_rate", float("inf")),
        ("n_features", 0),
        ("hidden", 1.5),
    ],
)
def test_errors_name_the_argument(name, value):
    with pytest.raises(ValueError, match=f"`{name}` must be"):
        make_icm(**{name: value})
