import copy

import numpy as np
import pytest
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.icm import ICM

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


def numpy_errors(numpy_network, icm, observations, actions, next_observations):
    """Forward and inverse error of each transition, by the definition."""
    standardize = lambda x: x  # noqa: E731
    if hasattr(icm.normalizer, "mean"):
        mean, variance = icm.normalizer.mean.numpy(), icm.normalizer.variance.numpy()
        standardize = lambda x: np.clip((x - mean) / np.sqrt(variance), -5, 5)  # noqa: E731
    features = numpy_network(icm.encoder, standardize(observations))
    next_features = numpy_network(icm.encoder, standardize(next_observations))
    encoded = np.eye(3)[actions] if icm.encode_actions.is_discrete else actions
    forward = numpy_network(icm.forward_model, np.concatenate([features, encoded], axis=1))
    inverse = numpy_network(icm.inverse_model, np.concatenate([features, next_features], axis=1))
    if icm.encode_actions.is_discrete:
        chosen = inverse[np.arange(len(actions)), actions]
        inverse_error = np.log(np.exp(inverse).sum(axis=1)) - chosen
    else:
        inverse_error = np.sqrt(np.square(inverse - actions).sum(axis=1))
    return np.sqrt(np.square(forward - next_features).sum(axis=1)), inverse_error


@SPACES
@pytest.mark.parametrize("normalize", [True, False])
def test_curiosity_and_losses_equal_numpy(numpy_network, action_space, normalize):
    icm, batch = make_icm(action_space, normalize=normalize), make_batch(action_space)
    icm.observe(th.from_numpy(3 + 2 * batch[0]))
    forward, inverse = numpy_errors(numpy_network, icm, *batch)
    np.testing.assert_allclose(icm.score(*batch), forward, rtol=1e-4, atol=1e-5)
    losses = {name: loss.item() for name, loss in icm.losses(*tensors(batch)).items()}
    assert losses["forward_loss"] == pytest.approx(forward.mean(), rel=1e-4)
    assert losses["inverse_loss"] == pytest.approx(inverse.mean(), rel=1e-4)
    assert losses["loss"] == pytest.approx(0.8 * inverse.mean() + 0.2 * forward.mean(), rel=1e-4)


@SPACES
@pytest.mark.parametrize("beta", [0.2, 1.0])
def test_an_update_is_a_step_of_adam_on_the_weighted_loss(action_space, beta):
    icm = make_icm(action_space, beta=beta, learning_rate=1e-2)
    twin, batch = copy.deepcopy(icm), tensors(make_batch(action_space))
    optimizer = th.optim.Adam(twin.parameters(), lr=1e-2)
    for _ in range(3):
        losses = twin.losses(*batch)
        loss = (1 - beta) * losses["inverse_loss"] + beta * losses["forward_loss"]
        metrics = icm.update(*batch)
        assert metrics == pytest.approx(
            {
                "loss": loss.item(),
                "forward_loss": losses["forward_loss"].item(),
                "inverse_loss": losses["inverse_loss"].item(),
            },
            rel=1e-4,
        )
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    for parameter, expected in zip(icm.parameters(), twin.parameters(), strict=True):
        np.testing.assert_allclose(parameter.detach(), expected.detach(), atol=1e-5)
