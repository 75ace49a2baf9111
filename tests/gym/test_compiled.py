import multiprocessing
import os
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scripts import ROOT, run_python

from curiosity_gym.compiled import ThreadPool, compiled


@compiled
def add_index(values, begin, end):
    for i in range(begin, end):
        values[i] += i


def run_add_index(pool, n_items, n_slices):
    values = np.zeros(n_items)
    pool.run(lambda begin, end: add_index(values, begin, end), n_items, n_slices)
    return values


class TestThreadPool:
    def test_slices_cover_every_item_once(self):
        for n_threads in [None, 1, 2, 5]:
            for n_slices in [0, 1, 3, 50]:
                for n_items in [0, 1, 17]:
                    values = run_add_index(ThreadPool(n_threads), n_items, n_slices)
                    np.testing.assert_array_equal(values, np.arange(n_items))

    def test_errors_reach_the_caller(self):
        for n_threads in [1, 2]:

            def fail(begin, end):
                raise RuntimeError("slice")

            with pytest.raises(RuntimeError, match="slice"):
                ThreadPool(n_threads).run(fail, 4, 4)

    def test_runs_within_runs_end(self):
        pool, n_done = ThreadPool(2), []

        def outer(begin, end):
            pool.run(lambda *_: n_done.append(1), 2, 2)

        pool.run(outer, 2, 2)
        assert len(n_done) == 4

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


FACTOR = """
from curiosity_gym.compiled import compiled

@compiled
def factor():
    return {}
"""
SCALE = """
from curiosity_gym.compiled import compiled
from package.factor import factor

@compiled
def scale(value):
    return value * factor()
"""
SCALE_ONE = "from package.scale import scale; print(scale(1.0))"


def run_with(code, path, **variables):
    """What a fresh interpreter prints that finds packages in `path` first."""
    path = {"PYTHONPATH": os.pathsep.join(map(str, path))}
    return run_python(code, env={**os.environ, **path, **variables}, cwd="/").strip()


class TestMachineCodeOnDisk:
    @pytest.fixture
    def package(self, tmp_path):
        package = tmp_path / "package"
        package.mkdir()
        for name, text in {"__init__": "", "factor": FACTOR.format(2.0), "scale": SCALE}.items():
            (package / f"{name}.py").write_text(text)
        return package

    def test_is_loaded_until_an_inlined_function_has_changed(self, package):
        folder = {"NUMBA_CACHE_DIR": str(package.parent / "cache")}
        path = [package.parent, ROOT]
        code = f"{SCALE_ONE}; print(*map(len, (scale.stats.cache_hits, scale.stats.cache_misses)))"
        printed = [run_with(code, path, **folder) for _ in range(2)]
        assert printed == ["2.0\n0 1", "2.0\n1 0"]
        factor = package / "factor.py"
        before = factor.stat()
        factor.write_text(FACTOR.format(3.0))
        # As from an archive or another checkout: the change is no newer than the machine code.
        os.utime(factor, ns=(before.st_atime_ns, before.st_mtime_ns - 10**10))
        for index in package.parent.rglob("*.nbi"):  # of a class that is not there any more
            with index.open("rb+") as file:
                pickle.load(file)
                file.write(b"cgone\nGone\n.")
        assert run_with(SCALE_ONE, path, **folder) == "3.0"

    def test_is_not_kept_for_modules_outside_packages(self, tmp_path):
        folder = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        (tmp_path / "scale.py").write_text(SCALE.replace("package.", ""))
        for factor in (2.0, 3.0):
            (tmp_path / "factor.py").write_text(FACTOR.format(factor))
            printed = run_with(SCALE_ONE.replace("package.", ""), [tmp_path, ROOT], **folder)
            assert printed == str(factor)
