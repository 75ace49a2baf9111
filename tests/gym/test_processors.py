import pytest

from curiosity_gym import processors
from curiosity_gym.compiled import ThreadPool
from curiosity_gym.processors import available_cpus

V2, TIME, PERIOD = "cpu.max", "cpu/cpu.cfs_quota_us", "cpu/cpu.cfs_period_us"


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """Puts this process on a machine of eight processors, in a container of such files."""
    monkeypatch.setattr(processors.os, "sched_getaffinity", lambda _: range(8), raising=False)
    monkeypatch.setattr(processors, "CONTROL_GROUP", tmp_path)
    (tmp_path / "cpu").mkdir()

    def write(files):
        for name, text in files.items():
            (tmp_path / name).write_text(f"{text}\n")

    return write


@pytest.mark.parametrize(
    ("files", "n"),
    [
        ({}, 8),
        ({V2: "max 100000"}, 8),
        ({V2: "200000 100000"}, 2),
        ({V2: "250000 100000"}, 3),
        ({V2: "1000 100000"}, 1),
        ({V2: "1600000 100000"}, 8),
        ({V2: ""}, 8),
        ({TIME: "-1", PERIOD: "100000"}, 8),
        ({TIME: "400000", PERIOD: "100000"}, 4),
        ({TIME: "400000"}, 8),
    ],
    ids=str,
)
def test_a_container_has_the_processors_of_its_quota(machine, files, n):
    machine(files)
    assert available_cpus() == ThreadPool().n_threads == n
