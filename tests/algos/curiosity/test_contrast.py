"""The contrastive loss, against SciPy's distances and autograd's gradients."""

import numpy as np
import pytest
import torch as th
from scipy.spatial.distance import cdist
from scipy.special import log_softmax
from torch.nn import functional

from curiosity_algos.curiosity.contrast import InfoNCE, distances


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


def test_the_loss_is_that_of_telling_pairs_apart():
    features, next_features = make_features()
    logits = -cdist(features.detach(), next_features.detach())
    ahead, back = (-np.diag(log_softmax(logits, axis=axis)).mean() for axis in (1, 0))
    loss = InfoNCE.apply(features, next_features)
    assert loss.item() == pytest.approx((ahead + back) / 2)


def test_the_gradient_is_that_of_differences():
    assert th.autograd.gradcheck(InfoNCE.apply, make_features())


@pytest.mark.parametrize("scale", [1e-2, 1.0, 300.0])  # logits of some hundreds, too
def test_the_gradient_is_autograds(scale):
    features = make_features(n=64, n_features=32, dtype=th.float32)

    def gradients(loss):
        scaled = [scale * each for each in features]
        return th.autograd.grad(3.0 * loss(*scaled), features)

    for found, expected in zip(gradients(InfoNCE.apply), gradients(by_autograd), strict=True):
        assert th.isfinite(found).all()
        close = 1e-4 * expected.abs().max().item()
        np.testing.assert_allclose(found, expected, rtol=1e-3, atol=close)
