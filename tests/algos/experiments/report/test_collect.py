import json
import shutil

import numpy as np
import pytest

from curiosity_algos.experiments import load_runs
from curiosity_algos.experiments.report.collect import collect


def change(folder, **changes):
    path = folder / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


@pytest.fixture
def copied(runs_folder, tmp_path):
    """The runs of NSES alone, to be changed."""
    shutil.copytree(runs_folder / "NSES", tmp_path / "NSES")
    return tmp_path / "NSES" / "CuriosityMaze-Hard-v0"


def test_runs_are_grouped_by_environment(maze, mountain):
    assert maze.title == "CuriosityMaze-Hard-v0"
    assert maze.labels == ["CuriosityES", "NSES", "TD3ICM"]
    assert [run.seed for run in maze.of("NSES")] == ["0", "1"]
    assert mountain.labels == ["MAPElites"]


def test_a_run_without_checkpoint_is_named(maze):
    (path,) = maze.not_begun
    assert path.endswith("has_not_begun")


def test_a_run_that_is_found_twice_counts_once(runs_folder, maze):
    environments = collect([runs_folder, runs_folder / ".." / runs_folder.name / "NSES"])
    assert len(environments[0].runs) == len(maze.runs)


def test_environments_of_one_name_are_told_apart_by_their_keywords(copied):
    change(copied / "0", env_kwargs={"layout": "hard", "horizon": 100})
    first, second = collect([copied])
    assert first.title == "CuriosityMaze-Hard-v0, horizon 100, max_episode_steps not given"
    assert second.title == "CuriosityMaze-Hard-v0, horizon 50, max_episode_steps null"


def test_an_environment_without_an_id_goes_by_its_class(copied):
    for path in copied.iterdir():
        change(path, env=None, env_class="Own")
    (environment,) = collect([copied])
    assert environment.title == "Own"
    assert environment.labels == ["NSES"]


def test_runs_of_one_seed_are_numbered(copied):
    change(copied / "1", seed=0)
    (environment,) = collect([copied])
    assert [run.seed for run in environment.runs] == ["0", "0 (2)"]


def test_the_log_ends_with_the_checkpoint(maze):
    for run in maze.runs:
        assert run.log["timesteps"][-1] <= run.result["timesteps"]
        assert run.log["best_return"].tolist() == [0.0] * len(run.log["timesteps"])
    run = maze.of("CuriosityES")[0]
    assert run.log["coverage"][-1] == pytest.approx(run.coverage)


def test_best_return_is_that_of_all_episodes_so_far(mountain):
    (run,) = mountain.runs
    ends, returns = run.episodes["timesteps"], run.episodes["return"]
    expected = [returns[ends <= timesteps].max() for timesteps in run.log["timesteps"]]
    assert run.log["best_return"].tolist() == expected
    assert expected[-1] == pytest.approx(run.best_return)


def test_seconds_of_a_timestep(maze):
    run = maze.runs[0]
    inner = run.log["timesteps"][:-1]
    seconds = [run.seconds_at(timesteps) for timesteps in (0, *inner)]
    assert seconds == pytest.approx([0.0, *run.log["seconds"][:-1]])
    assert run.seconds_at(run.result["timesteps"]) == run.result["seconds"]


def test_a_damaged_run_is_an_error(copied):
    (copied / "0" / "run.json").write_text("{")
    with pytest.raises(ValueError, match=r"run\.json is damaged"):
        collect([copied])


def test_final_states_that_are_missing_are_an_error(copied):
    shutil.rmtree(copied / "0" / "final_states")
    (environment,) = collect([copied])
    with pytest.raises(ValueError, match=r"final states of .* are missing"):
        environment.runs[0].episodes  # noqa: B018


def test_a_folder_without_runs_is_an_error(runs_folder, tmp_path):
    with pytest.raises(FileNotFoundError, match="`folder` must hold runs"):
        collect([runs_folder, tmp_path])


def test_what_is_collected_is_what_the_table_says(runs_folder, maze):
    runs = load_runs(runs_folder).set_index("run")
    for run in maze.runs:
        row = runs.loc[str(run.folder.path)]
        assert row["coverage.reachable"] == run.coverage
        assert np.isnan(row["first_success_timesteps"])
        assert run.has_ended


def test_labels_tell_runs_of_one_environment_apart(runs_folder, copied):
    description = json.loads((copied / "0" / "run.json").read_text())
    change(copied / "0", settings=description["settings"] | {"preset": "paper", "sigma": 9})
    environments = collect([copied, runs_folder / "MAPElites"])
    assert environments[0].labels == ["NSES, preset none", "NSES, preset paper"]
    assert environments[1].labels == ["MAPElites"]
