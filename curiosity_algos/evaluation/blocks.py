"""Large populations in blocks: what is needed of their trajectories is read, and they are dropped.

Of 10,000 episodes in a maze the trajectories are 3 gigabytes, and what a search learns from is a
tenth of one. Blocks are also faster: their memory is used again, and stays in place.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from curiosity_algos.evaluation.evaluator import Evaluator
from curiosity_algos.evaluation.policies import Float32Array
from curiosity_algos.evaluation.rollouts import Excerpt, MakeReads, Rollouts, concatenate


def play(
    evaluator: Evaluator, parameters: Float32Array, seed: int, make_reads: MakeReads | None
) -> Rollouts:
    """One episode of each policy, in blocks where there are more than the evaluator's `block_size`.

    Excerpts take the place of trajectories then, and are the same as of the whole. An evaluator
    without a `block_size` gets all policies at once.

    Args:
        evaluator: Plays them.
        parameters: (P, n_parameters).
        seed: Of every episode's reset.
        make_reads: Called once, before anything is played, where blocks are; None: trajectories are
            needed whole.
    """
    n = len(parameters)
    block_size = getattr(evaluator, "block_size", None) or n
    if n <= block_size or make_reads is None:
        return evaluator.evaluate(parameters, seed)
    reads = make_reads(n)
    gathered = Gathered(n)
    for begin in range(0, n, block_size):
        block = slice(begin, begin + block_size)
        gathered.put(block, evaluator.evaluate(parameters[block], seed).read(reads, block))
    return gathered.rollouts()


class Gathered:
    """Rollouts of a population that come in parts, in whatever order.

    Excerpts, the most of them, are put in their place at once: joined at the end, they would be
    there twice.

    Args:
        n: Individuals of the population.
    """

    def __init__(self, n: int) -> None:
        self._n = n
        self._parts: dict[int, Rollouts] = {}
        self._excerpts: dict[str, Excerpt] = {}

    def put(self, individuals: slice, part: Rollouts) -> None:
        """Take the rollouts of some individuals."""
        for name, arrays in part.excerpts.items():
            if name not in self._excerpts:
                shapes = [((self._n, *array.shape[1:]), array.dtype) for array in arrays]
                self._excerpts[name] = tuple(np.empty(*each) for each in shapes)
            for whole, array in zip(self._excerpts[name], arrays, strict=True):
                whole[individuals] = array
        self._parts[individuals.start] = replace(part, excerpts={})

    def rollouts(self) -> Rollouts:
        """Of all individuals, in their order."""
        joined = concatenate([self._parts[begin] for begin in sorted(self._parts)])
        return replace(joined, excerpts=self._excerpts)
