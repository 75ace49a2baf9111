"""The base of evaluators, which play populations, and large ones in blocks.

Of 10,000 episodes in a maze the trajectories are 3 gigabytes, and what a search learns from is a
tenth of one. Blocks are also faster: their memory is used again, and stays in place.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING

from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.evaluation.rollouts import (
    MakeSummarizers,
    Rollouts,
    Summarizer,
    concatenate,
)

if TYPE_CHECKING:
    from curiosity_algos.evaluation.transparent import KnownTask


class Evaluator(ABC):
    """Plays one episode with each policy of a population.

    Attributes:
        n_parameters: Length of a policy's parameter vector.
        block_size: Policies that algorithms which need no whole trajectories let it play at once;
            None: any number.
        batch_size: Policies whose episodes must be played side by side, to be the same again.
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
        self, parameters: Float32Array, seed: int, make_summarizers: MakeSummarizers | None
    ) -> Rollouts:
        """One episode of each policy (P, n_parameters), with summaries if they are several blocks.

        Summaries are the same as of whole trajectories, which `make_summarizers` None asks for.
        """
        n = len(parameters)
        if make_summarizers is None or self.block_size is None or n <= self.block_size:
            return self.evaluate(parameters, seed)
        return self.evaluate_and_summarize(parameters, seed, make_summarizers(n))

    def evaluate_and_summarize(
        self,
        parameters: Float32Array,
        seed: int | None,
        summarizers: Mapping[str, Summarizer],
        first: int = 0,
    ) -> Rollouts:
        """Play policies in blocks, and keep summaries in place of trajectories.

        The policies (P, n_parameters) are those of a population from its `first` on.
        """
        n = len(parameters)
        size = self.block_size or n
        parts = []
        for begin in range(0, n, size):
            rollouts = self.evaluate(parameters[begin : begin + size], seed)
            end = begin + len(rollouts)
            parts.append(rollouts.summarize(summarizers, slice(first + begin, first + end)))
        return concatenate(parts)
