"""The contrastive loss, against SciPy's distances and autograd's gradients."""

import numpy as np
import pytest
import torch as th
from scipy.spatial.distance import cdist
from torch.nn import functional

from curiosity_algos.bonuses.contrast import InfoNCE, distances


def make_features(n=7, n_features=3, dtype=th.float64):
    generator = th.Generator().manual_seed(0)
    both = th.randn(2, n, n_features, generator=generator, dtype=dtype)
    return [each.requires_grad_() for each in both]


def by_autograd(features, next_features):
    logits = -th.cdist(features, next_features)
    pairs = th.arange(len(logits))
    ahead, back = (functional.cross_entropy(each, pairs) for each in (logits, logits.T))
    return (ahead + back) / 2


def test_distances_are_scipys():
    one, other = (each.detach() for each in make_features())
    np.testing.assert_allclose(distances(one, other), cdist(one, other))
    assert distances(one[:1], one[:1]).item() == pytest.approx(1e-3)


def test_the_gradient_is_that_of_differences():
    assert th.autograd.gradcheck(InfoNCE.apply, make_features())


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
