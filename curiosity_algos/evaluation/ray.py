"""Populations in shards, on Ray's actors: processes of this machine, or of a cluster.

Evaluation is a pure function of parameters and seed: a shard that was lost is played again, by
whichever worker is free, and the results are those of a single process.
"""

from __future__ import annotations

import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.common.clusters import check_resources, connect, exceptions, ray
from curiosity_algos.evaluation.blocks import RolloutParts
from curiosity_algos.evaluation.environments import open_env
from curiosity_algos.evaluation.evaluator import AnyEnv, Evaluator, make_evaluator
from curiosity_algos.evaluation.ray_workers import SECONDS, Generation, MakeEvaluator, Workers
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer, check_parameters
from curiosity_algos.evaluation.vector import VectorEvaluator
from curiosity_gym.validation import check_at_least_one, check_positive

SHARDS_PER_WORKER = 2
"""More shards than workers, as episodes and machines differ in speed."""
MAX_LOSSES = 5
"""Times that a shard may be lost: an environment that kills its process would go on forever."""


def _packed(evaluator: Evaluator) -> bytes:
    """A pickled function that makes a worker's evaluator: one anew, or a copy."""
    try:
        if not isinstance(evaluator, VectorEvaluator):  # a description, such as that of a maze
            return _pickled(lambda: evaluator)
        if evaluator.make_another is not None:
            return _pickled(evaluator.make_another)
        reason = "one environment cannot be two"
    except Exception as error:  # of any kind: environments say what they like
        reason = str(error)
    raise ValueError(
        "`env` must be an id or a function that makes the environment, so that each of Ray's "
        f"workers makes its own ({reason})."
    )


def _pickled(make: Callable[[], Any]) -> bytes:
    pickled: bytes = ray.cloudpickle.dumps(make)
    ray.cloudpickle.loads(pickled)  # some can be pickled, and not be made of that
    return pickled


