"""Outputs and gradients of multilayer perceptrons, compiled, so that a batch can be cut on threads.

Torch's own take Python's lock at every operation, which leaves threads little to do side by side.
"""

from __future__ import annotations

import importlib
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch as th
from threadpoolctl import ThreadpoolController

from curiosity_gym.compiled import compiled, compiled_product

Float32Array = npt.NDArray[np.float32]


def is_perceptron(network: th.nn.Module) -> bool:
    """Whether it is linear layers with a ReLU between two, as `mlp` makes them."""
    kinds = [type(each) for each in network.children()]
    n_linear = len(kinds) // 2 + 1
    return kinds == ([th.nn.Linear, th.nn.ReLU] * n_linear)[:-1]


class Layers(NamedTuple):
    """Weights (n_out, n_in) and biases (n_out,) of linear layers; a ReLU lies between two."""

    weights: tuple[Float32Array, ...]
    biases: tuple[Float32Array, ...]

    @classmethod
    def of(cls, network: th.nn.Module) -> Layers:
        """Those of an `mlp`; views of its parameters."""
        linear = [each for each in network.modules() if isinstance(each, th.nn.Linear)]
        return cls(
            tuple(each.weight.detach().numpy() for each in linear),
            tuple(each.bias.detach().numpy() for each in linear),
        )

    @property
    def n_parameters(self) -> int:
        """Of all layers."""
        return sum(weights.size + len(weights) for weights in self.weights)


class Pass(NamedTuple):
    """What the layers hold for n rows at most: outputs (n, n_out), and the loss' slopes by them."""

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
    """The loss' slopes by parameters and inputs, from those by the last outputs.

    Args:
        layers: The network.
        inputs: As `forward` had them, (n, n_in).
        held: What `forward` gave, and the slopes by the last outputs; those before are written.
        by_parameters: Where `dW = dy' x` and `db`, the sum over dy, go: (n_parameters,), in torch's
            order.
        by_inputs: Where `dx = dy W` goes, (n, n_in), or (0, n_in) where nobody needs it.
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


def set_gradients(optimizer: th.optim.Optimizer, slopes: Float32Array) -> None:
    """Give an optimizer the slopes by its parameters, (n_parameters,) in their order; views."""
    begin, flat = 0, th.from_numpy(slopes)
    for parameter in optimizer.param_groups[0]["params"]:
        end = begin + parameter.numel()
        parameter.grad = flat[begin:end].view_as(parameter)
        begin = end


@contextmanager
def single_blas_thread() -> Iterator[None]:
    """Leave the threads to us: a product of matrices runs on the thread that asks for it.

    It may be entered again, by other threads too: the last to leave gives the setting back.
    """
    with _LOCK:
        _ENTERED.append(_libraries().limit(limits=1, user_api="blas") if not _ENTERED else None)
    try:
        yield
    finally:
        with _LOCK:
            if len(_ENTERED) == 1:
                _ENTERED[0].restore_original_limits()
            _ENTERED.pop()


_LOCK = threading.Lock()
_ENTERED: list[Any] = []


@cache
def _libraries() -> ThreadpoolController:
    importlib.import_module("scipy.linalg.cython_blas")  # products call it: loaded, it is found
    return ThreadpoolController()
