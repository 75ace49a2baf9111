import signal
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
