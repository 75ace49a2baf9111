import io
import os
from pathlib import Path

import pytest

from curiosity_algos import CanonicalES, MAPElites
from curiosity_algos.experiments import Run, SaveRun, load_final_states, load_progress, load_runs
from curiosity_algos.experiments.loading import find_runs
from curiosity_algos.experiments.report import write_report


@pytest.fixture
def folder(make_model, make_easy_maze, tmp_path):
    for algorithm, seed in [(CanonicalES, 0), (CanonicalES, 1), (MAPElites, 0)]:
        run = SaveRun(tmp_path / algorithm.__name__ / f"{seed}")
        make_model(algorithm, make_easy_maze(), seed=seed).learn(600, run)
    return tmp_path


def test_runs_are_rows(folder):
    runs = load_runs(folder)
    assert runs["algorithm"].tolist() == ["CanonicalES", "CanonicalES", "MAPElites"]
    assert runs["seed"].tolist() == [0, 1, 0]
    assert runs["run"].tolist() == [
        str(folder / name) for name in ("CanonicalES/0", "CanonicalES/1", "MAPElites/0")
    ]
    assert runs["settings.sigma"].tolist() == [0.3] * 3
    assert (runs["timesteps"] >= 600).all()
    assert runs["coverage.all"].between(0, 1).all()


def test_folders_may_be_one_or_several(folder, monkeypatch):
    one, both = folder / "CanonicalES", [folder / "CanonicalES", folder / "MAPElites"]
    assert len(load_runs(str(one))) == len(load_runs(one)) == 2
    assert load_runs(both)["run"].tolist() == load_runs(folder)["run"].tolist()
    assert load_progress([one, folder]).equals(load_progress(folder))  # none of them twice
    monkeypatch.chdir(folder)
    assert len(load_runs([one, one.name])) == 2


def test_links_are_followed_and_none_in_a_circle(folder, tmp_path_factory):
    linked = tmp_path_factory.mktemp("linked")
    (linked / "one").symlink_to(folder / "CanonicalES")
    (linked / "again").symlink_to(linked)  # two of these would be followed 2^40 times
    runs = [run.relative_to(folder / "CanonicalES") for run in find_runs(folder / "CanonicalES")]
    assert find_runs(linked) == [linked / "one" / run for run in runs]
    assert len(runs) == 2


def test_checkpoints_may_come_and_go_meanwhile(folder, monkeypatch):
    gone = folder / "CanonicalES" / "0" / "checkpoints"

    def list_late(path, *args):
        if str(path) == str(gone):
            gone.rename(folder / "gone")
        return scandir(path, *args)

    scandir = os.scandir
    monkeypatch.setattr(os, "scandir", list_late)
    assert len(find_runs(folder)) == 3
    assert not gone.exists()


def test_a_run_that_was_not_saved_yet_is_a_row(folder):
    (folder / "new").mkdir()
    (folder / "new" / "run.json").write_text(
        '{"format": 1, "algorithm": "NSES", "env": null, "seed": 0}'
    )
    runs = load_runs(folder)
    assert runs[runs["algorithm"] == "NSES"]["timesteps"].isna().all()
    last = load_progress(folder).groupby("run")["time/total_timesteps"].max()
    assert last.to_dict() == runs.set_index("run")["timesteps"].dropna().to_dict()
    assert load_final_states(folder / "new") == {}


def test_there_must_be_runs(tmp_path):
    for load in (load_runs, load_progress):
        for folders in (tmp_path, [tmp_path], [], iter(())):
            with pytest.raises(FileNotFoundError, match="`folders` must hold runs"):
                load(folders)
    with pytest.raises(FileNotFoundError, match="`folder` must be that of a run"):
        load_final_states(tmp_path)


@pytest.fixture(scope="module")
def whole(make_runs):
    return make_runs(MAPElites, seeds=(0,))[0]


def test_a_report_reads_each_file_once(whole, tmp_path, monkeypatch):
    paths = []

    def note(file, *args):
        paths.append(str(file))
        return open_file(file, *args)

    open_file = io.open
    monkeypatch.setattr(io, "open", note)
    write_report(whole, tmp_path / "report.html")
    paths = [path for path in paths if path.startswith(str(whole))]
    assert {"run.json", "result.json", "progress.csv"} <= {Path(path).name for path in paths}
    assert len(paths) == len(set(paths))


def test_what_is_written_later_is_read_by_another(whole):
    run = Run(whole)
    n_rows = len(run.progress)
    with run.folder.progress.open("a") as log:
        log.write("9999\n")
    assert (len(run.progress), len(Run(whole).progress)) == (n_rows, n_rows + 1)
