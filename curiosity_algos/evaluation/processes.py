"""Episodes on several processes, each of which makes environments of its own."""

from __future__ import annotations

import atexit
import gc
import math
import os
import pickle
import signal
import weakref
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import cloudpickle

from curiosity_algos.common.arrays import Float32Array
from curiosity_algos.common.interrupt import end_with
from curiosity_algos.evaluation.rollouts import Rollouts, concatenate

SHARDS_PER_PROCESS = 2
"""More shards than processes, as episodes differ in length."""
SINGLE_THREADED = dict.fromkeys(("MKL_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")


class Processes:
    """Plays on n processes, which start when first needed; each makes an evaluator of its own."""

    def __init__(self, make_player: Callable[[], Any], n: int) -> None:
        try:
            self._packed = cloudpickle.dumps(make_player)
        except Exception as error:  # of any kind: what it holds says what it likes
            raise ValueError(
                "`env` must be an id, or a function that can be pickled, where `n_threads` is "
                f"above 1: each process makes its own ({error})."
            ) from error
        self._n = n
        self._pool: Any = None

    def play(self, parameters: Float32Array, seed: int) -> Rollouts:
        """One episode of each policy (P, n_parameters); raises what the environment raised."""
        from loky.process_executor import BrokenProcessPool

        try:
            return concatenate([shard.result() for shard in self._submit(parameters, seed)])
        except BrokenProcessPool as error:
            self.close(kill_workers=True)
            raise RuntimeError(f"`env` has ended a process that played it ({error}).") from error
        except BaseException:  # of the environment, or Ctrl-C: the others would go on
            self.close(kill_workers=True)
            raise

    def close(self, *, kill_workers: bool = False) -> None:
        """Let the processes close what they play, and end; new episodes would start new ones."""
        if self._pool is not None:
            self._end.detach()
            self._pool.shutdown(kill_workers=kill_workers)
            self._pool = None

    def _submit(self, parameters: Float32Array, seed: int) -> list[Future[Rollouts]]:
        if self._pool is None:
            self._start()
        size = math.ceil(len(parameters) / (SHARDS_PER_PROCESS * self._n))
        shards = [parameters[i : i + size] for i in range(0, len(parameters), size)]
        return [self._pool.submit(_play, shard, seed) for shard in shards]

    def _start(self) -> None:
        from loky import ProcessPoolExecutor  # not before it is asked for: a script may never do

        self._pool = ProcessPoolExecutor(
            self._n, initializer=_begin, initargs=(self._packed, os.getpid()), env=SINGLE_THREADED
        )
        # Any thread may collect garbage, with any lock in its hands: it must not wait for another.
        end = self._pool.shutdown
        self._end = weakref.finalize(self, end, wait=False, kill_workers=True)


_packed: bytes
_player: Any = None
"""The evaluator in a process that `Processes` has begun, made by what `_packed` holds."""


def _begin(packed: bytes, parent: int) -> None:
    global _packed
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one that began it
    end_with(parent)
    _packed = packed


def _play(parameters: Float32Array, seed: int) -> Rollouts:
    global _player
    try:
        if _player is None:
            _player = cloudpickle.loads(_packed)()
            atexit.register(_player.close)
            gc.freeze()  # loky collects garbage once a second: .15 s, of all that is imported now
        rollouts: Rollouts = _player.evaluate(parameters, seed)
        return rollouts
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # of any kind: errors of one's own are seldom made to be sent
            raise RuntimeError(f"{type(error).__name__}: {error}") from None
        raise
