"""Any single environment on several processes, once a trial has shown that they pay.

Their results are those of one process: whoever plays a policy resets its environment with the same
seed. A trial compares them, bit for bit, and the time they take; what cannot be sent to a process,
or comes to something else there, is played in this one.
"""

from __future__ import annotations

import gc
import math
import os
import signal
import time
import warnings
import weakref
from collections.abc import Callable
from functools import partial
from threading import Thread
from typing import Any

import cloudpickle
import gymnasium as gym
from gymnasium.envs.registration import EnvSpec

from curiosity_algos.evaluation.copies import N_COPIES, are_same_episodes
from curiosity_algos.evaluation.policies import Float32Array
from curiosity_algos.evaluation.rollouts import Rollouts, concatenate

PATIENCE = 5.0
"""Seconds of play before processes are tried, which take some themselves to start."""
GAIN = 1.2
"""Times as fast as one process that several have to be."""
N_TRIES = 3
"""The first waits until all processes have started."""
SHARDS_PER_PROCESS = 2
"""More shards than processes, as episodes differ in length."""
SINGLE_THREADED = dict.fromkeys(("MKL_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")

Env = gym.Env[Any, Any]
Play = Callable[[Float32Array, int], Rollouts]
"""`play(parameters, seed)`: one episode of each policy."""
MakePlay = Callable[[Env], Play]
"""`make_play(env)`: what plays on an environment in its process."""


class Processes:
    """Plays on one environment, in this process or on several.

    Args:
        env: The environment, of which each process gets a copy; where it cannot be pickled, one
            like its spec.
        make_play: Makes what plays on a copy; pickled.
        n: Processes to try, and to play on if they pay.
    """

    def __init__(self, env: Env, make_play: MakePlay, n: int) -> None:
        self._env = env
        self._make_play = make_play
        self._n = n
        self._seconds = 0.0
        self._pool: Any = None
        self._is_settled = n == 1

    @property
    def n_live(self) -> int:
        """Processes that play; 1 is this one."""
        return 1 if self._pool is None else self._n

    def play(self, parameters: Float32Array, seed: int, here: Play) -> Rollouts:
        """One episode of each policy (P, n_parameters), by processes or by `here`.

        Raises:
            Exception: What the environment raised.
        """
        if self._pool is not None:
            return self._play_apart(parameters, seed, here)
        if self._is_settled or self._seconds < PATIENCE:
            rollouts, seconds = _timed(here, parameters, seed)
            self._seconds += seconds
            return rollouts
        tried, rest = parameters[: N_COPIES * self._n], parameters[N_COPIES * self._n :]
        rollouts = self._try(tried, seed, here)
        return concatenate([rollouts, self.play(rest, seed, here)]) if len(rest) else rollouts

    def close(self) -> None:
        """Let the processes go."""
        if self._pool is not None:
            self._end()
            self._pool = None

    def _try(self, parameters: Float32Array, seed: int, here: Play) -> Rollouts:
        """Play here and on processes, and stay with those if they pay and come to the same."""
        expected, seconds = _timed(here, parameters, seed)
        try:
            self._begin()
            tries = [_timed(self._play_shards, parameters, seed) for _ in range(N_TRIES)]
            is_same = all(are_same_episodes(played, expected) for played, _ in tries)
            pays = is_same and GAIN * min(seconds_apart for _, seconds_apart in tries) < seconds
        except Exception:  # of any kind: environments say what they like
            pays = False
        except BaseException:
            self.close()
            raise
        if not pays:
            self.close()
        self._is_settled = True
        return expected

    def _begin(self) -> None:
        from loky import ProcessPoolExecutor  # not before it is asked for: a script may never do

        packed = _pack(self._env, self._make_play)
        self._pool = ProcessPoolExecutor(
            self._n, initializer=_begin_worker, initargs=(packed, os.getpid()), env=SINGLE_THREADED
        )
        self._end = weakref.finalize(self, self._pool.shutdown, kill_workers=True)

    def _play_apart(self, parameters: Float32Array, seed: int, here: Play) -> Rollouts:
        from loky.process_executor import BrokenProcessPool

        try:
            return self._play_shards(parameters, seed)
        except BrokenProcessPool as error:
            self.close()
            warnings.warn(
                f"A process that played `env` is gone, so that this one plays alone: {error}",
                stacklevel=2,
            )
            return here(parameters, seed)
        except BaseException:  # of the environment, or Ctrl-C: the others would go on
            self.close()
            self._is_settled = False
            raise

    def _play_shards(self, parameters: Float32Array, seed: int) -> Rollouts:
        size = math.ceil(len(parameters) / (SHARDS_PER_PROCESS * self._n))
        shards = [parameters[i : i + size] for i in range(0, len(parameters), size)]
        futures = [self._pool.submit(_play_in_worker, shard, seed) for shard in shards]
        return concatenate([future.result() for future in futures])

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles have no processes, and may try them again."""
        held = {"_pool": None, "_seconds": 0.0, "_is_settled": self._n == 1}
        return {name: held.get(name, value) for name, value in vars(self).items() if name != "_end"}


def _timed(play: Play, parameters: Float32Array, seed: int) -> tuple[Rollouts, float]:
    begin = time.perf_counter()
    rollouts = play(parameters, seed)
    return rollouts, time.perf_counter() - begin


def _pack(env: Env, make_play: MakePlay) -> bytes:
    """A pickled function that makes what plays: on a copy, or on one of the env's spec.

    Raises:
        Exception: If there is neither.
    """
    try:
        packed: bytes = cloudpickle.dumps(partial(make_play, env))
    except Exception:  # of any kind
        if env.spec is None:
            raise
        packed = cloudpickle.dumps(partial(_make_of_spec, make_play, env.spec))
    return packed


def _make_of_spec(make_play: MakePlay, spec: EnvSpec) -> Play:
    return make_play(gym.make(spec))


_worker_play: Play
"""What plays in a process that `Processes` has begun."""


def _begin_worker(packed: bytes, parent: int) -> None:
    global _worker_play
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one that began it
    Thread(target=_end_with, args=(parent,), daemon=True).start()
    _worker_play = cloudpickle.loads(packed)()
    gc.freeze()  # loky collects garbage once a second: .15 s, of all that is imported by now


def _end_with(parent: int) -> None:
    """End this process as soon as its parent is gone, however that ended."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


def _play_in_worker(parameters: Float32Array, seed: int) -> Rollouts:
    return _worker_play(parameters, seed)
