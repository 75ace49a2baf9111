import signal
import subprocess
import sys
import threading

import pytest

from curiosity_algos.common.interrupt import deferred_interrupt


def interrupt(reached, n_times):
    with deferred_interrupt("the test"):
        for i in range(n_times):
            signal.raise_signal(signal.SIGINT)
            reached.append(i + 1)


@pytest.mark.parametrize("n_times", [1, 2])
def test_ctrl_c_says_that_it_waits_for_the_end_of_the_block_and_a_second_does_not(capsys, n_times):
    reached = []
    with pytest.raises(KeyboardInterrupt):
        interrupt(reached, n_times)
    assert reached == [1]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    line = "Ctrl-C: waiting for the end of the test; press it again to stop at once.\n"
    assert capsys.readouterr().err == line


def test_a_handler_of_the_user_stays_in_charge(monkeypatch):
    received = []
    previous = signal.signal(signal.SIGINT, lambda number, frame: received.append(number))
    try:
        with deferred_interrupt("the test"):
            signal.raise_signal(signal.SIGINT)
            assert received == [signal.SIGINT]
    finally:
        signal.signal(signal.SIGINT, previous)


def test_other_threads_leave_signals_alone():
    reached = []

    def work():
        with deferred_interrupt("the test"):
            reached.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert reached == [signal.default_int_handler]


HANG = """
import sys, time
import gymnasium as gym
from curiosity_algos import CanonicalES

class Hanging(gym.Env):
    observation_space = gym.spaces.Box(-1, 1, (2,))
    action_space = gym.spaces.Box(-1, 1, (1,))

    def reset(self, *, seed=None, options=None):
        return self.observation_space.sample(), {}

    def step(self, action):
        print("steps", flush=True)
        while True:
            time.sleep(0.01)

CanonicalES(Hanging, device="cpu").learn(1000)
"""


def test_a_hanging_env_is_left_by_the_second_ctrl_c():
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen([sys.executable, "-W", "ignore", "-c", HANG], **pipes)
    try:
        assert process.stdout.readline() == "steps\n"
        process.send_signal(signal.SIGINT)
        assert process.stderr.readline().startswith("Ctrl-C: waiting for the end of the ")
        process.send_signal(signal.SIGINT)
        assert process.stderr.read().endswith("KeyboardInterrupt\n")
        process.wait()
    finally:
        process.kill()
