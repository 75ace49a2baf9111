"""A policy as an ONNX graph (https://onnx.ai), which runs without Python and this package."""

from __future__ import annotations

import os
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from curiosity_algos.common.arrays import Array, Float32Array
from curiosity_algos.evaluation.flat_spaces import is_vector
from curiosity_algos.evaluation.mlp import Mlp
from curiosity_algos.evaluation.rollouts import check_parameters
from curiosity_algos.experiments.export.policies import population_algorithm
from curiosity_algos.experiments.loading import Run
from curiosity_algos.loops.model_file import load_policy
from curiosity_algos.state.atomic_file import atomic_file
from curiosity_gym.extras import import_extra

# Opset and IR of 2021, so that old runtimes run it, too.
GRAPH = """
<ir_version: 8, opset_import: ["" : 13], producer_name: "curiosity-search">
policy (float[n, {}] observation) => ({} action) {{ {} }}
"""
LINEAR = "linear_{1} = Gemm ({0}, weights_{1}, biases_{1})\n"
RELU = "relu_{1} = Relu ({0})\n"
ARG_MAX = "action = ArgMax <axis = 1, keepdims = 0> ({})"
# Max and Min, as rounding may lead out of the box.
SCALED = """
share = Tanh ({})
scaled = Mul (share, half_range)
moved = Add (scaled, center)
floored = Max (moved, low)
action = Min (floored, high)
"""


def export_onnx(run: str | os.PathLike[str], path: str | os.PathLike[str]) -> None:
    """Write the best policy of a run, the one that `curiosity enjoy` plays, as an ONNX graph.

    `policy_graph` describes input and output.

    Args:
        run: Folder of the run, of a population algorithm.
        path: Path of the file, which ends in .onnx.

    Raises:
        gymnasium.error.DependencyNotInstalled: If the extra `onnx` is not installed.
        FileNotFoundError: If there is no run.
        ValueError: If the run is of another algorithm or damaged, if no graph can give its actions,
            or `path` ends in something else.
    """
    import_extra("onnx", "onnx")
    if Path(path).suffix != ".onnx":
        raise ValueError(f"`out` must end in .onnx, got {os.fspath(path)}.")
    opened = Run(run)
    load = partial(load_policy, cls=population_algorithm(opened), env=None)
    policy, _ = opened.folder.read(lambda checkpoint: load(checkpoint / "model.zip"))
    graph = policy_graph(policy.mlp, policy.vector, policy.action_space)
    with atomic_file(path) as file:
        file.write(graph.SerializeToString())


def _check_actions(space: spaces.Space[Any]) -> None:
    is_continuous = is_vector(space) and np.issubdtype(space.dtype, np.floating)
    if not is_continuous and not (isinstance(space, spaces.Discrete) and space.start == 0):
        raise ValueError(
            "`action_space` must be a Box of one dimension, of floats, or a Discrete from 0, got "
            f"{space}."
        )


def policy_graph(mlp: Mlp, parameters: Float32Array, action_space: spaces.Space[Any]) -> Any:
    """The ONNX model of a policy.

    Its input `observation` is (n, O) float32, for any n: `model.policy.seen.many` makes vectors of
    other observations. Its output `action` is (n, A) float32 in the bounds of the action space, or
    (n,) int64 of `Discrete` actions.

    Args:
        mlp: Shape of the policy: `model.policy.mlp`.
        parameters: (n_parameters,): `model.policy.vector`.
        action_space: A Box of one dimension, of floats, or a Discrete from 0.

    Returns:
        An `onnx.ModelProto`.

    Raises:
        gymnasium.error.DependencyNotInstalled: If the extra `onnx` is not installed.
        ValueError: If the number of parameters is another, they are not finite, or `action_space`
            is another.
    """
    _check_actions(action_space)
    rest = check_parameters(parameters[None], mlp.n_parameters)[0]
    onnx, parser, numpy_helper = import_extra("onnx", "onnx", "onnx.parser", "onnx.numpy_helper")
    sizes, x, nodes = mlp.sizes.tolist(), "observation", ""
    constants: dict[str, Array] = {}
    for i, (n_in, n_out) in enumerate(pairwise(sizes)):
        weights, biases, rest = np.split(rest, [n_in * n_out, (n_in + 1) * n_out])
        constants |= {f"weights_{i}": weights.reshape(n_in, n_out), f"biases_{i}": biases}
        if i > 0:
            nodes += RELU.format(x, i)
            x = f"relu_{i}"
        nodes += LINEAR.format(x, i)
        x = f"linear_{i}"
    if not mlp.is_discrete:
        names = "center", "half_range", "low", "high"
        constants |= {name: getattr(mlp, name) for name in names}
    nodes += (ARG_MAX if mlp.is_discrete else SCALED).format(x)
    action = "int64[n]" if mlp.is_discrete else f"float[n, {sizes[-1]}]"
    model = parser.parse_model(GRAPH.format(sizes[0], action, nodes))
    for name, array in constants.items():
        model.graph.initializer.append(numpy_helper.from_array(np.array(array), name))
    for node in model.graph.node:
        node.name = node.output[0]
    onnx.checker.check_model(model, full_check=True)
    return model
