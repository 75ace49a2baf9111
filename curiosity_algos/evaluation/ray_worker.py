"""What a process of Ray does: it plays shards of a generation with an evaluator that it keeps."""

from __future__ import annotations

import os
import pickle
import platform
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.rollouts import Rollouts

N_KEPT = 4
"""Evaluators that a process keeps: it may work for several searches."""


@dataclass(frozen=True)
class Generation:
    """What the shards of a population share; `make_evaluator` and `summarizers` are pickled.

    What Ray unpickles itself cannot be written to.
    """

    make_evaluator: bytes
    parameters: Float32Array
    seed: int | None
    summarizers: bytes | None


def play_shard(generation: Generation, shard: slice) -> tuple[str, Rollouts]:
    """The name of this process, and the rollouts of some policies.

    They hold what the summarizers read of the trajectories, or without summarizers all of these.
    """
    evaluator = _evaluator(generation.make_evaluator)
    parameters = np.array(generation.parameters[shard])
    summarizers = None if generation.summarizers is None else pickle.loads(generation.summarizers)
    rollouts = evaluator.play(parameters, generation.seed, summarizers, shard.start)
    if summarizers is not None:
        rollouts = replace(rollouts, observations=None, actions=None)
    return f"{platform.node()} {os.getpid()}", rollouts


@lru_cache(N_KEPT)
def _evaluator(packed: bytes) -> Evaluator:
    try:
        evaluator: Evaluator = pickle.loads(packed)()
    except Exception as error:  # of any kind: environments say what they like
        raise RuntimeError(f"A worker could not make its environment: {error}") from error
    return evaluator
