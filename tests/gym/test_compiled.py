import multiprocessing
import os
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from curiosity_gym.compiled import ThreadPool, compiled
from curiosity_gym.processors import available_cpus


@compiled
def add_index(values, begin, end):
    for i in range(begin, end):
        values[i] += i


def run_add_index(pool, n_items, n_slices):
    values = np.zeros(n_items)
    pool.run(lambda begin, end: add_index(values, begin, end), n_items, n_slices)
    return values


class TestThreadPool:
    @pytest.mark.parametrize("n_threads", [None, 1, 2, 5])
    @pytest.mark.parametrize("n_slices", [0, 1, 3, 50])
    @pytest.mark.parametrize("n_items", [0, 1, 17])
    def test_slices_cover_every_item_once(self, n_threads, n_slices, n_items):
        values = run_add_index(ThreadPool(n_threads), n_items, n_slices)
        np.testing.assert_array_equal(values, np.arange(n_items))

    def test_uses_the_processors_that_there_are(self):
        assert ThreadPool().n_threads == available_cpus() >= 1

    @pytest.mark.parametrize("n_threads", [0, -1])
    def test_rejects_less_than_one_thread(self, n_threads):
        with pytest.raises(ValueError, match="n_threads"):
            ThreadPool(n_threads)

    @pytest.mark.parametrize("n_threads", [1, 2])
    def test_errors_reach_the_caller(self, n_threads):
        def fail(begin, end):
            raise RuntimeError("slice")

        with pytest.raises(RuntimeError, match="slice"):
            ThreadPool(n_threads).run(fail, 4, 4)

    def test_pickles_after_use(self):
        pool = ThreadPool(2)
        run_add_index(pool, 4, 4)
        copy = pickle.loads(pickle.dumps(pool))
        np.testing.assert_array_equal(run_add_index(copy, 4, 4), np.arange(4))

    @pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
    def test_works_in_a_forked_child_after_use_in_the_parent(self):
        pool = ThreadPool(2)
        run_add_index(pool, 8, 4)
        context = multiprocessing.get_context("fork")
        queue = context.SimpleQueue()
        child = context.Process(target=lambda: queue.put(run_add_index(pool, 8, 4)))
        child.start()
        child.join(timeout=60)
        assert child.exitcode == 0
        np.testing.assert_array_equal(queue.get(), np.arange(8))


def test_compiled_functions_may_run_concurrently():
    with ThreadPoolExecutor(4) as executor:
        results = list(executor.map(lambda _: run_add_index(ThreadPool(2), 100, 8), range(20)))
    for values in results:
        np.testing.assert_array_equal(values, np.arange(100))
