"""Populations in shards, as tasks of Ray: on processes of this machine, or of a cluster."""

from __future__ import annotations

import copy
import math
import os
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.environments import open_env
from curiosity_algos.evaluation.evaluator import AnyEnv, make_evaluator
from curiosity_algos.evaluation.ray_worker import Generation, play_shard
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer, check_parameters, concatenate
from curiosity_algos.evaluation.vector import VectorEvaluator
from curiosity_gym.extras import import_extra
from curiosity_gym.processors import available_cpus
from curiosity_gym.validation import check_at_least_one, check_positive

ray, exceptions = import_extra("ray", "ray", "ray.exceptions")

SHARDS_PER_WORKER = 2
"""More shards than workers, as episodes and machines differ in speed."""
MAX_RETRIES = 5
"""Times that Ray plays a shard again: an episode may kill its process each time."""
_PLAY_SHARD = ray.remote(play_shard)
_LATE = (
    "Ray has ended no shard of a generation for {:g} seconds: machines may be gone or busy, or "
    "episodes longer. A saved model goes on where it was saved."
)

MakeEvaluator = Callable[[], Evaluator]


class RayEvaluator(Evaluator):
    """Evaluates populations on the processes of a Ray cluster; the same bits as without.

    What algorithms read of trajectories is read there, and nothing else is sent back.

    Args:
        env: An id, or a function that makes the environment: each process makes its own. An
            environment that has a compiled evaluator. Or a function that makes an evaluator.
        policy_kwargs: `net_arch`, as of the algorithm.
        n_workers: Shards that are played at once, at most. None: as many as there is room for.
        num_cpus: Processors of a shard, which is played with as many threads; may be a share.
        resources: Other resources of a shard that the cluster knows: `{"simulator": 1}`.
        shard_size: Policies of a shard; None: half of a worker's part of the population.
        timeout: Seconds that may pass without the end of a shard; None: as many as it takes.
        address: Of a cluster: "auto" finds the one that this machine is part of. None: that which
            Ray has been connected to, or that the variable `RAY_ADDRESS` names, or else one that is
            started on this machine.

    Raises:
        ValueError: If an argument is out of its range, or workers cannot make the environment.
        gymnasium.error.DependencyNotInstalled: If Ray is not there (extra `ray`).
    """

    local: Evaluator

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
        address: str | None = None,
    ) -> None:
        counts = {"n_workers": n_workers, "shard_size": shard_size}
        check_at_least_one(**{name: n for name, n in counts.items() if n is not None})
        check_positive(num_cpus=num_cpus, **({} if timeout is None else {"timeout": timeout}))
        self._needs: dict[str, Any] = {"num_cpus": num_cpus, "resources": dict(resources or {})}
        self._task()  # raises what Ray says of them
        opened = open_env(env)
        is_own = isinstance(opened, Evaluator)
        self.local = opened if is_own else make_evaluator(opened, policy_kwargs, int(num_cpus) or 1)
        self._packed = _pickled(env if is_own else _maker(self.local), "env")
        self.n_parameters = self.local.n_parameters
        self.n_workers, self.shard_size = n_workers, shard_size
        self.num_cpus = num_cpus
        self.timeout = timeout
        self.address = address
        self.n_live = 0

    def _task(self) -> Any:
        try:
            return _PLAY_SHARD.options(max_retries=MAX_RETRIES, **self._needs)
        except (TypeError, ValueError) as error:
            raise ValueError(f"`resources` must be what Ray takes as such: {error}.") from error

    def evaluate(self, parameters: Float32Array, seed: int | None = None) -> Rollouts:
        """One episode of each policy (P, n_parameters), with its trajectory."""
        return self.play(parameters, seed, None)

    def play(
        self,
        parameters: Float32Array,
        seed: int | None,
        summarizers: Mapping[str, Summarizer] | None,
        first: int = 0,
    ) -> Rollouts:
        """One episode of each policy; with `summarizers` trajectories stay where they are played.

        Raises:
            RuntimeError: If Ray gives up, or nothing has ended for the seconds of `timeout`.
        """
        parameters = check_parameters(parameters, self.n_parameters)
        pickled = None if summarizers is None else _pickled(summarizers, "bonus")
        self._connect()
        try:
            generation = ray.put(Generation(self._packed, parameters, seed, pickled))
            return self._gather(generation, self._shards(len(parameters)))
        except exceptions.RayError as error:
            raise RuntimeError(f"Ray failed in a generation: {error}") from error

    def _connect(self) -> None:
        """Join a cluster, or start one, unless Ray is connected already."""
        if ray.is_initialized():
            return
        address = self.address or os.environ.get("RAY_ADDRESS", "local")
        n_workers = self.n_workers or 1
        started: dict[str, Any] = {
            "num_cpus": max(available_cpus(), math.ceil(n_workers * self.num_cpus)),
            "resources": {name: n_workers * n for name, n in self._needs["resources"].items()},
            "include_dashboard": False,
        }
        options = started if address == "local" else {}
        ray.init(address=address, logging_level="warning", **options)

    def _n_wanted(self) -> int:
        """Shards that are to be played at once."""
        if self.n_workers is not None:
            return self.n_workers
        there, needs = ray.cluster_resources(), {"CPU": self.num_cpus, **self._needs["resources"]}
        return max(1, int(min(there.get(name, 0.0) / n for name, n in needs.items())))

    def _shards(self, n: int) -> list[slice]:
        size = self.shard_size or math.ceil(n / (SHARDS_PER_WORKER * self._n_wanted()))
        batch = self.local.batch_size
        size = math.ceil(size / batch) * batch
        return [slice(begin, min(begin + size, n)) for begin in range(0, n, size)]

    def _gather(self, generation: Any, shards: list[slice]) -> Rollouts:
        """Rollouts of all shards, in whatever order they come."""
        task, workers = self._task(), set()
        parts: dict[int, Rollouts] = {}
        at_once, waiting = self.n_workers or len(shards), deque(shards)
        running: dict[Any, slice] = {}
        while waiting or running:
            while waiting and len(running) < at_once:
                shard = waiting.popleft()
                running[task.remote(generation, shard)] = shard
            ended, _ = ray.wait(list(running), timeout=self.timeout)
            if not ended:
                for late in running:  # not after other errors: Ray may crash where a task just ends
                    ray.cancel(late)
                raise RuntimeError(_LATE.format(self.timeout))
            worker, parts[running.pop(ended[0]).start] = _result(ended[0])
            workers.add(worker)
        self.n_live = len(workers)
        return concatenate([parts[begin] for begin in sorted(parts)])


