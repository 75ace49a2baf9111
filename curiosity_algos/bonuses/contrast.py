"""InfoNCE over distances: how well features tell which state follows which.

van den Oord et al. 2018, "Representation Learning with Contrastive Predictive Coding"
(https://arxiv.org/abs/1807.03748), equation 4, with negative distances as logits.
"""

from __future__ import annotations

from typing import Any

import torch as th
from torch.autograd.function import once_differentiable


def distances(one: th.Tensor, other: th.Tensor) -> th.Tensor:
    """Euclidean distances (n, m) of rows (n, F) from rows (m, F), .001 at least.

    By one matrix product, which is many times faster than `torch.cdist`.
    """
    products = th.addmm(other.square().sum(dim=1), one, other.T, alpha=-2.0)
    squares = products.add_(one.square().sum(dim=1, keepdim=True))
    return squares.clamp_min_(1e-6).sqrt_()


class InfoNCE(th.autograd.Function):
    """The mean loss of telling, of n pairs of features, the second from the first and back.

    `-log p_ii / 2 - log q_ii / 2`, averaged over i, where p is the softmax of the negative
    distances d over each row, and q over each column. It pulls pairs together that are nearer than
    .001, too. Its slopes are written out, which takes two thirds of autograd's time.
    """

    @staticmethod
    def forward(ctx: Any, features: th.Tensor, next_features: th.Tensor) -> th.Tensor:
        """The loss, of features (n, F) and those that follow them (n, F)."""
        d = distances(features, next_features)
        logits = -d
        p, q = th.softmax(logits, dim=1), th.softmax(logits, dim=0)
        # Logarithms of the sums that p and q are shares of; a share of a pair may be 0 in float32.
        rows = logits.amax(dim=1) - p.amax(dim=1).log()
        columns = logits.amax(dim=0) - q.amax(dim=0).log()
        n = len(d)
        # Of the loss by each distance: 1/n for those of pairs, less (p + q) / 2n.
        by_distance = p.add_(q).div_(-2.0 * n)
        by_distance.diagonal().add_(1.0 / n)
        # Of each feature f_i the sum over g_j of `w_ij (f_i - g_j)`, w being dL/dd over d.
        w = by_distance.div_(d)
        ahead = w.sum(dim=1, keepdim=True) * features - w @ next_features
        back = w.sum(dim=0).unsqueeze(1) * next_features - w.T @ features
        ctx.save_for_backward(ahead, back)
        return (d.diagonal() + (rows + columns) / 2.0).mean()

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, loss: th.Tensor) -> tuple[th.Tensor, th.Tensor]:
        """Its slopes by both."""
        by_features, by_next_features = ctx.saved_tensors
        return loss * by_features, loss * by_next_features
