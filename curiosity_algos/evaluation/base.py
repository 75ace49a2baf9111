"""The base of evaluators, which play large populations in blocks: trajectories take gigabytes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer, concatenate
from curiosity_gym.maze.dynamics import same_maze


@dataclass(frozen=True)
class KnownTask:
    """A maze, a control task or a robot that compiled evaluators can play without its env.

    Attributes:
        task: The maze or task.
        simulate: Makes simulations of a task; None: it is a maze.
        grid: The coverage grid of a maze.
        horizon: T of the reward `1 - t / T`; None: rewards are the task's own.
        max_steps: Steps after which an episode ends.
    """

    task: Any
    simulate: Any
    grid: Any
    horizon: int | None
    max_steps: int

    def is_same(self, other: KnownTask | None) -> bool:
        """Whether policies meet the same task."""
        if other is None or self.simulate is not other.simulate:
            return False
        if (self.horizon, self.max_steps) != (other.horizon, other.max_steps):
            return False
        is_maze = self.simulate is None
        return same_maze(self.task, other.task) if is_maze else bool(self.task == other.task)


class Player:
    """Plays episodes of an environment.

    Attributes:
        known: The maze, task or robot, if it plays that without the environment.
        local: The evaluator that each process of a cluster has one like; None: there is no cluster.
        n_live: Processes of a cluster that have played the last generation; None: there is none.
    """

    known: KnownTask | None = None
    local: Evaluator | None = None
    n_live: int | None = None


class Evaluator(Player, ABC):
    """Plays one episode with each policy of a population.

    Attributes:
        n_parameters: Length of a policy's parameter vector.
        block_size: Most policies of a block; None: any number.
        batch_size: Policies that must play side by side, so that their episodes are reproducible.
        draws: Whether episodes begin at random, by the seed.
    """

    n_parameters: int
    block_size: int | None = None
    batch_size: int = 1
    draws: bool = True

    @abstractmethod
    def evaluate(self, parameters: Float32Array, seed: int | None = None) -> Rollouts:
        """Play one episode of each policy.

        Args:
            parameters: (P, n_parameters), float32.
            seed: Every episode's reset gets it; environments that draw nothing ignore it.
        """

    def play(
        self,
        parameters: Float32Array,
        seed: int | None,
        summarizers: Mapping[str, Summarizer] | None,
        first: int = 0,
    ) -> Rollouts:
        """Play one episode of each policy; several blocks keep summaries of trajectories alone.

        Args:
            parameters: (P, n_parameters), of a population's individuals from `first` on.
            seed: See `evaluate`.
            summarizers: What is read of trajectories; None: all of them, in one block.
            first: The first individual.
        """
        if summarizers is None:
            return self.evaluate(parameters, seed)
        n = len(parameters)
        size = self.block_size or n
        parts = []
        for begin in range(0, n, size):
            rollouts = self.evaluate(parameters[begin : begin + size], seed)
            place = first + begin
            individuals = slice(place, place + len(rollouts))
            summaries = {name: read(rollouts, individuals) for name, read in summarizers.items()}
            if n > size:
                rollouts = rollouts.without_trajectories()
            parts.append(replace(rollouts, summaries=summaries))
        return concatenate(parts)
