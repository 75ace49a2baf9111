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

from curiosity_algos.common.clusters import exceptions, ray
from curiosity_algos.evaluation.blocks import read_in_blocks
from curiosity_algos.evaluation.evaluator import Evaluator
from curiosity_algos.evaluation.policies import Float32Array
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
"""What Ray says of a shard that is to be played again."""

MakeEvaluator = Callable[[], Evaluator]


@dataclass(frozen=True)
class Generation:
    """What all shards of a population have in common.

    Attributes:
        parameters: (P, n_parameters).
        seed: Of every episode's reset.
        reads: What is read of trajectories, pickled: what Ray unpickles cannot be written to.
    """

    parameters: Float32Array
    seed: int | None
    reads: bytes | None


class Worker:
    """What an actor is: an evaluator of its own, once it is ready."""

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
        if generation.reads is None:
            return self._evaluator.evaluate(parameters, generation.seed)
        reads = ray.cloudpickle.loads(generation.reads)
        return read_in_blocks(self._evaluator, parameters, generation.seed, reads, shard.start)


@dataclass(eq=False)
class Member:
    """An actor, and what it is waited for.

    Attributes:
        actor: The handle of a `Worker`.
        packed: Reference to what it makes its evaluator of.
        awaited: What it is about to return; None: it is idle.
        shard: What it plays; None where it is idle or starts.
        deadline: When it is taken for hung.
    """

    actor: Any
    packed: Any
    awaited: Any = None
    shard: slice | None = None
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


class Crew:
    """The workers.

    Args:
        packed: A pickled function that makes the evaluator of each.
        num_cpus: Processors of each.
        resources: Other resources of each, by Ray's names.
        timeout: Seconds that a shard may take; None: as long as it likes.
    """

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
        self._members: list[Member] = []

    def __len__(self) -> int:
        """Workers, whether they have started or not."""
        return len(self._members)

    @property
    def n_live(self) -> int:
        """Workers that have started and answer."""
        return sum(member.is_live for member in self._members)

    def hire(self, n: int) -> None:
        """Start workers until there are n."""
        if isinstance(self._packed, bytes):
            self._packed = ray.put(self._packed)
        while len(self._members) < n:
            member = Member(self._actor.remote(), self._packed)
            member.start()
            self._members.append(member)

    def give(self, generation: Any, shards: deque[slice]) -> None:
        """Let those that are idle play the first of some shards, which are taken out of them."""
        for member in self._members:
            if member.awaited is None and shards:
                deadline = time.monotonic() + self._timeout
                member.play(generation, shards.popleft(), deadline)

    def ended(self) -> list[tuple[slice, Rollouts | None]]:
        """Shards that have ended since, with their rollouts; None: they were lost.

        Waits half a second at most.

        Raises:
            BaseException: What the evaluator raised.
            RuntimeError: If a worker cannot make the evaluator.
        """
        awaited = {each.awaited: each for each in self._members if each.awaited is not None}
        done, _ = ray.wait(list(awaited), num_returns=1, timeout=SECONDS)
        now = time.monotonic()
        members = [awaited[each] for each in done]
        late = [each for each in awaited.values() if each.deadline < now and each not in members]
        shards = [each.shard for each in (*members, *late)]
        results = [*map(self._result, members), *map(self._replace, late)]
        pairs = zip(shards, results, strict=True)
        return [(shard, rollouts) for shard, rollouts in pairs if shard is not None]

    def stop(self) -> None:
        """Give nobody's shard a further thought: each is ready again once it has ended."""
        for member in self._members:
            if member.shard is not None:
                member.start(time.monotonic() + self._timeout)

    def close(self) -> None:
        """Let all of them go."""
        for member in self._members:
            ray.kill(member.actor, no_restart=True)
        self._members.clear()

    def _result(self, member: Member) -> Rollouts | None:
        """What a member has returned; None: that it is ready, or has lost its shard."""
        try:
            # Ray's own cannot be written to, and stays in its store as long as any part is held.
            rollouts: Rollouts | None = copy.deepcopy(ray.get(member.awaited))
        except exceptions.RayTaskError as error:
            if member.shard is None:
                why = f"A worker could not make its environment: {error.cause}"
                raise RuntimeError(why) from error
            raise error.cause from error
        except exceptions.ActorDiedError:
            if member.shard is None:  # Ray itself has given it up
                self._replace(member)
            else:
                member.start()
            return None
        except LOSSES:
            member.start()
            return None
        if member.shard is not None and rollouts is None:
            member.start()
        else:
            member.awaited = member.shard = None
        return rollouts

    def _replace(self, member: Member) -> None:
        ray.kill(member.actor, no_restart=True)
        self._members.remove(member)
        self.hire(len(self._members) + 1)
