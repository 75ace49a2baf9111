"""A multilayer perceptron as one flat parameter vector, evaluated by one compiled function.

The layout of the vector: for each layer its weights (inputs, outputs) row by row, then its biases.
Hidden layers are ReLU. For a `Box` of actions the output is `tanh` scaled to the box; for others it
is a score for each choice, of which the policy takes the largest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from curiosity_algos.common.arrays import Array, Float32Array, Float64Array
from curiosity_algos.evaluation.flat_spaces import (
    MAX_ENTRIES,
    FlatActions,
    FlatObservations,
    is_vector,
)
from curiosity_gym.compiled import compiled
from curiosity_gym.validation import check_at_least_one

DEFAULT_NET_ARCH = (32, 16)
"""Hidden layers of the paper-sized policy: 36-32-16-2 has 1,746 parameters."""

_ZERO, _ONE, _TWO, _FOUR = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.uint64(4)


class Mlp(NamedTuple):
    """Shape and output range of a policy, as the compiled functions take it.

    Attributes:
        sizes: (n_layers + 1,), widths from the observation to the output.
        center, half_range, low, high: (n_outputs,), of the action box.
        is_discrete: Whether outputs are scores of choices, not actions in the box.
    """

    sizes: npt.NDArray[np.uint64]
    center: Float32Array
    half_range: Float32Array
    low: Float32Array
    high: Float32Array
    is_discrete: bool

    @property
    def n_parameters(self) -> int:
        """Length of the flat vector."""
        inputs, outputs = self.sizes[:-1], self.sizes[1:]
        return int(np.sum((inputs + 1) * outputs))


def build_mlp(
    observation_space: spaces.Space[Any],
    action_space: spaces.Space[Any],
    net_arch: Sequence[int] = DEFAULT_NET_ARCH,
) -> Mlp:
    """The network that maps `observation_space` to `action_space`.

    Raises:
        ValueError: If a space is not supported or has no bounds, or a width is out of range.
    """
    for width in net_arch:
        check_at_least_one(net_arch=width)
    n_inputs = FlatObservations(observation_space).size
    if n_inputs > MAX_ENTRIES and not is_vector(observation_space):
        raise ValueError(
            f"The observation space {observation_space} is not supported: it must have at most "
            f"{MAX_ENTRIES} entries, it has {n_inputs} (gymnasium.wrappers.ResizeObservation makes "
            "images smaller)."
        )
    low, high, is_discrete = _output_range(action_space)
    return Mlp(
        np.array([n_inputs, *net_arch, low.size], dtype=np.uint64),
        center=((high + low) / 2.0).astype(np.float32),
        half_range=((high - low) / 2.0).astype(np.float32),
        low=low.astype(np.float32),
        high=high.astype(np.float32),
        is_discrete=is_discrete,
    )


def _output_range(action_space: spaces.Space[Any]) -> tuple[Float64Array, Float64Array, bool]:
    FlatActions(action_space)  # raises where there is no such output
    if not isinstance(action_space, spaces.Box):
        n = spaces.flatdim(action_space)
        return np.zeros(n), np.ones(n), True
    if not (action_space.is_bounded() and np.issubdtype(action_space.dtype, np.number)):
        raise ValueError(
            f"The action space {action_space} is not supported: a Box must be bounded, of numbers "
            "(gymnasium.wrappers.TransformAction can give it bounds)."
        )
    low, high = action_space.low.ravel(), action_space.high.ravel()
    return low.astype(np.float64), high.astype(np.float64), False


@compiled
def _tanh(x: np.float32) -> np.float32:
    return _ONE - _TWO / (math.exp(_TWO * x) + _ONE)


@compiled
def _affine(
    parameters: Float32Array,
    offset: np.uint64,
    n_in: np.uint64,
    n_out: np.uint64,
    source: Float32Array,
    target: Float32Array,
    is_first: bool,
) -> None:
    """One layer: target = relu(source) @ weights + biases; the first layer's source goes in as is.

    Indices are unsigned and nothing is sliced: negative indices and views cost more than the sums.
    """
    biases = offset + n_in * n_out
    for j in range(n_out):
        target[j] = parameters[biases + j]
    floor = -np.float32(np.inf) if is_first else _ZERO
    n_fours = n_in - n_in % _FOUR
    for i in range(np.uint64(0), n_fours, _FOUR):
        a, b = max(source[i], floor), max(source[i + np.uint64(1)], floor)
        c, d = max(source[i + np.uint64(2)], floor), max(source[i + np.uint64(3)], floor)
        row_a = offset + i * n_out
        row_b, row_c, row_d = row_a + n_out, row_a + n_out + n_out, row_a + n_out + n_out + n_out
        # Four inputs a pass spare trips to memory.
        for j in range(n_out):
            target[j] += (a * parameters[row_a + j] + b * parameters[row_b + j]) + (
                c * parameters[row_c + j] + d * parameters[row_d + j]
            )
    for i in range(n_fours, n_in):
        a = max(source[i], floor)
        row_a = offset + i * n_out
        for j in range(n_out):
            target[j] += a * parameters[row_a + j]


@compiled
def forward(
    mlp: Mlp,
    parameters: Float32Array,
    observation: Float32Array,
    memory: Float32Array,
    output: Float32Array,
) -> None:
    """One forward pass of (n_parameters,) on (n_inputs,), with `scratch` as memory.

    It overwrites `output`, (n_outputs,): actions scaled to the box, or a score for each choice.
    """
    last = mlp.sizes.shape[0] - 2
    offset = np.uint64(0)
    source = observation
    for layer in range(last + 1):
        n_in, n_out = mlp.sizes[layer], mlp.sizes[layer + 1]
        target = output if layer == last else memory[layer % 2]
        _affine(parameters, offset, n_in, n_out, source, target, layer == 0)
        source = target
        offset += (n_in + np.uint64(1)) * n_out
    if not mlp.is_discrete:
        for j in range(output.shape[0]):
            action = mlp.center[j] + mlp.half_range[j] * _tanh(output[j])
            # Rounding may leave the box; SB3's `predict` clips, and both must agree. NaN, of
            # parameters that overflowed, becomes the lower bound: no environment takes it.
            if not action >= mlp.low[j]:
                action = mlp.low[j]
            output[j] = min(action, mlp.high[j])


def scratch(mlp: Mlp, n: int) -> Float32Array:
    """The memory of `forward` for each of n callers, (n, 2, widest layer)."""
    return np.empty((n, 2, int(mlp.sizes.max())), dtype=np.float32)


@compiled
def forward_each(
    mlp: Mlp,
    parameters: Float32Array,
    observations: Float32Array,
    memory: Float32Array,
    outputs: Float32Array,
) -> None:
    """Each policy on its own observation, as `forward`; parameters (1, n_parameters) serve all."""
    last = parameters.shape[0] - 1
    for i in range(observations.shape[0]):
        forward(mlp, parameters[min(i, last)], observations[i], memory, outputs[i])


def act(mlp: Mlp, parameters: Float32Array, observations: Array) -> Float32Array:
    """What policies make of observations (n, n_inputs): (n, n_outputs), see `forward`."""
    outputs = np.empty((observations.shape[0], mlp.center.size), dtype=np.float32)
    observations = np.ascontiguousarray(observations, dtype=np.float32)
    forward_each(mlp, parameters, observations, scratch(mlp, 1)[0], outputs)
    return outputs
