"""What the figures and the report read of runs."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest

from curiosity_algos import CMAME, NSES, NSLC, MAPElites
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.measures import (
    best_return,
    coverage,
    first_of,
    in_seconds,
    load_compared,
    times_to_first,
    with_archives,
)
from curiosity_algos.experiments.run_folder import RunFolder


@pytest.fixture(scope="module")
def runs(make_runs):
    return make_runs(MAPElites)


def change(folder, **changes):
    path = folder / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


@pytest.fixture
def copied(runs, tmp_path):
    """Two runs, to be changed."""
    for i, run in enumerate(runs):
        shutil.copytree(run, tmp_path / f"{i}")
    return [tmp_path / "0", tmp_path / "1"]


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({}, ["CuriosityMaze-US-v0", "CuriosityMaze-US-v0"]),
        (
            {"env_kwargs": {"layout": "us", "horizon": 100, "goal_radius": 91.5}},
            ["CuriosityMaze-US-v0, horizon 100", "CuriosityMaze-US-v0, horizon 60"],
        ),
        (
            {"wrappers": {"RepeatAction": {"num_repeats": 10}}},
            [f"CuriosityMaze-US-v0, RepeatAction.num_repeats {n}" for n in (10, "none")],
        ),
        ({"env": None, "env_class": "Own"}, ["Own", "CuriosityMaze-US-v0"]),
    ],
)
def test_environments_are_distinguished_by_what_differs(changes, names, copied):
    change(copied[0], **changes)
    assert load_compared(copied)["env"].tolist() == names


def test_a_seed_counts_once(copied):
    assert not load_compared(copied)["is_repeated"].any()
    change(copied[1], seed=0)
    (checkpoint,) = copied[0].glob("checkpoints/*")
    known = json.loads((checkpoint / "result.json").read_text())
    for timesteps, repeated in ((10, [True, False]), (10**9, [False, True])):
        (checkpoint / "result.json").write_text(json.dumps(known | {"timesteps": timesteps}))
        assert load_compared(copied)["is_repeated"].tolist() == repeated


def test_runs_without_a_seed_or_with_other_settings_are_no_repetition(copied):
    for run in copied:
        change(run, seed=None)
    assert not load_compared(copied)["is_repeated"].any()
    for n_envs, run in enumerate(copied):
        change(run, seed=0, vec_env={"n_envs": n_envs, "wrappers": {}})
    runs = load_compared(copied)
    assert runs["label"].tolist() == ["MAPElites, n_envs 0", "MAPElites, n_envs 1"]
    assert not runs["is_repeated"].any()


def table(success, reward, best):
    found = {"first_success_timesteps": success, "first_reward_timesteps": reward}
    return pd.DataFrame(found | {"best_return": best})


def test_a_task_shows_what_there_is_to_find():
    nan = float("nan")
    assert first_of(table([5.0, nan], [5.0, 3.0], [1.0, 0.0])) == "success"
    assert first_of(table([nan, nan], [nan, 4.0], [0.0, 0.5])) == "reward"
    assert first_of(table([nan, nan], [nan, nan], [0.0, nan])) == "success"  # that is: none yet
    assert first_of(table([nan], [nan], [-9.0])) is None


@pytest.mark.parametrize("event", ["success", "reward"])
def test_firsts_in_timesteps_and_seconds(copied, event):
    for run in copied:  # a clock of their own: else one may end before the other comes to 600
        end = RunFolder(run).result()["timesteps"]
        log = f"time/total_timesteps,time/seconds\n{end},{end / 1000}\n"
        (run / "progress.csv").write_text(log)
    runs = load_compared(copied)
    runs[f"first_{event}_timesteps"] = [600.0, np.nan]
    for x, first in [("timesteps", 600.0), ("seconds", pytest.approx(0.6))]:
        curve = times_to_first(runs, event, x).curve
        assert (curve.x[1], curve.estimate[1]) == (first, 0.5)
        assert curve.estimate[-1] == 0.5


def test_rows_that_lack_what_is_read_are_left_out(copied):
    timesteps, shares = expected = coverage(Run(copied[0]))
    progress = Run(copied[0]).progress
    assert timesteps.tolist() == [0.0, *progress["time/total_timesteps"]]
    assert shares.tolist() == [0.0, *progress["coverage/reachable"]]
    seconds = in_seconds(Run(copied[0]), timesteps)
    assert seconds.tolist() == [0.0, *progress["time/seconds"]]
    log = copied[0] / "progress.csv"
    rows = pd.read_csv(log)
    foreign = rows.assign(**{"coverage/reachable": np.nan, "eval/mean_reward": 1.0})
    pd.concat([foreign, rows.assign(**{"time/seconds": np.nan})]).sort_values(
        "time/total_timesteps", kind="stable"
    ).to_csv(log, index=False)
    np.testing.assert_array_equal(coverage(Run(copied[0])), expected)
    np.testing.assert_allclose(in_seconds(Run(copied[0]), timesteps), seconds)


def test_seconds_are_known_to_the_end_without_a_log(copied):
    result = RunFolder(copied[0]).result()
    (copied[0] / "progress.csv").write_text("time/total_timesteps,time/seconds\n")
    half = in_seconds(Run(copied[0]), [0.0, result["timesteps"] / 2, result["timesteps"]])
    np.testing.assert_allclose(half, [0.0, result["seconds"] / 2, result["seconds"]])


def test_the_best_return_so_far_is_that_of_the_generations(runs):
    run = Run(runs[0])
    states = run.final_states
    assert states["return"].max() > 0.0
    timesteps, best = best_return(run)
    generations = np.unique(states["generation"])
    assert len(timesteps) == len(best) == len(generations)
    for i, generation in enumerate(generations):
        members = states["generation"] == generation
        assert timesteps[i] == states["timesteps"][members][0]
        assert best[i] == states["return"][states["generation"] <= generation].max()


def test_a_run_that_has_just_begun_has_no_return_and_is_at_0(tmp_path):
    RunFolder(tmp_path).begin({"algorithm": "TD3ICM", "env": "CuriosityMaze-US-v0", "seed": 0})
    run = Run(tmp_path)
    with pytest.raises(ValueError, match=r"final states of .* are missing"):
        best_return(run)
    assert [values.tolist() for values in coverage(run)] == [[0.0], [0.0]]
    assert in_seconds(run, [0.0]).tolist() == [0.0]


@pytest.fixture(scope="module")
def archived(make_runs):
    """Of each algorithm two runs; of MAPElites also one on a coarser grid."""
    small = {"n_parents": 2, "k": 3}
    folders = [
        *(make_runs(MAPElites) + make_runs(CMAME) + make_runs(MAPElites, seeds=(0,), n_cells=5)),
        *(make_runs(NSLC, **small) + make_runs(NSES, **small)),
    ]
    return load_compared(folders)


def panels(archived):
    """By archive the labels of its runs; without the environment, which all have."""
    found = with_archives(archived).groupby("archive")["label"]
    return {str(name).split(", ", 1)[1]: sorted(set(labels)) for name, labels in found}


def test_the_same_cells_are_one_archive_and_elites_without_cells_are_each_labels_own(archived):
    coarse, fine = (f"MAPElites, n_cells {n}" for n in (5, 50))
    assert panels(archived) == {
        "SparseGridArchive, dims [50, 50, 50, 50]": ["CMAME", fine],
        "SparseGridArchive, dims [5, 5, 5, 5]": [coarse],
        "UnstructuredArchive of NSLC": ["NSLC"],
    }
    assert panels(archived[archived["label"] != coarse]) == {
        "SparseGridArchive": ["CMAME", fine],
        "UnstructuredArchive of NSLC": ["NSLC"],
    }
    assert with_archives(archived[archived["algorithm"] == "NSES"]).empty
