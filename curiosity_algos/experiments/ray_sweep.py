"""Runs as tasks of a Ray cluster, in folders that every machine of it reaches."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from curiosity_algos.evaluation.ray import connect, exceptions, ray
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.sweep import MAX_RETRIES, Outcome, Train
from curiosity_gym.validation import check_positive


class RayBackend:
    """Trains the runs of a sweep on a Ray cluster; each is one task.

    A run whose machine or process is lost begins again elsewhere, and goes on from the checkpoint
    in its folder.

    Args:
        address: Address of the cluster, as of `RayEvaluator`.
        num_cpus: Processors that a run keeps to itself; it trains on one thread.

    Raises:
        ValueError: If an argument is out of its range.
        gymnasium.error.DependencyNotInstalled: If Ray is not there (extra `ray`).
    """

    def __init__(
        self,
        *,
        address: str | None = None,
        num_cpus: float = 1,
    ) -> None:
        check_positive(num_cpus=num_cpus)
        self.address = address
        self.num_cpus = num_cpus

    def __call__(self, runs: Sequence[RunSpec], train: Train) -> Iterator[tuple[RunSpec, Outcome]]:
        """Train the runs, and give each as it ends."""
        connect(self.address, math.ceil(self.num_cpus))
        task = ray.remote(_in_a_task).options(num_cpus=self.num_cpus, max_retries=MAX_RETRIES)
        waiting = {task.remote(train, run): run for run in runs}
        try:
            while waiting:
                (ended,), _ = ray.wait(list(waiting), num_returns=1)
                yield waiting.pop(ended), _outcome(ended)
        finally:
            for each in waiting:
                ray.cancel(each, force=True)


def _in_a_task(train: Train, run: RunSpec) -> bool:
    return train(run)


def _outcome(reference: Any) -> Outcome:
    try:
        outcome: Outcome = ray.get(reference)
    except exceptions.RayTaskError as error:
        outcome = error.cause
    except exceptions.RayError as error:
        outcome = error
    return outcome
