"""Outputs and gradients of multilayer perceptrons, compiled, so that a batch can be cut on threads.

Torch's own take Python's lock at every operation, which leaves threads little to do side by side.
"""

from __future__ import annotations

import importlib
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import torch as th
from threadpoolctl import ThreadpoolController

from curiosity_algos.common.arrays import Float32Array
from curiosity_gym.compiled import compiled, compiled_product


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
