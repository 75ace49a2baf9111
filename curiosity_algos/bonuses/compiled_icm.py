"""The gradient of the ICM's losses, compiled: `icm.py` says the losses in torch.

Threads share the chunks of a batch: by torch alone, the paper's runs would take nearly twice as
long.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from curiosity_algos.bonuses.perceptron import (
    Layers,
    Pass,
    backward,
    blas_limit,
    forward,
    single_blas_thread,
)
from curiosity_algos.common.arrays import Float32Array, Float64Array
from curiosity_gym.compiled import ThreadPool, compiled

N_ROWS = 128
"""Transitions of a batch that are computed at once: fewer cost more calls, more leave the cache."""


class Networks(NamedTuple):
    """The ICM's three networks."""

    encoder: Layers
    forward_model: Layers
    inverse_model: Layers


class Workspace(NamedTuple):
    """Memory of a thread for n transitions at most, of F features and A numbers of an action."""

    encoder: Pass  # of 2n rows: those of a transition's two states lie side by side
    forward_model: Pass
    inverse_model: Pass
    pairs: Float32Array  # phi(s), phi(s'): (n, 2F), a view of the encoder's outputs
    by_pairs: Float32Array  # a view of the encoder's slopes
    known: Float32Array  # phi(s), a: (n, F + A)
    by_known: Float32Array

    @classmethod
    def of(cls, icm: Networks, n: int) -> Workspace:
        """Memory for n transitions."""
        encoder = Pass.of(icm.encoder, 2 * n)
        models = Pass.of(icm.forward_model, n), Pass.of(icm.inverse_model, n)
        pairs, by_pairs = (each[-1].reshape(n, -1) for each in encoder)
        known, by_known = np.empty((2, n, icm.forward_model.weights[0].shape[1]), dtype=np.float32)
        return cls(encoder, models[0], models[1], pairs, by_pairs, known, by_known)


@compiled
def norms(
    predicted: Float32Array, target: Float32Array, weight: float, slopes: Float32Array
) -> float:
    """The sum of `||y - t||_2` over rows; its slopes by y, 0 where the norm is, times `weight`."""
    total = 0.0
    for i in range(len(target)):
        square = np.float32(0.0)
        for j in range(predicted.shape[1]):
            slopes[i, j] = predicted[i, j] - target[i, j]
            square += slopes[i, j] ** 2
        norm = math.sqrt(square)
        total += norm
        scale = np.float32(weight / norm if norm > 0.0 else 0.0)
        for j in range(predicted.shape[1]):
            slopes[i, j] *= scale
    return total


@compiled
def differentiate_chunk(
    icm: Networks,
    work: Workspace,
    slopes: tuple[Float32Array, Float32Array, Float32Array],
    losses: Float64Array,
    states: Float32Array,
    actions: Float32Array,
    weights: tuple[float, float],
) -> None:
    """The errors of the two models, summed over n transitions, and the slopes of the loss.

    The sums go to `losses`, the slopes by each network's parameters to `slopes`; `weights` are
    those of the two sums in the loss.
    """
    n, n_features = len(actions), work.pairs.shape[1] // 2
    forward(icm.encoder, states, work.encoder.outputs)
    pairs, known = work.pairs[:n], work.known[:n]
    for i in range(n):
        for j in range(n_features):
            known[i, j] = pairs[i, j]
        for j in range(actions.shape[1]):
            known[i, n_features + j] = actions[i, j]
    forward(icm.forward_model, known, work.forward_model.outputs)
    forward(icm.inverse_model, pairs, work.inverse_model.outputs)

    predicted, by_predicted = work.forward_model.outputs[-1], work.forward_model.slopes[-1]
    losses[0] = norms(predicted, pairs[:, n_features:], weights[0], by_predicted)
    losses[1] = norms(
        work.inverse_model.outputs[-1], actions, weights[1], work.inverse_model.slopes[-1]
    )

    backward(icm.inverse_model, pairs, work.inverse_model, slopes[2], work.by_pairs)
    backward(icm.forward_model, known, work.forward_model, slopes[1], work.by_known)
    for i in range(n):
        for j in range(n_features):
            work.by_pairs[i, j] += work.by_known[i, j]
            work.by_pairs[i, n_features + j] -= by_predicted[i, j]
    backward(icm.encoder, states, work.encoder, slopes[0], states[:0])


def differentiate(
    icm: Networks, states: Float32Array, actions: Float32Array, *, beta: float, pool: ThreadPool
) -> tuple[Float64Array, Float32Array]:
    """Mean L_F and L_I, (2,), and the slopes (n_parameters,) of `(1 - beta) L_I + beta L_F`.

    The same bits for any number of threads: chunks of a fixed size, added in their order.

    States are `s_1, s'_1, s_2, s'_2, ...`, standardized, (2n, O), actions encoded, (n, A).

    Raises:
        ValueError: If there are not as many actions as transitions.
    """
    states, actions = np.ascontiguousarray(states), np.ascontiguousarray(actions)
    n = len(actions)
    if len(states) != 2 * n:
        raise ValueError(f"`actions` must be as many as transitions, {len(states) // 2}, got {n}.")
    n_chunks = -(-n // N_ROWS)
    weights = beta / n, (1.0 - beta) / n
    ends = np.cumsum([each.n_parameters for each in icm])
    slopes = np.empty((n_chunks, ends[-1]), dtype=np.float32)
    losses = np.empty((n_chunks, 2))

    def some(begin: int, end: int) -> None:
        work = Workspace.of(icm, min(N_ROWS, n))
        with blas_limit():
            for i in range(begin, end):
                first, last = i * N_ROWS, min((i + 1) * N_ROWS, n)
                rows = states[2 * first : 2 * last], actions[first:last]
                parts = slopes[i, : ends[0]], slopes[i, ends[0] : ends[1]], slopes[i, ends[1] :]
                differentiate_chunk(icm, work, parts, losses[i], *rows, weights)

    with single_blas_thread():
        pool.run(some, n_chunks, pool.n_threads)
    return losses.sum(axis=0) / n, slopes.sum(axis=0)
