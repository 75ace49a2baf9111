"""A sweep on a Ray cluster comes to what one on this machine comes to."""

import contextlib
import glob
import os
import signal
import threading
import time

import pytest

from curiosity_algos.experiments import load_runs
from curiosity_algos.experiments.sweep import Processes, grid, sweep
from curiosity_algos.experiments.training import train

pytestmark = pytest.mark.extra("ray")
ray = pytest.importorskip("ray")
# What follows cannot be imported without it: hence the E402.

from curiosity_algos.experiments.ray_sweep import RayBackend  # noqa: E402

SETTINGS = {"population_size": 6, "policy_kwargs": {"net_arch": [4]}}
RESULTS = ["algorithm", "env", "seed", "timesteps", "best_return", "coverage.all"]


@pytest.fixture(autouse=True, scope="module")
def _cluster():
    ray.init("local", num_cpus=2, include_dashboard=False, log_to_driver=False)
    yield
    ray.shutdown()


def make_runs(n_timesteps=1200, **settings):
    return grid(
        ["map_elites"],
        ["CuriosityMaze-US-v0"],
        [0, 1, 2],
        timesteps=n_timesteps,
        env_kwargs={"horizon": 50},
        settings=SETTINGS | settings,
    )


def results(folder):
    return load_runs(folder).sort_values("seed")[RESULTS].to_numpy().tolist()


def test_it_tells_how_runs_ended(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    here, there = tmp_path / "here", tmp_path / "there"
    sweep(make_runs(), here, backend=Processes(1))
    train(make_runs()[2], make_runs()[2].folder(there))
    capsys.readouterr()
    sweep(make_runs(), there.relative_to(tmp_path), backend=RayBackend())
    assert capsys.readouterr().out.count("best return") == 2  # the third was finished
    assert results(there) == results(here)


def test_one_that_fails_does_not_stop_the_others(tmp_path):
    runs = [*make_runs()[:2], *make_runs(population_size="many")[2:]]
    with pytest.raises(ValueError, match=r"^1 of 3 runs failed: .*2: `population_size`"):
        sweep(runs, tmp_path, backend=RayBackend())
    assert load_runs(tmp_path)["seed"].tolist() == [0, 1]


def test_a_run_whose_process_is_killed_goes_on(tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    runs = make_runs(60_000)[:1]
    sweep(runs, here, backend=Processes(1))
    pids, ended = set(), threading.Event()

    def kill():
        """Kill the process that holds the run's folder, once it has saved a checkpoint."""
        folder = runs[0].folder(there)
        while not list(folder.glob("checkpoints/*")) and not ended.is_set():
            time.sleep(0.01)
        for process in filter(str.isdigit, os.listdir("/proc")):
            if int(process) != os.getpid() and has_open(process, folder):
                pids.add(process)
                os.kill(int(process), signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        sweep(runs, there, backend=RayBackend(), interval=0.05)
    finally:
        ended.set()
        killer.join()
    assert len(pids) == 1
    assert results(there) == results(here)


def has_open(process, folder):
    """Whether a process has a file open in a folder, as that of a run has its lock."""
    for descriptor in glob.glob(f"/proc/{process}/fd/*"):
        with contextlib.suppress(OSError):  # closed since
            if os.readlink(descriptor).startswith(str(folder)):
                return True
    return False


def test_errors_name_the_argument():
    with pytest.raises(ValueError, match="`num_cpus` must be"):
        RayBackend(num_cpus=0)
