"""Large populations in blocks: what is needed of their trajectories is read, and they are dropped.

Of 10,000 episodes in a maze the trajectories are 3 gigabytes, and what a search learns from is a
tenth of one. Blocks are also faster: their memory is used again, and stays in place.
"""

from __future__ import annotations

from collections.abc import Mapping

from curiosity_algos.evaluation.evaluator import Evaluator
from curiosity_algos.evaluation.policies import Float32Array
from curiosity_algos.evaluation.rollouts import (
    MakeSummarizers,
    Rollouts,
    Summarizer,
    concatenate,
)


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
    parts = []
    for begin in range(0, n, size):
        rollouts = evaluator.evaluate(parameters[begin : begin + size], seed)
        block = slice(first + begin, first + min(begin + size, n))
        parts.append(rollouts.summarize(summarizers, block))
    return concatenate(parts)


def _block_size(evaluator: Evaluator, n: int) -> int:
    size: int = getattr(evaluator, "block_size", None) or n
    return size
