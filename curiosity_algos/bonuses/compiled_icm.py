"""The ICM's arithmetic on flat observations and the CPU, compiled: `icm.py` says it in torch."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from curiosity_algos.bonuses.perceptron import (
    Layers,
    Pass,
    backward,
    forward,
    single_blas_thread,
)
from curiosity_gym.compiled import ThreadPool, compiled
from curiosity_gym.core import Float32Array

N_ROWS = 128
"""Transitions of a batch that are computed at once: fewer cost more calls, more leave the cache."""


class Networks(NamedTuple):
    """The ICM's three networks."""

    encoder: Layers
    forward_model: Layers
    inverse_model: Layers


class Held(NamedTuple):
    """What is held for n transitions at most, of F features and A numbers of an action."""

    encoder: Pass  # of 2n rows: those of a transition's two states lie side by side
    forward_model: Pass
    inverse_model: Pass
    pairs: Float32Array  # phi(s), phi(s'): (n, 2F), a view of the encoder's outputs
    by_pairs: Float32Array  # a view of the encoder's slopes
    known: Float32Array  # phi(s), a: (n, F + A)
    by_known: Float32Array

    @classmethod
    def of(cls, icm: Networks, n: int) -> Held:
        """Memory for n transitions."""
        encoder = Pass.of(icm.encoder, 2 * n)
        models = Pass.of(icm.forward_model, n), Pass.of(icm.inverse_model, n)
        pairs, by_pairs = (each[-1].reshape(n, -1) for each in encoder)
        known, by_known = np.empty((2, n, icm.forward_model.weights[0].shape[1]), dtype=np.float32)
        return cls(encoder, models[0], models[1], pairs, by_pairs, known, by_known)


@compiled
def join(features: Float32Array, actions: Float32Array, out: Float32Array) -> None:
    """The rows of both side by side."""
    n_features = features.shape[1]
    for i in range(len(out)):
        for j in range(n_features):
            out[i, j] = features[i, j]
        for j in range(actions.shape[1]):
            out[i, n_features + j] = actions[i, j]


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
def cross_entropies(
    logits: Float32Array, taken: Float32Array, weight: float, slopes: Float32Array
) -> float:
    """The sum of `-log p` of the actions taken, one-hot; its slopes by logits, times `weight`."""
    total = 0.0
    for i in range(len(taken)):
        largest, partition = logits[i, 0], 0.0
        for j in range(logits.shape[1]):
            largest = max(largest, logits[i, j])
        for j in range(logits.shape[1]):
            partition += math.exp(logits[i, j] - largest)
        for j in range(logits.shape[1]):
            log_p = logits[i, j] - largest - math.log(partition)
            slopes[i, j] = weight * (math.exp(log_p) - taken[i, j])
            total -= log_p * taken[i, j]
    return total


@compiled
def differentiate_rows(
    icm: Networks,
    held: Held,
    slopes: tuple[Float32Array, Float32Array, Float32Array],
    losses: npt.NDArray[np.float64],
    states: Float32Array,
    actions: Float32Array,
    weights: tuple[float, float],
    is_discrete: bool,
) -> None:
    """The errors of the two models, summed over n transitions, and the slopes of the loss.

    Args:
        icm: The networks.
        held: Memory for n transitions.
        slopes: Where those by each network's parameters go.
        losses: Where the two sums go.
        states: `s_1, s'_1, s_2, s'_2, ...`, standardized, (2n, O).
        actions: Encoded, (n, A).
        weights: Of the two sums in the loss.
        is_discrete: Whether actions are one-hot.
    """
    n, n_features = len(actions), held.pairs.shape[1] // 2
    forward(icm.encoder, states, held.encoder.outputs)
    pairs, known = held.pairs[:n], held.known[:n]
    join(pairs[:, :n_features], actions, known)
    forward(icm.forward_model, known, held.forward_model.outputs)
    forward(icm.inverse_model, pairs, held.inverse_model.outputs)

    predicted, by_predicted = held.forward_model.outputs[-1], held.forward_model.slopes[-1]
    losses[0] = norms(predicted, pairs[:, n_features:], weights[0], by_predicted)
    action, by_action = held.inverse_model.outputs[-1], held.inverse_model.slopes[-1]
    if is_discrete:
        losses[1] = cross_entropies(action, actions, weights[1], by_action)
    else:
        losses[1] = norms(action, actions, weights[1], by_action)

    backward(icm.inverse_model, pairs, held.inverse_model, slopes[2], held.by_pairs)
    backward(icm.forward_model, known, held.forward_model, slopes[1], held.by_known)
    for i in range(n):
        for j in range(n_features):
            held.by_pairs[i, j] += held.by_known[i, j]
            held.by_pairs[i, n_features + j] -= by_predicted[i, j]
    backward(icm.encoder, states, held.encoder, slopes[0], states[:0])


