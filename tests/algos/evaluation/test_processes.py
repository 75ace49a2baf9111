"""A single environment on several processes: the same bits, or none of them."""

import copy
import gc
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from multiprocessing import get_context
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import walks
from gymnasium.vector import SyncVectorEnv
from walks import Alarmed, Client, Curriculum, Elsewhere, Failing, Locked, Scaled, Walk

from curiosity_algos import CanonicalES, make_evaluator
from curiosity_algos.evaluation import processes


@pytest.fixture
def eager(monkeypatch):
    """Processes are tried at once, and pay."""
    monkeypatch.setattr(processes, "PATIENCE", 0.0)
    monkeypatch.setattr(processes, "GAIN", 0.0)


class Doubled(gym.Wrapper):
    """A wrapper of a script, whose class no other process can import."""

    __module__ = "__main__"

    def step(self, action):
        observation, reward, *rest = self.env.step(action)
        return observation, 2.0 * reward, *rest


def make_light():
    env = gym.make("Pendulum-v1", max_episode_steps=30)
    env.unwrapped.g = 3.0
    return env


def make_parameters(evaluator, n=7):
    return np.random.default_rng(0).normal(0, 2, (n, evaluator.n_parameters)).astype(np.float32)


def make_pair(env):
    """Evaluators that may use two processes, and that may not."""
    return make_evaluator(env, n_threads=2), make_evaluator(copy.deepcopy(env), n_threads=1)


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
    return list(evaluator._processes._pool._processes)


@pytest.mark.usefixtures("eager")
class TestSameBits:
    @pytest.mark.parametrize(
        "make_env",
        [Walk, make_light, lambda: Doubled(Walk())],
        ids=["of a module", "changed", "of a script"],
    )
    def test_of_rollouts(self, make_env, assert_same_rollouts):
        apart, alone = make_pair(make_env())
        parameters = make_parameters(alone, 70)
        for seed, n in ((3, 70), (4, 1), (5, 7), (6, 70)):
            expected = alone.evaluate(parameters[:n], seed)
            assert_same_rollouts(apart.evaluate(parameters[:n], seed), expected)
            assert (apart.n_processes, alone.n_processes) == (2, 1)

    def test_of_a_search(self, make_model):
        alone, apart = (make_model(CanonicalES, Walk(), n_threads=n) for n in (1, 2))
        for model in (alone, apart):
            model.learn(3000)
        assert (alone.evaluator.n_processes, apart.evaluator.n_processes) == (1, 2)
        assert alone.num_timesteps == apart.num_timesteps
        for one, other in zip(*(each.policy.parameters() for each in (alone, apart)), strict=True):
            assert (one == other).all()

    def test_of_copies_which_begin_their_own(self, assert_same_rollouts):
        evaluator = make_evaluator(Walk(), n_threads=2)
        parameters = make_parameters(evaluator)
        expected = evaluator.evaluate(parameters, 0)
        twin = pickle.loads(pickle.dumps(evaluator))
        assert (evaluator.n_processes, twin.n_processes) == (2, 1)
        assert_same_rollouts(twin.evaluate(parameters, 0), expected)
        assert not set(pids_of(twin)) & set(pids_of(evaluator))


class TestAlone:
    def test_until_processes_are_worth_their_start(self):
        evaluator = make_evaluator(Walk(), n_threads=2)
        evaluator.evaluate(make_parameters(evaluator), 0)
        assert evaluator.n_processes == 1

    def test_where_they_are_not_faster(self, eager, monkeypatch, assert_same_rollouts):
        monkeypatch.setattr(processes, "GAIN", np.inf)
        apart, alone = make_pair(Walk())
        parameters = make_parameters(alone)
        for seed in (0, 1):
            expected = alone.evaluate(parameters, seed)
            assert_same_rollouts(apart.evaluate(parameters, seed), expected)
            assert apart.n_processes == 1

    @pytest.mark.parametrize(
        "make_env",
        [
            Elsewhere,  # comes to something else there
            Locked,  # cannot be pickled
            Failing,  # fails there
            lambda: Curriculum(30),  # has played fewer episodes there
            Client,  # is connected here alone
        ],
    )
    def test_where_they_cannot_be_the_same(self, eager, make_env, assert_same_rollouts):
        apart, alone = (make_evaluator(make_env(), n_threads=n) for n in (2, 1))
        parameters = make_parameters(alone)
        for seed in range(8):
            expected = alone.evaluate(parameters, seed)
            assert_same_rollouts(apart.evaluate(parameters, seed), expected)
            assert apart.n_processes == 1

    def test_without_a_seed(self, eager):
        evaluator = make_evaluator(Walk(), n_threads=2)
        parameters = np.repeat(make_parameters(evaluator, 1), 6, axis=0)
        starts = evaluator.evaluate(parameters).observations[:, 0]
        assert len(np.unique(starts)) == 6
        assert evaluator.n_processes == 1

    def test_without_n_threads(self, eager):
        evaluator = make_evaluator(Walk())
        for seed in (0, 1):
            evaluator.evaluate(make_parameters(evaluator), seed)
        assert evaluator.n_processes == 1

    def test_for_a_handful_of_policies_which_decide_nothing(self, eager):
        evaluator = make_evaluator(Walk(), n_threads=2)
        parameters = make_parameters(evaluator)
        evaluator.evaluate(parameters[:3], 0)
        assert evaluator.n_processes == 1
        evaluator.evaluate(parameters, 0)
        assert evaluator.n_processes == 2

    def test_where_processes_hang(self, eager, monkeypatch, tmp_path, assert_same_rollouts):
        monkeypatch.setattr(processes, "DEADLINE", 1.0)
        env = Alarmed(tmp_path / "alarm")
        env.alarm.write_text("hang")
        apart, alone = make_pair(env)
        parameters = make_parameters(alone)
        expected = alone.evaluate(parameters, 0)
        assert_same_rollouts(apart.evaluate(parameters, 0), expected)
        assert apart.n_processes == 1

    def test_in_a_daemonic_process(self, eager):
        process = get_context("spawn").Process(target=walks.play, daemon=True)
        process.start()
        process.join(60)
        assert process.exitcode == 0

    def test_in_vector_environments(self, eager):
        evaluator = make_evaluator(SyncVectorEnv([Walk] * 2), n_threads=2)
        evaluator.evaluate(make_parameters(evaluator), 0)
        assert evaluator.n_processes == 1


