"""Ray's actors that play the shards of a generation: who is there, and what became of a shard.

Ray starts actors anew that die. Its own retries of what they did are left alone: those wait for the
same actor, whose machine may be gone, where another worker may be free.
"""

from __future__ import annotations

import copy
import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.common.clusters import exceptions, ray
from curiosity_algos.evaluation.blocks import summarize_in_blocks
from curiosity_algos.evaluation.evaluator import Evaluator
from curiosity_algos.evaluation.rollouts import Rollouts

SECONDS = 0.5
"""Between two looks at the clock while nothing ends."""

LOSSES = (
    exceptions.ActorUnavailableError,
    exceptions.NodeDiedError,
    exceptions.ObjectLostError,
    exceptions.OutOfMemoryError,
    exceptions.WorkerCrashedError,
)
"""Errors of Ray after which a shard is played again."""

MakeEvaluator = Callable[[], Evaluator]


@dataclass(frozen=True)
class Generation:
    """The arguments that all shards of a population share; summarizers are pickled.

    What Ray unpickles cannot be written to.
    """

    parameters: Float32Array
    seed: int | None
    summarizers: bytes | None


class Worker:
    """An actor: an evaluator of its own, once it is ready."""

    _evaluator: Evaluator | None = None

    def ready(self, packed: bytes) -> None:
        """Make the evaluator, by a pickled function: what Ray unpickles cannot be written to."""
        if self._evaluator is None:
            self._evaluator = ray.cloudpickle.loads(packed)()

    def play(self, generation: Generation, shard: slice) -> Rollouts | None:
        """Rollouts of a shard, with what is read of their trajectories, or all of these.

        None: Ray has begun the actor anew since it was ready.
        """
        if self._evaluator is None:
            return None
        parameters = np.array(generation.parameters[shard])
        if generation.summarizers is None:
            return self._evaluator.evaluate(parameters, generation.seed)
        summarizers = ray.cloudpickle.loads(generation.summarizers)
        return summarize_in_blocks(
            self._evaluator, parameters, generation.seed, summarizers, shard.start
        )


@dataclass(eq=False)
class WorkerHandle:
    """An actor, and what it is waited for until it is taken for hung."""

    actor: Any
    packed: Any
    awaited: Any = None
    """The result that it is about to return; None: it is idle."""
    shard: slice | None = None
    """The shard that it plays; None where it is idle or starts."""
    deadline: float = math.inf

    def start(self, deadline: float = math.inf) -> None:
        """Wait until the actor answers, however often Ray has to begin it anew."""
        self.shard, self.deadline = None, deadline
        self.awaited = self.actor.ready.options(max_task_retries=-1).remote(self.packed)

    def play(self, generation: Any, shard: slice, deadline: float) -> None:
        """Let it play a shard of what a reference stands for."""
        self.shard, self.deadline = shard, deadline
        self.awaited = self.actor.play.remote(generation, shard)

    @property
    def is_live(self) -> bool:
        """Whether it has answered since it began."""
        return self.awaited is None or self.shard is not None


class Workers:
    """The actors of a search, see `RayEvaluator`; `packed` makes the evaluator of each."""

    def __init__(
        self,
        packed: bytes,
        *,
        num_cpus: float,
        resources: Mapping[str, float],
        timeout: float | None,
    ) -> None:
        self._packed: Any = packed  # a reference to it, once there is a worker
        self._actor = ray.remote(Worker).options(
            num_cpus=num_cpus, resources=dict(resources), max_restarts=-1, max_task_retries=0
        )
        self._timeout = math.inf if timeout is None else timeout
        self._workers: list[WorkerHandle] = []

    def __len__(self) -> int:
        """Workers, whether they have started or not."""
        return len(self._workers)

    @property
    def n_live(self) -> int:
        """Workers that have started and answer."""
        return sum(worker.is_live for worker in self._workers)

    def start(self, n: int) -> None:
        """Start workers until there are n."""
        if isinstance(self._packed, bytes):
            self._packed = ray.put(self._packed)
        while len(self._workers) < n:
            worker = WorkerHandle(self._actor.remote(), self._packed)
            worker.start()
            self._workers.append(worker)

    def give(self, generation: Any, shards: deque[slice]) -> None:
        """Let those that are idle play the first of some shards, which are taken out of them."""
        for worker in self._workers:
            if worker.awaited is None and shards:
                deadline = time.monotonic() + self._timeout
                worker.play(generation, shards.popleft(), deadline)

    def wait(self) -> list[Any]:
        """References of what has ended since, after half a second at most."""
        awaited = [each.awaited for each in self._workers if each.awaited is not None]
        done, _ = ray.wait(awaited, num_returns=1, timeout=SECONDS)
        return list(done)

    def ended(self, done: list[Any]) -> list[tuple[slice, Rollouts | None]]:
        """Shards that `wait` says have ended, with their rollouts; None: they were lost."""
        awaited = {each.awaited: each for each in self._workers if each.awaited is not None}
        now = time.monotonic()
        workers = [awaited[each] for each in done]
        late = [each for each in awaited.values() if each.deadline < now and each not in workers]
        shards = [each.shard for each in (*workers, *late)]
        results = [*map(self._result, workers), *map(self._replace, late)]
        pairs = zip(shards, results, strict=True)
        return [(shard, rollouts) for shard, rollouts in pairs if shard is not None]

    def stop(self) -> None:
        """Give nobody's shard a further thought: each is ready again once it has ended."""
        for worker in self._workers:
            if worker.shard is not None:
                worker.start(time.monotonic() + self._timeout)

    def close(self) -> None:
        """Let all of them go."""
        for worker in self._workers:
            ray.kill(worker.actor, no_restart=True)
        self._workers.clear()

    def _result(self, worker: WorkerHandle) -> Rollouts | None:
        """The result that a worker has returned; None: that it is ready, or has lost its shard."""
        try:
            # Ray's own cannot be written to, and stays in its store as long as any part is held.
            rollouts: Rollouts | None = copy.deepcopy(ray.get(worker.awaited))
        except exceptions.RayTaskError as error:
            if worker.shard is None:
                why = f"A worker could not make its environment: {error.cause}"
                raise RuntimeError(why) from error
            raise error.cause from error
        except exceptions.ActorDiedError:
            if worker.shard is None:  # Ray itself has given it up
                self._replace(worker)
            else:
                worker.start()
            return None
        except LOSSES:
            worker.start()
            return None
        if worker.shard is not None and rollouts is None:
            worker.start()
        else:
            worker.awaited = worker.shard = None
        return rollouts

    def _replace(self, worker: WorkerHandle) -> None:
        ray.kill(worker.actor, no_restart=True)
        self._workers.remove(worker)
        self.start(len(self._workers) + 1)