def _result(ended: Any) -> tuple[str, Rollouts]:
    try:
        # Ray's own cannot be written to, and stays in its store as long as any part is held.
        result: tuple[str, Rollouts] = copy.deepcopy(ray.get(ended))
    except exceptions.RayTaskError as error:
        raise error.cause from error
    return result


def _maker(evaluator: Evaluator) -> MakeEvaluator:
    """A function that makes a worker's evaluator: one anew, or a copy."""
    if not isinstance(evaluator, VectorEvaluator):
        return lambda: evaluator  # a description, such as that of a maze
    if evaluator.make_another is None:
        raise ValueError(f"{_UNSENT['env']} (one environment cannot be two).")
    return evaluator.make_another


_UNSENT = {
    "env": "`env` must be an id or a function that makes the environment, so that each of Ray's "
    "workers makes its own",
    "bonus": "`bonus` must be one that can be pickled, as workers score with it",
}


def _pickled(value: Any, argument: str) -> bytes:
    try:
        pickled: bytes = ray.cloudpickle.dumps(value)
        ray.cloudpickle.loads(pickled)  # some can be pickled, and not be made of that
    except Exception as error:  # of any kind: what is pickled says what it likes
        raise ValueError(f"{_UNSENT[argument]} ({error}).") from error
    return pickled
