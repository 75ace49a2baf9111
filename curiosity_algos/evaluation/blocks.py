"""Large populations in blocks: what is needed of their trajectories is read, and they are dropped.

Of 10,000 episodes in a maze the trajectories are 3 gigabytes, and what a search learns from is a
tenth of one. Blocks are also faster: their memory is used again, and stays in place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.evaluation.rollouts import (
    MakeSummarizers,
    Rollouts,
    Summarizer,
    Summary,
    concatenate,
)

if TYPE_CHECKING:
    from curiosity_algos.evaluation.evaluator import Evaluator


def play(
    evaluator: Evaluator,
    parameters: Float32Array,
    seed: int,
    make_summarizers: MakeSummarizers | None,
) -> Rollouts:
    """One episode of each policy, in blocks where there are more than the evaluator's `block_size`.

    Summaries take the place of trajectories then, and are the same as of the whole. An evaluator
    without a `block_size` gets all policies (P, n_parameters) at once, and so does any where
    `make_summarizers` is None, as trajectories are needed whole.
    """
    n = len(parameters)
    if make_summarizers is None:
        return evaluator.evaluate(parameters, seed)
    if hasattr(evaluator, "evaluate_and_summarize"):  # a `RayEvaluator`, whose workers do it
        rollouts: Rollouts = evaluator.evaluate_and_summarize(parameters, seed, make_summarizers(n))
        return rollouts
    if n <= _block_size(evaluator, n):
        return evaluator.evaluate(parameters, seed)
    return summarize_in_blocks(evaluator, parameters, seed, make_summarizers(n))


def summarize_in_blocks(
    evaluator: Evaluator,
    parameters: Float32Array,
    seed: int | None,
    summarizers: Mapping[str, Summarizer],
    first: int = 0,
) -> Rollouts:
    """Play policies in blocks, and read what is needed of the trajectories of each.

    The policies (P, n_parameters) are those of a population from its `first` on.
    """
    n = len(parameters)
    size = _block_size(evaluator, n)
    parts = RolloutParts(n)
    for begin in range(0, n, size):
        block = slice(begin, min(begin + size, n))
        rollouts = evaluator.evaluate(parameters[block], seed)
        parts.put(block, rollouts.summarize(summarizers, slice(first + begin, first + block.stop)))
    return parts.rollouts()


def _block_size(evaluator: Evaluator, n: int) -> int:
    size: int = getattr(evaluator, "block_size", None) or n
    return size


class RolloutParts:
    """Rollouts of n individuals that come in parts, in whatever order.

    Summaries, the most of them, are put in their place at once: joined at the end, they would be
    there twice.
    """

    def __init__(self, n: int) -> None:
        self._n = n
        self._parts: dict[int, Rollouts] = {}
        self._summaries: dict[str, Summary] = {}

    def put(self, individuals: slice, part: Rollouts) -> None:
        """Take the rollouts of some individuals."""
        for name, arrays in part.summaries.items():
            if name not in self._summaries:
                shapes = [((self._n, *array.shape[1:]), array.dtype) for array in arrays]
                self._summaries[name] = tuple(np.empty(*each) for each in shapes)
            for whole, array in zip(self._summaries[name], arrays, strict=True):
                whole[individuals] = array
        self._parts[individuals.start] = replace(part, summaries={})

    def rollouts(self) -> Rollouts:
        """The rollouts of all individuals, in their order."""
        joined = concatenate([self._parts[begin] for begin in sorted(self._parts)])
        return replace(joined, summaries=self._summaries)
