"""Models of two threads do not learn at once: what is the process' would be of both."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from curiosity_algos import CuriosityES


def in_a_thread(function):
    """The error that a function ends with in a thread of its own."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(function).exception()


def test_a_second_model_is_refused_and_neither_run_changes(
    make_model, make_easy_maze, assert_same_run
):
    first, second, alone = (make_model(CuriosityES, make_easy_maze()) for _ in range(3))
    refused = []

    def learn_beside(locals_, globals_):
        refused.append(in_a_thread(lambda: second.learn(64)))
        return True

    first.learn(64, callback=learn_beside)
    assert {type(error) for error in refused} == {RuntimeError}
    assert str(refused[0]).startswith("One model learns at a time in a process")
    alone.learn(64)
    assert_same_run(first, alone)
    assert in_a_thread(lambda: second.learn(64)) is None
    assert_same_run(second, alone)


def test_a_callback_may_train_another(make_model, make_easy_maze, assert_same_run):
    outer, alone = (make_model(CuriosityES, make_easy_maze()).learn(1) for _ in range(2))
    inner = []

    def train_another(locals_, globals_):
        if not inner:
            inner.append(make_model(CuriosityES, make_easy_maze()).learn(64))
        return True

    outer.learn(128, callback=train_another, reset_num_timesteps=False)
    alone.learn(128, reset_num_timesteps=False)
    assert_same_run(outer, alone)
    assert_same_run(inner[0], make_model(CuriosityES, make_easy_maze()).learn(64))


def test_an_error_lets_the_next_one_learn(make_model, make_easy_maze):
    def fail(locals_, globals_):
        raise ZeroDivisionError

    model = make_model(CuriosityES, make_easy_maze())
    with pytest.raises(ZeroDivisionError):
        model.learn(1, callback=fail)
    assert in_a_thread(lambda: model.learn(1)) is None
