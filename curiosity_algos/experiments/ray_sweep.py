"""Runs as tasks of a Ray cluster, in folders that every machine of it reaches."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from curiosity_algos.common.clusters import check_resources, connect, exceptions, ray
from curiosity_algos.experiments.sweep import SECONDS, Advance, Make, Report
from curiosity_algos.experiments.training import RunSpec
from curiosity_gym.validation import check_positive

MAX_RETRIES = 5
"""Times that a run is begun again on another machine, or after its process died."""


class RayBackend:
    """Trains the runs of a sweep on a Ray cluster; each is one task.

    A run whose machine or process is lost begins again elsewhere, and goes on from the checkpoint
    in its folder.

    Args:
        address: Of the cluster, as of `RayEvaluator`.
        num_cpus: Processors that a run keeps to itself; it trains on one thread.
        resources: Other resources of a run, by Ray's names.

    Raises:
        ValueError: If an argument is out of its range.
        gymnasium.error.DependencyNotInstalled: If Ray is not there (extra `ray`).
    """

    def __init__(
        self,
        *,
        address: str | None = None,
        num_cpus: float = 1,
        resources: Mapping[str, float] | None = None,
    ) -> None:
        check_positive(num_cpus=num_cpus)
        self.address = address
        self.num_cpus = num_cpus
        self.resources = check_resources(resources)

    def __call__(self, runs: Sequence[RunSpec], make: Make, report: Report, advance: Advance) -> None:
        """Train the runs, and tell how far they are and how they ended."""
        connect(self.address, math.ceil(self.num_cpus), self.resources)
        messages = _queue()
        task = ray.remote(_in_a_task).options(
            num_cpus=self.num_cpus, resources=self.resources, max_retries=MAX_RETRIES
        )
        waiting = {task.remote(make, run, i, messages): run for i, run in enumerate(runs)}
        try:
            while waiting:
                ended, _ = ray.wait(list(waiting), num_returns=1, timeout=SECONDS)
                for number, timesteps in messages.get_nowait_batch(messages.qsize()):
                    if runs[number] in waiting.values():  # messages take their time
                        advance(runs[number], timesteps)
                for each in ended:
                    report(waiting.pop(each), _outcome(each))
        finally:
            for each in waiting:
                ray.cancel(each, force=True)
            messages.shutdown()


def _queue() -> Any:
    """Messages of how far runs are, kept on this machine: it cannot be lost before the sweep."""
    from ray.util.queue import Queue
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

    here = NodeAffinitySchedulingStrategy(ray.get_runtime_context().get_node_id(), soft=False)
    return Queue(actor_options={"num_cpus": 0, "scheduling_strategy": here})


def _in_a_task(make: Make, run: RunSpec, number: int, messages: Any) -> bool:
    return make(run, partial(_send, messages.actor, number))


def _send(actor: Any, number: int, timesteps: int) -> None:
    actor.put_nowait.remote((number, timesteps))  # nobody waits for it


def _outcome(reference: Any) -> bool | BaseException:
    try:
        outcome: bool | BaseException = ray.get(reference)
    except exceptions.RayTaskError as error:
        outcome = error.cause
    except exceptions.RayError as error:
        outcome = error
    return outcome
