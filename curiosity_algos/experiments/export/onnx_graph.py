"""A policy as an ONNX graph (https://onnx.ai), which runs without Python and this package."""

from __future__ import annotations

import os
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from curiosity_algos.checkpoints.atomic_file import atomic_file
from curiosity_algos.common.arrays import Array, Float32Array
from curiosity_algos.evaluation.flat_spaces import is_vector
from curiosity_algos.evaluation.policies import Mlp
from curiosity_algos.evaluation.rollouts import check_parameters
from curiosity_algos.experiments.export.population_run import PopulationRun
from curiosity_gym.extras import import_extra

OPSET, IR = 13, 8
"""Of 2021, so that old runtimes run it, too."""


def export_onnx(
    run: str | os.PathLike[str], path: str | os.PathLike[str], *, trust: bool = False
) -> None:
    """Write the best policy of a run, the one that `curiosity enjoy` plays, as an ONNX graph.

    See `policy_graph` for what goes in and comes out.

    Args:
        run: Folder of the run, of a population algorithm.
        path: Place of the file, which ends in .onnx.
        trust: Also run code that the run's folder names.

    Raises:
        gymnasium.error.DependencyNotInstalled: If the extra `onnx` is not installed.
        FileNotFoundError: If there is no run.
        ValueError: If the run is of another algorithm, is damaged or needs trust, or its actions
            are other ones; if `path` ends in something else.
    """
    import_extra("onnx", "onnx")
    if Path(path).suffix != ".onnx":
        raise ValueError(f"`out` must end in .onnx, got {os.fspath(path)}.")
    opened = PopulationRun(Path(run), trust=trust)
    with closing(opened.env) as env:
        graph = policy_graph(opened.mlp, opened.best(), env.action_space)
    with atomic_file(path) as file:
        file.write(graph.SerializeToString())


def _check_actions(space: spaces.Space[Any]) -> None:
    is_plain = is_vector(space) and np.issubdtype(space.dtype, np.floating)
    if not is_plain and not (isinstance(space, spaces.Discrete) and space.start == 0):
        raise ValueError(
            "`action_space` must be a Box of one dimension, of floats, or a Discrete from 0, got "
            f"{space}."
        )


def policy_graph(mlp: Mlp, parameters: Float32Array, action_space: spaces.Space[Any]) -> Any:
    """The ONNX model of a policy.

    Its input `observation` is (n, O) float32, for any n, vectors as `gymnasium.spaces.flatten`
    makes them of observations that are none. Its output `action` is (n, A) float32 in
    the bounds of the action space, or (n,) int64 of `Discrete` actions.

    Args:
        mlp: The policy's shape: `model.policy.mlp`.
        parameters: (n_parameters,): `model.policy.vector`.
        action_space: A Box of one dimension, of floats, or a Discrete from 0.

    Returns:
        An `onnx.ModelProto`.

    Raises:
        gymnasium.error.DependencyNotInstalled: If the extra `onnx` is not installed.
        ValueError: If the parameters are not as many, or not finite, or actions are other ones.
    """
    _check_actions(action_space)
    parameters = check_parameters(parameters[None], mlp.n_parameters)[0]
    onnx, helper = import_extra("onnx", "onnx", "onnx.helper")
    graph = _Graph(onnx)
    output = _layers(graph, mlp, parameters)
    _decision(graph, mlp, output)
    float32, int64 = onnx.TensorProto.FLOAT, onnx.TensorProto.INT64
    n_in, n_out = int(mlp.sizes[0]), int(mlp.sizes[-1])
    action = (int64, ["n"]) if mlp.is_discrete else (float32, ["n", n_out])
    made = helper.make_graph(
        graph.nodes,
        "policy",
        [helper.make_tensor_value_info("observation", float32, ["n", n_in])],
        [helper.make_tensor_value_info("action", *action)],
        graph.constants,
    )
    opset = helper.make_opsetid("", OPSET)
    model = helper.make_model(
        made, opset_imports=[opset], ir_version=IR, producer_name="curiosity-search"
    )
    onnx.checker.check_model(model, full_check=True)
    return model


class _Graph:
    """Nodes and constants that are added one after another."""

    def __init__(self, onnx: Any) -> None:
        self._onnx = onnx
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def add(self, operator: str, *inputs: str, name: str, **attributes: Any) -> str:
        """The name of a node's output."""
        node = self._onnx.helper.make_node(operator, inputs, [name], name=name, **attributes)
        self.nodes.append(node)
        return name

    def constant(self, name: str, values: Array) -> str:
        """The name of an array."""
        self.constants.append(self._onnx.numpy_helper.from_array(np.array(values), name))
        return name


def _layers(graph: _Graph, mlp: Mlp, parameters: Float32Array) -> str:
    """The linear layers with ReLU between them; the name of what the last gives."""
    x, begin = "observation", 0
    sizes = mlp.sizes.tolist()
    for i, (n_in, n_out) in enumerate(pairwise(sizes)):
        end = begin + n_in * n_out
        weights = graph.constant(f"weights_{i}", parameters[begin:end].reshape(n_in, n_out))
        biases = graph.constant(f"biases_{i}", parameters[end : end + n_out])
        x = x if i == 0 else graph.add("Relu", x, name=f"relu_{i}")
        x = graph.add("Gemm", x, weights, biases, name=f"linear_{i}")
        begin = end + n_out
    return x


def _decision(graph: _Graph, mlp: Mlp, output: str) -> None:
    """The largest output, or tanh scaled to the box."""
    if mlp.is_discrete:
        graph.add("ArgMax", output, name="action", axis=1, keepdims=0)
        return
    names = ("center", "half_range", "low", "high")
    center, half_range, low, high = (graph.constant(each, getattr(mlp, each)) for each in names)
    share = graph.add("Tanh", output, name="tanh")
    moved = graph.add("Mul", share, half_range, name="scaled")
    moved = graph.add("Add", moved, center, name="moved")
    # Rounding may leave the box.
    floored = graph.add("Max", moved, low, name="floored")
    graph.add("Min", floored, high, name="action")