def differentiate(
    icm: Networks,
    states: Float32Array,
    actions: Float32Array,
    *,
    beta: float,
    is_discrete: bool,
    pool: ThreadPool,
) -> tuple[npt.NDArray[np.float64], Float32Array]:
    """Mean L_F and L_I, (2,), and the slopes (n_parameters,) of `(1 - beta) L_I + beta L_F`.

    The same bits for any number of threads: chunks of a fixed size, added in their order.

    Args:
        icm: The networks.
        states: `s_1, s'_1, s_2, s'_2, ...`, standardized, (2n, O).
        actions: Encoded, (n, A).
        beta: Weight of L_F.
        is_discrete: Whether actions are one-hot.
        pool: Threads.
    """
    states, actions = _checked(states, actions, stride=2)
    n = len(actions)
    n_chunks = -(-n // N_ROWS)
    weights = beta / n, (1.0 - beta) / n
    ends = np.cumsum([each.n_parameters for each in icm])
    slopes = np.empty((n_chunks, ends[-1]), dtype=np.float32)
    losses = np.empty((n_chunks, 2))

    def some(begin: int, end: int) -> None:
        held = Held.of(icm, min(N_ROWS, n))
        with single_blas_thread():
            for i in range(begin, end):
                first, last = i * N_ROWS, min((i + 1) * N_ROWS, n)
                rows = states[2 * first : 2 * last], actions[first:last]
                parts = slopes[i, : ends[0]], slopes[i, ends[0] : ends[1]], slopes[i, ends[1] :]
                differentiate_rows(icm, held, parts, losses[i], *rows, weights, is_discrete)

    with single_blas_thread():
        pool.run(some, n_chunks, pool.n_threads)
    return losses.sum(axis=0) / n, slopes.sum(axis=0)


@compiled
def write_errors(
    icm: Networks,
    held: Held,
    states: Float32Array,
    actions: Float32Array,
    stride: int,
    errors: Float32Array,
) -> None:
    """Write the errors (n,) of n transitions, N_ROWS at once; `held` has room for so many."""
    features, predicted = held.encoder.outputs[-1], held.forward_model.outputs[-1]
    for first in range(0, len(actions), N_ROWS):
        n = min(N_ROWS, len(actions) - first)
        begin = first * stride
        forward(icm.encoder, states[begin : begin + (n - 1) * stride + 2], held.encoder.outputs)
        join(features[: n * stride : stride], actions[first : first + n], held.known[:n])
        forward(icm.forward_model, held.known[:n], held.forward_model.outputs)
        for i in range(n):
            square = np.float32(0.0)
            for j in range(features.shape[1]):
                square += (predicted[i, j] - features[i * stride + 1, j]) ** 2
            errors[first + i] = math.sqrt(square)


def prediction_errors(
    icm: Networks, states: Float32Array, actions: Float32Array, stride: int
) -> Float32Array:
    """`||F(phi(s), a) - phi(s')||_2` of n transitions, (n,).

    Args:
        icm: The networks.
        states: Standardized; a transition leads from one to the next, (n + 1, O), or (2n, O).
        actions: Encoded, (n, A).
        stride: States from a transition's first to that of the next: 1, or 2.
    """
    states, actions = _checked(states, actions, stride)
    errors = np.empty(len(actions), dtype=np.float32)
    with single_blas_thread():
        write_errors(icm, Held.of(icm, N_ROWS), states, actions, stride, errors)
    return errors


def _checked(
    states: Float32Array, actions: Float32Array, stride: int
) -> tuple[Float32Array, Float32Array]:
    """Both in C order, as they are compiled for.

    Raises:
        ValueError: If there are not as many actions as transitions.
    """
    n_transitions = len(states) // 2 if stride == 2 else max(len(states) - 1, 0)
    if len(actions) != n_transitions:
        raise ValueError(
            f"`actions` must be as many as transitions, {n_transitions}, got {len(actions)}."
        )
    return np.ascontiguousarray(states), np.ascontiguousarray(actions)
