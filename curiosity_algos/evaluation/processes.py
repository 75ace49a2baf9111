"""A single environment on several processes, once a trial has shown that they pay.

Their results are those of one process: whoever plays a policy resets its environment with the same
seed, and an environment that is seen to remember earlier episodes is refused. A trial compares
results, bit for bit, and the time they take; later, one policy of each population is played here,
too, while the others wait for the rest.
"""

from __future__ import annotations

import gc
import math
import os
import pickle
import signal
import time
import warnings
import weakref
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from multiprocessing import current_process
from threading import Thread
from typing import Any, TypeVar

import cloudpickle
import gymnasium as gym

from curiosity_algos.evaluation.copies import N_COPIES, are_same_episodes
from curiosity_algos.evaluation.memory import remembers
from curiosity_algos.evaluation.policies import Float32Array
from curiosity_algos.evaluation.rollouts import Rollouts, concatenate

PATIENCE = 5.0
"""Seconds of play before processes are tried, which take some themselves to start."""
PATIENCE_GROWS = 4.0
"""Times as long until the next trial, where one found them slower."""
GAIN = 1.2
"""Times as fast as one process that several have to be."""
N_TRIES = 3
"""The first waits until all processes have started."""
DEADLINE = 60.0
"""Seconds that processes may take to start and to play, beside ten times those of this one."""
SHARDS_PER_PROCESS = 2
"""More shards than processes, as episodes differ in length."""
SINGLE_THREADED = dict.fromkeys(("MKL_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")

T = TypeVar("T")
Env = gym.Env[Any, Any]
Play = Callable[[Float32Array, int], Rollouts]
"""`play(parameters, seed)`: one episode of each policy."""
MakePlay = Callable[[Env], Play]
"""`make_play(env)`: what plays on an environment in its process."""


class Processes:
    """Plays on one environment, in this process or on several.

    Args:
        env: The environment, of which each process gets a pickled copy.
        make_play: Makes what plays on a copy; pickled, too.
        n: Processes to try, and to play on if they pay.
    """

    def __init__(self, env: Env, make_play: MakePlay, n: int) -> None:
        self._env = env
        self._make_play = make_play
        self._n = n
        self._begin_anew()

    def _begin_anew(self) -> None:
        self._seconds, self._patience = 0.0, PATIENCE
        self._is_refused = False
        self._pool: Any = None
        self._owner = os.getpid()

    @property
    def n_live(self) -> int:
        """Processes that play; 1 is this one."""
        return 1 if self._pool is None else self._n

    def play(self, parameters: Float32Array, seed: int, here: Play) -> Rollouts:
        """One episode of each policy (P, n_parameters), by processes or by `here`.

        Raises:
            Exception: What the environment raised.
        """
        if os.getpid() != self._owner:  # a fork has none of the pool's threads
            self._begin_anew()
        if self._pool is not None:
            return self._play_apart(parameters, seed, here)
        is_worth_it = self._seconds >= self._patience and len(parameters) >= 2 * self._n
        if self._is_refused or not is_worth_it:
            rollouts, seconds = _timed(here, parameters, seed)
            self._seconds += seconds
            return rollouts
        tried, rest = parameters[: N_COPIES * self._n], parameters[N_COPIES * self._n :]
        rollouts = self._try(tried, seed, here)
        return concatenate([rollouts, self.play(rest, seed, here)]) if len(rest) else rollouts

    def close(self) -> None:
        """Let the processes go."""
        if self._pool is not None:
            self._end.detach()
            self._pool.shutdown(kill_workers=True)
            self._pool = None

    def _try(self, parameters: Float32Array, seed: int, here: Play) -> Rollouts:
        """Play here and on processes, and stay with those if they pay and come to the same."""
        expected, seconds = _timed(here, parameters, seed)
        is_same = pays = False
        try:
            self._begin()
            is_same, pays = self._compare(parameters, seed, expected, seconds)
        except TimeoutError:  # that of somebody else, such as a job's alarm
            raise
        except (NotImplementedError, OSError, RuntimeError):
            pass  # where processes cannot be started, or sent to, nothing is lost
        finally:
            if not (is_same and pays):
                self.close()
        self._is_refused = not is_same
        self._seconds, self._patience = 0.0, PATIENCE_GROWS * self._patience
        return expected

    def _compare(
        self, parameters: Float32Array, seed: int, expected: Rollouts, seconds: float
    ) -> tuple[bool, bool]:
        """Whether processes come to what is expected, and whether they are faster."""
        deadline = time.monotonic() + DEADLINE + 10.0 * seconds
        # There, as a copy that is played here may undo something when it is freed.
        seen = self._pool.submit(_remembers_in_worker, _pack(self._env))
        if _outcome(seen, deadline) is not False:  # None: it could not be told
            return False, False
        for _ in range(N_TRIES):
            begin = time.perf_counter()
            futures = self._submit(parameters, seed)
            played = [_outcome(each, deadline) for each in futures]
            seconds_apart = time.perf_counter() - begin
            rollouts = [each for each in played if isinstance(each, Rollouts)]
            is_whole = len(rollouts) == len(futures)
            if not is_whole or not are_same_episodes(concatenate(rollouts), expected):
                return False, False
            if GAIN * seconds_apart < seconds:
                return True, True
        return True, False

    def _begin(self) -> None:
        """Make a pool, which starts its processes when it is first used.

        Raises:
            RuntimeError: If they could not have the environment.
        """
        from loky import ProcessPoolExecutor  # not before it is asked for: a script may never do

        if current_process().daemon:
            raise RuntimeError("A daemonic process cannot have any.")
        packed = _pack(partial(self._make_play, self._env))
        self._pool = ProcessPoolExecutor(
            self._n, initializer=_begin_worker, initargs=(packed, os.getpid()), env=SINGLE_THREADED
        )
        # Any thread may collect garbage, with any lock in its hands: it must not wait for another.
        end = self._pool.shutdown
        self._end = weakref.finalize(self, end, wait=False, kill_workers=True)

    def _play_apart(self, parameters: Float32Array, seed: int, here: Play) -> Rollouts:
        from loky.process_executor import BrokenProcessPool

        try:
            futures = self._submit(parameters, seed)
            first = here(parameters[:1], seed)
            rollouts = concatenate([future.result() for future in futures])
            one = slice(0, 1)
            if are_same_episodes(rollouts.only(one), first.only(one)):
                return rollouts
            reason = "comes to something else on processes than here, since something changed"
        except BrokenProcessPool as error:
            reason = f"has ended a process that played it ({error})"
        except BaseException:  # of the environment, or Ctrl-C: the others would go on
            self.close()
            raise
        self.close()
        self._is_refused = True
        warnings.warn(f"`env` {reason}: this process plays alone from now on.", stacklevel=2)
        return here(parameters, seed)

    def _submit(self, parameters: Float32Array, seed: int) -> list[Future[Rollouts]]:
        size = math.ceil(len(parameters) / (SHARDS_PER_PROCESS * self._n))
        shards = [parameters[i : i + size] for i in range(0, len(parameters), size)]
        return [self._pool.submit(_play_in_worker, shard, seed) for shard in shards]

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles have no processes, and may try them again."""
        return {name: getattr(self, name) for name in ("_env", "_make_play", "_n")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Begin without processes."""
        self.__dict__.update(state)
        self._begin_anew()


def _timed(play: Play, parameters: Float32Array, seed: int) -> tuple[Rollouts, float]:
    begin = time.perf_counter()
    rollouts = play(parameters, seed)
    return rollouts, time.perf_counter() - begin


def _pack(what: Any) -> bytes:
    """A pickle; what stands behind a handle is not made again: that may undo something.

    Raises:
        RuntimeError: If it cannot be pickled.
    """
    try:
        packed: bytes = cloudpickle.dumps(what)
    except Exception as error:  # of any kind: environments say what they like
        raise RuntimeError("The environment cannot be pickled.") from error
    return packed


def _outcome(future: Future[T], deadline: float) -> T | None:
    """What a process returned; None where it raised or is late."""
    try:
        error = future.exception(max(0.0, deadline - time.monotonic()))
    except TimeoutError:
        if time.monotonic() < deadline:  # that of somebody else, such as a job's alarm
            raise
        return None
    return future.result() if error is None else None


_worker_play: Play
"""What plays in a process that `Processes` has begun."""


def _begin_worker(packed: bytes, parent: int) -> None:
    global _worker_play
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one that began it
    Thread(target=_end_with, args=(parent,), daemon=True).start()
    try:
        _worker_play = cloudpickle.loads(packed)()
    except Exception as error:  # of any kind; loky would print it, of each process
        _worker_play = partial(_raise, error)
    gc.freeze()  # loky collects garbage once a second: .15 s, of all that is imported by now


def _raise(error: Exception, parameters: Float32Array, seed: int) -> Rollouts:
    raise error


def _end_with(parent: int) -> None:
    """End this process as soon as its parent is gone, however that ended."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


def _remembers_in_worker(packed: bytes) -> bool:
    try:
        return remembers(cloudpickle.loads(packed))
    except Exception:  # of any kind, and seldom made to be sent
        return True


def _play_in_worker(parameters: Float32Array, seed: int) -> Rollouts:
    try:
        return _worker_play(parameters, seed)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # of any kind: errors of one's own are seldom made to be sent
            raise RuntimeError(f"{type(error).__name__}: {error}") from None
        raise
