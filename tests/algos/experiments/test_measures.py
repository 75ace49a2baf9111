"""What the figures and the report read of runs."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest

from curiosity_algos import MAPElites
from curiosity_algos.experiments.measures import (
    EPISODES,
    best_return,
    coverage,
    first_of,
    generation_return,
    in_seconds,
    load_compared,
    times_to_first,
)
from curiosity_algos.experiments.run import Run
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


def test_environments_of_one_name_are_told_apart_by_their_keywords(copied):
    assert set(load_compared(copied)["env"]) == {"CuriosityMaze-US-v0"}
    change(copied[0], env_kwargs={"layout": "us", "horizon": 100, "goal_radius": 91.5})
    titles = [f"CuriosityMaze-US-v0, horizon {n}" for n in (100, 60)]
    assert load_compared(copied)["env"].tolist() == titles


def test_environments_of_one_name_are_told_apart_by_their_wrappers(copied):
    change(copied[0], wrappers={"RepeatAction": {"num_repeats": 10}})
    titles = [f"CuriosityMaze-US-v0, RepeatAction.num_repeats {n}" for n in (10, "none")]
    assert load_compared(copied)["env"].tolist() == titles


def test_an_environment_without_an_id_goes_by_its_class(copied):
    change(copied[0], env=None, env_class="Own")
    assert load_compared(copied)["env"].tolist() == ["Own", "CuriosityMaze-US-v0"]


def test_runs_are_named_by_the_settings_that_tell_them_apart(copied):
    settings = json.loads((copied[0] / "run.json").read_text())["settings"]
    change(copied[0], settings=settings | {"preset": "paper", "sigma": 9})
    labels = load_compared(copied)["label"]
    assert labels.tolist() == ["MAPElites, preset paper", "MAPElites, preset none"]


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
    before = table([nan, nan], [nan, nan], [9.0, 10.0]).drop(columns="first_reward_timesteps")
    assert first_of(before) is None  # of a version that noted no rewards


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
    expected = coverage(Run(copied[0])), in_seconds(Run(copied[0]), [700.0])
    log = copied[0] / "progress.csv"
    rows = pd.read_csv(log)
    foreign = rows.assign(**{"coverage/reachable": np.nan, "eval/mean_reward": 1.0})
    pd.concat([foreign, rows.assign(**{"time/seconds": np.nan})]).sort_values(
        "time/total_timesteps", kind="stable"
    ).to_csv(log, index=False)
    found = coverage(Run(copied[0])), in_seconds(Run(copied[0]), [700.0])
    np.testing.assert_array_equal(found[0], expected[0])
    np.testing.assert_allclose(found[1], expected[1])


def test_seconds_are_known_to_the_end_without_a_log(copied):
    result = RunFolder(copied[0]).result()
    (copied[0] / "progress.csv").write_text("time/total_timesteps,time/seconds\n")
    half = in_seconds(Run(copied[0]), [0.0, result["timesteps"] / 2, result["timesteps"]])
    np.testing.assert_allclose(half, [0.0, result["seconds"] / 2, result["seconds"]])


def test_returns_are_those_of_the_generations(runs):
    run = Run(runs[0])
    states = run.final_states
    assert states["return"].max() > 0.0
    timesteps, best = generation_return(run)
    generations = np.unique(states["generation"])
    assert len(timesteps) == len(best) == len(generations)
    for i, generation in enumerate(generations):
        members = states["generation"] == generation
        assert timesteps[i] == states["timesteps"][members][0]
        assert best[i] == states["return"][members].max()
    so_far = best_return(run)
    np.testing.assert_array_equal(so_far[0], timesteps)
    assert so_far[1].tolist() == [max(best[: i + 1]) for i in range(len(best))]
    assert (np.diff(best) < 0.0).any()  # else the two could not be told apart


def test_coverage_is_the_logs(runs):
    run = Run(runs[0])
    timesteps, shares = coverage(run)
    progress = run.progress
    assert timesteps.tolist() == [0.0, *progress["time/total_timesteps"]]
    assert shares.tolist() == [0.0, *progress["coverage/reachable"]]
    seconds = in_seconds(run, timesteps)
    assert seconds.tolist() == [0.0, *progress["time/seconds"]]


def write_run(folder, **columns):
    run = RunFolder(folder)
    run.begin({"algorithm": "TD3ICM", "env": "CuriosityMaze-US-v0", "seed": 0})
    if columns:
        run.add_final_states(0, columns | {"behavior": np.zeros((len(columns["return"]), 2))})
    return Run(folder)


def test_an_algorithm_without_generations_counts_56_episodes_as_one(tmp_path):
    n = 2 * EPISODES + 3
    returns = np.random.default_rng(0).random(n)
    run = write_run(
        tmp_path,
        generation=np.zeros(n, dtype=int),
        timesteps=10 * np.arange(1, n + 1),
        **{"return": returns},
    )
    timesteps, best = generation_return(run)
    assert timesteps.tolist() == [560, 1120, 1150]
    assert best.tolist() == [max(returns[i : i + 56]) for i in (0, 56, 112)]
    timesteps, best = best_return(run)  # of every episode
    assert timesteps.tolist() == list(range(10, 1151, 10))
    assert best[7] == returns[:8].max()


def test_returns_begin_with_the_first_generation(tmp_path):
    ones = np.ones(3, dtype=int)
    returns = np.array([-7.0, -9.0, -2.0])
    run = write_run(
        tmp_path, generation=np.cumsum(ones), timesteps=10 * np.cumsum(ones), **{"return": returns}
    )
    assert [axis.tolist() for axis in best_return(run)] == [[10, 20, 30], [-7.0, -7.0, -2.0]]
    assert [axis.tolist() for axis in generation_return(run)] == [[10, 20, 30], returns.tolist()]


def test_a_run_that_has_just_begun_has_no_return_and_is_at_0(tmp_path):
    run = write_run(tmp_path)
    for measure in (best_return, generation_return):
        with pytest.raises(ValueError, match=r"final states of .* are missing"):
            measure(run)
    assert [values.tolist() for values in coverage(run)] == [[0.0], [0.0]]
    assert in_seconds(run, [0.0]).tolist() == [0.0]


def test_an_environment_without_cells_has_no_coverage(tmp_path):
    run = write_run(tmp_path)
    run.folder.progress.write_text("time/total_timesteps,rollout/ep_rew_mean\n10,0.0\n")
    with pytest.raises(ValueError, match="`runs` must be of environments with a coverage"):
        coverage(run)
