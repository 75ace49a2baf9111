"""The gradient of the ICM's losses, compiled: `icm.py` says the losses in torch.

Threads share the chunks of a batch: by torch alone, which takes Python's lock at every operation,
the paper's runs would take nearly twice as long.
"""

from __future__ import annotations

import importlib
import math
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import torch as th
from threadpoolctl import ThreadpoolController

from curiosity_algos.common.arrays import Float32Array, Float64Array
from curiosity_gym.compiled import ThreadPool, compiled, compiled_product

N_ROWS = 128
"""Transitions of a batch that are computed at once: fewer cost more calls, more leave the cache."""


class Layers(NamedTuple):
    """Weights (n_out, n_in) and biases (n_out,) of linear layers; a ReLU lies between two."""

    weights: tuple[Float32Array, ...]
    biases: tuple[Float32Array, ...]

    @classmethod
    def of(cls, network: th.nn.Module) -> Layers | None:
        """Views of the parameters of a network; None: torch alone can compute it.

        So it is if there is another layer, or a parameter that is frozen or not on the CPU.
        """
        modules = list(network) if type(network) is th.nn.Sequential else []
        linear, others = modules[::2], modules[1::2]
        kinds = {type(each) for each in linear}, {type(each) for each in others}
        if kinds[0] != {th.nn.Linear} or not kinds[1] <= {th.nn.ReLU} or len(modules) % 2 == 0:
            return None
        # By their dictionary, as this is asked at every gradient step, and attributes are slower.
        parameters = [each._parameters[name] for name in ("weight", "bias") for each in linear]
        trained = [p for p in parameters if p is not None and p.requires_grad and p.is_cpu]
        if len(trained) < len(parameters):
            return None
        arrays = [each.detach().numpy() for each in trained]
        return cls(tuple(arrays[: len(linear)]), tuple(arrays[len(linear) :]))

    @property
    def n_parameters(self) -> int:
        """The number of weights and biases of all layers."""
        return sum(weights.size + len(weights) for weights in self.weights)


class Pass(NamedTuple):
    """Arrays of the layers for n rows at most: outputs (n, n_out), and the loss' slopes by them."""

    outputs: tuple[Float32Array, ...]
    slopes: tuple[Float32Array, ...]

    @classmethod
    def of(cls, layers: Layers, n: int) -> Pass:
        """Memory for n rows."""
        shapes = [(n, len(biases)) for biases in layers.biases]
        outputs, slopes = ([np.empty(s, dtype=np.float32) for s in shapes] for _ in range(2))
        return cls(tuple(outputs), tuple(slopes))


@compiled_product
def product(one: Float32Array, other: Float32Array, out: Float32Array) -> None:
    """The product of two matrices, by BLAS."""
    np.dot(one, other, out)


@compiled
def forward(layers: Layers, inputs: Float32Array, outputs: tuple[Float32Array, ...]) -> None:
    """`y = W x + b` of each layer and row, ReLU of all but the last."""
    x = inputs
    for k in range(len(outputs)):
        y, biases = outputs[k][: len(inputs)], layers.biases[k]
        product(x, layers.weights[k].T, y)
        lowest = np.float32(-np.inf) if k == len(outputs) - 1 else np.float32(0.0)
        for i in range(y.shape[0]):
            for j in range(y.shape[1]):
                y[i, j] = max(y[i, j] + biases[j], lowest)
        x = y


@compiled
def backward(
    layers: Layers,
    inputs: Float32Array,
    held: Pass,
    by_parameters: Float32Array,
    by_inputs: Float32Array,
) -> None:
    """The loss' slopes by parameters and inputs, from those by the last outputs in `held`.

    `dW = dy' x` and `db`, the sum over dy, go to `by_parameters` in torch's order, and `dx = dy W`
    to `by_inputs`, unless that is (0, n_in), as nobody needs it.
    """
    n, end = len(inputs), len(by_parameters)
    for k in range(len(held.outputs) - 1, -1, -1):
        dy, weights = held.slopes[k][:n], layers.weights[k]
        x = held.outputs[k - 1][:n] if k > 0 else inputs
        dx = held.slopes[k - 1][:n] if k > 0 else by_inputs[:n]
        middle = end - len(weights)
        begin = middle - weights.size
        dw, db = by_parameters[begin:middle].reshape(weights.shape), by_parameters[middle:end]
        end = begin
        product(dy.T, x, dw)
        db[:] = 0.0
        for i in range(dy.shape[0]):
            for j in range(dy.shape[1]):
                db[j] += dy[i, j]
        if len(dx) > 0:
            product(dy, weights, dx)
        if k > 0:
            for i in range(dx.shape[0]):
                for j in range(dx.shape[1]):
                    if x[i, j] <= 0.0:
                        dx[i, j] = 0.0


def set_gradients(networks: Iterable[th.nn.Module], slopes: Float32Array) -> None:
    """Give parameters, network by network in torch's order, their slopes (n_parameters,); views."""
    parameters = [each for network in networks for each in network.parameters()]
    parts = th.split(th.from_numpy(slopes), [each.numel() for each in parameters])
    for parameter, part in zip(parameters, parts, strict=True):
        parameter.grad = part.view_as(parameter)


_ALONE = threading.RLock()
"""Held by the caller that limits BLAS: of two, the second would give back the first one's limit."""


@contextmanager
def single_blas_thread() -> Iterator[None]:
    """Leave the threads to us: a product of matrices runs on the thread that asks for it."""
    with _ALONE, blas_limit():
        yield


def blas_limit() -> Any:
    """A context for each thread in `single_blas_thread`: some libraries set it by thread."""
    return _libraries().limit(limits=1, user_api="blas")


@cache
def _libraries() -> ThreadpoolController:
    importlib.import_module("scipy.linalg.cython_blas")  # products call it: loaded, it is found
    return ThreadpoolController()


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
