"""Environments on several processes: the same bits."""

import gc
import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from walks import Alarmed, Walk

from curiosity_algos import CanonicalES, make_evaluator


class Doubled(gym.Wrapper):
    """A wrapper of a script, whose class no other process can import; it leaves a file if open."""

    __module__ = "__main__"

    def __init__(self, env, folder):
        gym.Wrapper.__init__(self, env)
        self._file = Path(folder, f"{os.getpid()}-{id(self)}")
        self._file.touch()

    def close(self):
        self._file.unlink()

    def step(self, action):
        observation, reward, *rest = self.env.step(action)
        return observation, 2.0 * reward, *rest


def make_parameters(evaluator, n=7):
    return np.random.default_rng(0).normal(0, 2, (n, evaluator.n_parameters)).astype(np.float32)


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_for_the_end_of(pids, seconds=30.0):
    deadline = time.monotonic() + seconds
    while any(map(is_running, pids)) and time.monotonic() < deadline:
        time.sleep(0.1)
    return not any(map(is_running, pids))


def pids_of(evaluator):
    pool = evaluator._processes._pool
    return [] if pool is None else list(pool._processes)


class TestSameBits:
    def test_of_rollouts(self, assert_same_rollouts, tmp_path):
        def make():
            return Doubled(Walk(), tmp_path)

        apart, alone = (make_evaluator(make, n_threads=n) for n in (2, None))
        parameters = make_parameters(alone, 70)
        for seed, n in ((3, 70), (4, 1), (5, 7), (6, 70)):
            expected = alone.evaluate(parameters[:n], seed)
            assert_same_rollouts(apart.evaluate(parameters[:n], seed), expected)
        assert len(pids_of(apart)) == 2
        # Wherever they are, all of them are closed.
        assert len(list(tmp_path.iterdir())) == 1 + 2 * 16 + 16
        for evaluator in (apart, alone):
            evaluator.close()
        assert list(tmp_path.iterdir()) == []

    def test_of_a_search(self, make_model, tmp_path):
        """By an id that nobody knows in the processes, and that is unknown here by then."""
        gym.register("Registered-v0", entry_point=lambda: Doubled(Walk(), tmp_path))
        alone, apart = (make_model(CanonicalES, "Registered-v0", n_threads=n) for n in (None, 2))
        gym.registry.pop("Registered-v0")
        for model in (alone, apart):
            model.learn(1000)
        assert len(pids_of(apart.evaluator)) == 2
        assert alone.num_timesteps == apart.num_timesteps
        assert alone.best_return == apart.best_return != 0.0
        np.testing.assert_array_equal(alone.policy.vector, apart.policy.vector)


def test_what_cannot_be_sent_is_refused():
    lock = threading.Lock()
    with pytest.raises(ValueError, match="`env` must be an id, or a function that can be pickled"):
        make_evaluator(lambda: (lock, Walk())[1], n_threads=2)


def test_without_a_seed_or_company_this_process_plays():
    evaluator = make_evaluator(Walk, n_threads=2)
    parameters = np.repeat(make_parameters(evaluator, 1), 6, axis=0)
    starts = evaluator.evaluate(parameters).observations[:, 0]
    assert len(np.unique(starts)) == 6
    evaluator.evaluate(parameters[:1], 0)
    assert pids_of(evaluator) == []


def test_processes_end_with_their_evaluator_as_garbage_that_waits_for_none(monkeypatch):
    evaluator = make_evaluator(Walk, n_threads=2)
    evaluator.evaluate(make_parameters(evaluator), 0)
    pids = pids_of(evaluator)
    assert all(map(is_running, pids))
    joined = []
    monkeypatch.setattr(threading.Thread, "join", lambda self, *_: joined.append(self.name))
    del evaluator
    gc.collect()
    assert joined == []
    monkeypatch.undo()
    assert wait_for_the_end_of(pids)


class TestFaults:
    def test_are_told_and_the_next_goes_on(self, tmp_path, assert_same_rollouts):
        alarm = tmp_path / "alarm"
        make = partial(Alarmed, alarm, os.getpid())
        apart, alone = (make_evaluator(make, n_threads=n) for n in (2, None))
        parameters = make_parameters(alone)
        alarm.write_text("die")
        with pytest.raises(RuntimeError, match="`env` has ended a process that played it"):
            apart.evaluate(parameters, 0)
        assert pids_of(apart) == []
        alarm.write_text("odd")
        for shard in apart._processes._submit(parameters, 0):  # which leaves the processes alone
            with pytest.raises(RuntimeError, match="OddError: the 3rd"):
                shard.result()
        alarm.write_text("raise")
        with pytest.raises(ValueError, match="`env` is out of order"):
            apart.evaluate(parameters, 0)
        assert pids_of(apart) == []
        alarm.unlink()
        assert_same_rollouts(apart.evaluate(parameters, 1), alone.evaluate(parameters, 1))

    @pytest.mark.skipif(not os.path.exists("/proc/self/stat"), reason="asks Linux for processes")
    @pytest.mark.parametrize(
        "end", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.nightly)]
    )
    def test_processes_end_with_a_script_that_has_no_guard(self, tmp_path, end):
        script = tmp_path / "script.py"
        script.write_text(
            "import time\n"
            "import gymnasium as gym\n"
            "from curiosity_algos import CanonicalES\n"
            "make = lambda: gym.make('Pendulum-v1', max_episode_steps=20)\n"
            "model = CanonicalES(make, n_threads=2).learn(1000)\n"
            "print(*model.evaluator._processes._pool._processes, flush=True)\n"
            "time.sleep(600)\n"
        )
        with subprocess.Popen(
            [sys.executable, script], stdout=subprocess.PIPE, start_new_session=True
        ) as started:
            pids = [int(word) for word in started.stdout.readline().split()]
            (os.killpg if end == signal.SIGINT else os.kill)(started.pid, end)
            assert started.wait(60) != 0
        assert len(pids) == 2
        assert wait_for_the_end_of(pids)