class RayEvaluator:
    """Evaluates populations on the workers of a Ray cluster; the same bits as without.

    What algorithms read of trajectories is read by the workers, and nothing else is sent back.

    Args:
        env: An id, or a function that makes the environment: each worker makes its own. Of an
            environment, those that have a compiled evaluator alone. Or a function that makes an
            evaluator, one's own or that of a vector environment.
        policy_kwargs: `net_arch`, as of the algorithm.
        n_workers: None: as many as the cluster has processors for, at each generation.
        num_cpus: Processors of a worker, which plays with as many threads. A share of one lets
            workers have it together.
        resources: Other resources of a worker that the cluster knows: `{"simulator": 1}`.
        shard_size: Policies a worker is given at once; None: half of its part of the population. Of
            a vector environment as many as make its batches whole.
        timeout: Seconds that a shard may take before its worker is taken for hung, and replaced;
            None: as long as it likes.
        start_timeout: Seconds that no worker at all may have started, or be left.
        address: Of a cluster: "auto" finds the one that this machine is part of. None: that which
            Ray has been connected to, or that the variable `RAY_ADDRESS` names, or else one that is
            started on this machine.

    Attributes:
        n_parameters: Length of a policy's parameter vector.
        n_live: Workers that have started and answer.
        local: The evaluator that every worker has one like.

    Raises:
        ValueError: If an argument is out of its range, or workers cannot make the environment.
        gymnasium.error.DependencyNotInstalled: If Ray is not there (extra `ray`).
    """

    def __init__(
        self,
        env: AnyEnv | MakeEvaluator,
        policy_kwargs: dict[str, Any] | None = None,
        *,
        n_workers: int | None = None,
        num_cpus: float = 1,
        resources: Mapping[str, float] | None = None,
        shard_size: int | None = None,
        timeout: float | None = None,
        start_timeout: float = 300.0,
        address: str | None = None,
    ) -> None:
        for name, value in {"n_workers": n_workers, "shard_size": shard_size}.items():
            if value is not None:
                check_at_least_one(**{name: value})
        check_positive(num_cpus=num_cpus, start_timeout=start_timeout)
        if timeout is not None:
            check_positive(timeout=timeout)
        self.resources = check_resources(resources)
        opened = open_env(env)
        if hasattr(opened, "evaluate"):
            self.local: Evaluator = opened
            self._packed = _pickled(env)  # type: ignore[arg-type]  # what made an evaluator
        else:
            self.local = make_evaluator(opened, policy_kwargs, max(1, int(num_cpus)))
            self._packed = _packed(self.local)
        self.n_parameters = self.local.n_parameters
        self.n_workers = n_workers
        self.num_cpus = num_cpus
        self.shard_size = shard_size
        self.timeout = timeout
        self.start_timeout = start_timeout
        self.address = address
        self._workers = self._new_workers()
        self._session: str | None = None

    def _new_workers(self) -> Workers:
        return Workers(
            self._packed,
            num_cpus=self.num_cpus,
            resources=self.resources,
            timeout=self.timeout,
        )

    @property
    def n_live(self) -> int:
        """Workers that have started and answer."""
        return self._workers.n_live

    def evaluate(self, parameters: Float32Array, seed: int | None = None) -> Rollouts:
        """One episode of each policy (P, n_parameters), with its trajectory."""
        return self.evaluate_and_summarize(parameters, seed, None)

    def evaluate_and_summarize(
        self,
        parameters: Float32Array,
        seed: int | None,
        summarizers: Mapping[str, Summarizer] | None,
    ) -> Rollouts:
        """One episode of each policy (P, n_parameters), and what is read of its trajectory.

        Without `summarizers` trajectories are returned whole. Raises RuntimeError if no worker is
        left, or Ray fails.
        """
        parameters = check_parameters(parameters, self.n_parameters)
        pickled = None if summarizers is None else _pickled_summarizers(summarizers)
        self._connect()
        try:
            self._workers.start(self._n_wanted())
            shared = ray.put(Generation(parameters, seed, pickled))
            return self._gather(shared, self._shards(len(parameters)))
        except exceptions.RayError as error:
            raise RuntimeError(f"Ray failed in a generation: {error}") from error
        finally:
            if self._is_of_this_session():
                self._workers.stop()

    def close(self) -> None:
        """Let the workers and their processors go; the next generation would start new ones."""
        if self._is_of_this_session():
            self._workers.close()

    def _connect(self) -> None:
        """Join the cluster, or start one; the workers of a former one are no more."""
        n_workers = self.n_workers or 1
        own = {name: n_workers * each for name, each in self.resources.items()}
        connect(self.address, math.ceil(n_workers * self.num_cpus), own)
        if not self._is_of_this_session():
            self._workers = self._new_workers()
            self._session = ray.get_runtime_context().get_worker_id()

    def _is_of_this_session(self) -> bool:
        """Whether the workers are of the cluster that Ray is connected to now."""
        if not ray.is_initialized():
            return False
        return bool(ray.get_runtime_context().get_worker_id() == self._session)

    def _wait(self) -> list[Any]:
        """References of what workers have ended."""
        done: list[Any] = []

        def wait() -> None:
            with suppress(SystemExit):  # Ray's own, where another thread shuts it down
                done.extend(self._workers.wait())

        # In a thread, as it may also wait for ever then.
        waiter = threading.Thread(target=wait, daemon=True)
        waiter.start()
        while waiter.is_alive():
            self._check_session()
            waiter.join(SECONDS)
        self._check_session()
        return done

    def _check_session(self) -> None:
        if not self._is_of_this_session():  # Ray would start another, or join any, by itself
            raise RuntimeError(
                "Ray was shut down in the midst of a generation: a saved model goes on where it "
                "was saved."
            )

    def _n_wanted(self) -> int:
        if self.n_workers is not None:
            return self.n_workers
        there, needs = ray.cluster_resources(), {"CPU": self.num_cpus, **self.resources}
        return max(1, int(min(there.get(name, 0.0) / n for name, n in needs.items())))

    def _shards(self, n: int) -> list[slice]:
        size = self.shard_size or math.ceil(n / (SHARDS_PER_WORKER * len(self._workers)))
        batch = getattr(self.local, "batch_size", 1)
        size = math.ceil(size / batch) * batch
        return [slice(begin, min(begin + size, n)) for begin in range(0, n, size)]

    def _gather(self, generation: Any, shards: list[slice]) -> Rollouts:
        """Rollouts of all shards, in whatever order they come."""
        workers, parts, losses = self._workers, RolloutParts(shards[-1].stop), Counter[int]()
        left, n_missing = deque(shards), len(shards)
        last_live = time.monotonic()
        while n_missing:
            self._check_session()
            workers.give(generation, left)
            for shard, rollouts in workers.ended(self._wait()):
                if rollouts is not None:
                    parts.put(shard, rollouts)
                    n_missing -= 1
                else:
                    losses[shard.start] += 1
                    _check_losses(losses[shard.start], shard)
                    left.append(shard)
            last_live = time.monotonic() if workers.n_live else last_live
            self._check_live(last_live)
        return parts.rollouts()

    def _check_live(self, last_live: float) -> None:
        if time.monotonic() - last_live > self.start_timeout:
            needs = [f"{self.num_cpus:g} processors"]
            needs += [f"{n:g} of {name!r}" for name, n in self.resources.items()]
            raise RuntimeError(
                f"No Ray worker has started, or is left, for {self.start_timeout:g} seconds; each "
                f"needs {' and '.join(needs)}, which other searches may hold until their evaluator "
                "is closed. A saved model goes on where it was saved."
            )


def _check_losses(n: int, shard: slice) -> None:
    if n == MAX_LOSSES:
        raise RuntimeError(
            f"The workers that played policies {shard.start} to {shard.stop} were lost {n} times: "
            "their episodes may kill its process, or take longer than `timeout`."
        )


def _pickled_summarizers(summarizers: Mapping[str, Summarizer]) -> bytes:
    try:
        pickled: bytes = ray.cloudpickle.dumps(summarizers)
    except Exception as error:  # of any kind, of bonuses of one's own
        raise ValueError(
            f"`bonus` must be one that can be pickled, as workers score with it ({error})."
        ) from error
    return pickled