@pytest.mark.usefixtures("eager")
class TestFaults:
    def test_a_process_that_was_killed_is_done_without(self, tmp_path, assert_same_rollouts):
        env = Alarmed(tmp_path / "alarm")
        apart, alone = make_pair(env)
        parameters = make_parameters(alone)
        apart.evaluate(parameters, 0)
        assert apart.n_processes == 2
        env.alarm.write_text("die")
        with pytest.warns(UserWarning, match="`env` has ended a process that played it"):
            rollouts = apart.evaluate(parameters, 1)
        assert_same_rollouts(rollouts, alone.evaluate(parameters, 1))
        assert apart.n_processes == 1

    def test_what_has_changed_since_the_trial_is_seen(self, monkeypatch, assert_same_rollouts):
        apart, alone = make_pair(Scaled())
        parameters = make_parameters(alone)
        apart.evaluate(parameters, 0)
        assert apart.n_processes == 2
        monkeypatch.setitem(walks.SETTINGS, "scale", 1.5)
        with pytest.warns(UserWarning, match="`env` comes to something else on processes"):
            rollouts = apart.evaluate(parameters, 1)
        assert_same_rollouts(rollouts, alone.evaluate(parameters, 1))
        assert apart.n_processes == 1

    @pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks")
    def test_a_fork_begins_its_own(self):
        evaluator = make_evaluator(Walk(), n_threads=2)
        parameters = make_parameters(evaluator)
        evaluator.evaluate(parameters, 0)
        child = get_context("fork").Process(target=evaluator.evaluate, args=(parameters[:1], 0))
        child.start()
        child.join(60)
        assert child.exitcode == 0
        assert evaluator.n_processes == 2
        evaluator.evaluate(parameters, 1)

    def test_an_error_that_cannot_be_sent_is_told(self, tmp_path):
        env = Alarmed(tmp_path / "alarm")
        apart, _ = make_pair(env)
        apart.evaluate(make_parameters(apart), 0)
        env.alarm.write_text("odd")
        with pytest.raises(RuntimeError, match="OddError: the 3rd"):
            apart.evaluate(make_parameters(apart), 0)

    def test_an_error_is_the_environments(self, tmp_path, assert_same_rollouts):
        env = Alarmed(tmp_path / "alarm")
        apart, alone = make_pair(env)
        parameters = make_parameters(alone)
        apart.evaluate(parameters, 0)
        pids = pids_of(apart)
        env.alarm.write_text("raise")
        with pytest.raises(ValueError, match="`env` is out of order"):
            apart.evaluate(parameters, 1)
        assert wait_for_the_end_of(pids)
        env.alarm.unlink()
        assert_same_rollouts(apart.evaluate(parameters, 1), alone.evaluate(parameters, 1))
        assert apart.n_processes == 2

    def test_processes_end_with_their_evaluator(self):
        evaluator = make_evaluator(Walk(), n_threads=2)
        evaluator.evaluate(make_parameters(evaluator), 0)
        pids = pids_of(evaluator)
        assert all(map(is_running, pids))
        del evaluator
        gc.collect()
        assert wait_for_the_end_of(pids)

    def test_garbage_waits_for_no_thread(self, monkeypatch):
        evaluator = make_evaluator(Walk(), n_threads=2)
        evaluator.evaluate(make_parameters(evaluator), 0)
        pids, joined = pids_of(evaluator), []
        monkeypatch.setattr(threading.Thread, "join", lambda self, *_: joined.append(self.name))
        del evaluator
        gc.collect()
        assert joined == []
        monkeypatch.undo()
        assert wait_for_the_end_of(pids)

    @pytest.mark.skipif(not os.path.exists("/proc/self/stat"), reason="asks Linux for processes")
    @pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT])
    def test_processes_end_with_a_script_that_has_no_guard(self, tmp_path, end):
        script = tmp_path / "script.py"
        script.write_text(
            "import time\n"
            "import gymnasium as gym\n"
            "from curiosity_algos import CanonicalES\n"
            "from curiosity_algos.evaluation import processes\n"
            "processes.PATIENCE = processes.GAIN = 0.0\n"
            "class Same(gym.Wrapper):\n"
            "    pass\n"
            "env = Same(gym.make('Pendulum-v1', max_episode_steps=20))\n"
            "model = CanonicalES(env, n_threads=2).learn(1000)\n"
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
