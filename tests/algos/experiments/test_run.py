"""A run that is read."""

import io
from pathlib import Path

import pytest

from curiosity_algos import MAPElites
from curiosity_algos.experiments import Run
from curiosity_algos.experiments.report import write_report


@pytest.fixture(scope="module")
def folder(make_runs):
    return make_runs(MAPElites, seeds=(0,))[0]


@pytest.mark.extra("report")
def test_a_report_reads_each_file_once(folder, tmp_path, monkeypatch):
    paths = []

    def note(file, *args):
        paths.append(str(file))
        return open_file(file, *args)

    open_file = io.open
    monkeypatch.setattr(io, "open", note)
    write_report(folder, tmp_path / "report.html")
    paths = [path for path in paths if path.startswith(str(folder))]
    assert {"run.json", "result.json", "progress.csv"} <= {Path(path).name for path in paths}
    assert len(paths) == len(set(paths))


def test_what_is_written_later_is_read_by_another(folder):
    run = Run(folder)
    n_rows = len(run.progress)
    with run.folder.progress.open("a") as log:
        log.write("9999\n")
    assert (len(run.progress), len(Run(folder).progress)) == (n_rows, n_rows + 1)
