"""The base of evaluators. They play populations, and play large ones in blocks.

The trajectories of 10,000 episodes in a maze take 3 gigabytes; what a search reads of them takes a
tenth of one. Blocks are also faster: they use the same memory again.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace

from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.evaluation.rollouts import (
    Rollouts,
    Summarizer,
    concatenate,
)
from curiosity_algos.evaluation.tasks import KnownTask


class Evaluator(ABC):
    """Plays one episode with each policy of a population.

    Attributes:
        n_parameters: Length of a policy's parameter vector.
        block_size: Most policies that it plays at once for an algorithm that needs no whole
            trajectories; None: any number.
        batch_size: Policies that must play side by side, so that their episodes are reproducible.
        draws: Whether episodes begin at random, by the seed.
        known: The maze, task or robot of the environment, if it plays that without the environment.
        local: The evaluator that each process of a cluster has one like; None: there is no cluster.
        n_live: Processes of a cluster that have played the last generation; None: there is none.
    """

    n_parameters: int
    block_size: int | None = None
    batch_size: int = 1
    draws: bool = True
    known: KnownTask | None = None
    local: Evaluator | None = None
    n_live: int | None = None

    @abstractmethod
    def evaluate(self, parameters: Float32Array, seed: int | None = None) -> Rollouts:
        """Play one episode of each policy.

        Args:
            parameters: (P, n_parameters), float32.
            seed: Every episode's reset gets it, so that individuals are compared on equal terms;
                environments that draw nothing ignore it.
        """

    def play(
        self, parameters: Float32Array, seed: int, summarizers: Mapping[str, Summarizer] | None
    ) -> Rollouts:
        """Play one episode of each policy (P, n_parameters).

        Several blocks give summaries alone, and no trajectories, unless `summarizers` is None.
        """
        is_large = self.block_size is not None and len(parameters) > self.block_size
        if is_large and summarizers is not None:
            return self.evaluate_and_summarize(parameters, seed, summarizers)
        whole = self.evaluate(parameters, seed)
        summary = whole.summarize(summarizers or {}, slice(0, len(whole)))
        return replace(whole, summaries=summary.summaries)

    def evaluate_and_summarize(
        self,
        parameters: Float32Array,
        seed: int | None,
        summarizers: Mapping[str, Summarizer],
        first: int = 0,
    ) -> Rollouts:
        """Play policies in blocks, and keep summaries in place of trajectories.

        The policies (P, n_parameters) are part of a population, from its policy `first` on.
        """
        n = len(parameters)
        size = self.block_size or n
        parts = []
        for begin in range(0, n, size):
            rollouts = self.evaluate(parameters[begin : begin + size], seed)
            end = begin + len(rollouts)
            parts.append(rollouts.summarize(summarizers, slice(first + begin, first + end)))
        return concatenate(parts)
