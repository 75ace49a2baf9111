"""Published tables come from committed data, and that from runs."""

import re
import shutil
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from benchmarks import (
    bonuses,
    figures,
    kept,
    learning,
    opening,
    results,
    run_tables,
    tables,
    unseen,
)
from curiosity_algos import CanonicalES
from curiosity_algos.experiments import (
    RunFolder,
    SaveRun,
    load_final_states,
    load_progress,
    load_runs,
    statistics,
)
from curiosity_gym.built_in import resolve_layout

PAGES = [tables.ROOT / name for name in tables.PAGES]


def test_tables_of_the_pages_are_those_of_the_data():
    for page in PAGES:
        text = page.read_text()
        assert "<!-- table " in text
        assert tables.write_tables(text) == text


def test_every_table_stands_in_a_page():
    found = [match[2] for page in PAGES for match in tables.MARKED.finditer(page.read_text())]
    assert set(found) == set(tables.TABLES)


def run(algorithm, env, seed, first, share, **others):
    return {
        "algorithm": algorithm,
        "env": env,
        "seed": seed,
        "timesteps": 10_000_100,
        "first_success_timesteps": first,
        "best_return": 0.5,
        "seconds": 9.4,
        "coverage.reachable": share,
        **others,
    }


def test_the_summary_counts_runs_that_found_nothing():
    runs = pd.DataFrame(
        [
            run("NSES", "CuriosityMaze-US-v0", 0, 2_000_000, 0.2),
            run("NSES", "CuriosityMaze-US-v0", 1, float("nan"), 0.3),
            run("NSES", "CuriosityMaze-US-v0", 2, 4_000_000, 0.7),
            run("NSLC", "CuriosityMaze-US-v0", 0, float("nan"), 0.1),
            run("NSLC", "CuriosityMaze-US-v0", 1, float("nan"), 0.1),
        ]
    )
    lines = run_tables.summary(runs).splitlines()
    assert lines[0] == "| Algorithm | US |"
    # Of three runs the second to find it is the median; none is cut off at a quarter's end.
    assert lines[2] == "| NSES | 2 of 3, 4.0 M, 40 [20 to 70] % |"
    assert lines[3] == "| NSLC | 0 of 2, > 10 M, 10 [10 to 10] % |"


def test_few_runs_have_a_range_and_five_an_interval():
    values = np.array([0.1, 0.2, 0.3, 0.4, 1.0])
    assert run_tables.of_runs(values[:1], "{:.1f}".format) == "0.1"
    assert run_tables.of_runs(values[:4], "{:.1f}".format) == "0.2 [0.1 to 0.4]"
    interval = statistics.stratified_bootstrap(values, statistics.interquartile_mean)
    low, high = interval.low, interval.high
    assert run_tables.of_runs(values, "{:.3f}".format) == f"0.300 ({low:.3f} to {high:.3f})"


def test_the_comparison_counts_pairs_of_runs():
    us, hard = "CuriosityMaze-US-v0", "CuriosityMaze-Hard-v0"
    never = float("nan")
    runs = [("CuriosityES", us, 3e6, 0.5), ("CuriosityES", us, 5e6, 0.7)]
    runs += [("NSES", us, 4e6, 0.1), ("NSES", us, never, 0.6), ("NSLC", us, 1e6, 0.8)]
    runs += [("CuriosityES", hard, never, 0.5), ("NSES", hard, never, 0.4), ("NSLC", hard, 1, 0.5)]
    table = run_tables.comparison(pd.DataFrame([run(*each[:2], 0, *each[2:]) for each in runs]))
    header, _, *rows = table.splitlines()
    assert header == "| CuriosityES | than | US | Hard | All |"
    # Of four pairs three are won in both scores; two that find nothing are as late as each other.
    assert rows == [
        "| finds the goal sooner | NSES | 75 | 50 | 62 |",
        "| finds the goal sooner | NSLC | 0.0 | 0.0 | 0.0 |",
        "| covers more | NSES | 75 | 100 | 88 |",
        "| covers more | NSLC | 0.0 | 50 | 25 |",
    ]


@pytest.mark.nightly
def test_learning_leaves_the_data_of_its_runs(tmp_path, monkeypatch):
    small = {"algos": ("NSES", "MAPElites"), "envs": ("CuriosityMaze-US-v0",), "timesteps": 3e5}
    monkeypatch.setitem(learning.SWEEPS, "mazes", small)
    learning.main("mazes", seeds="0", runs=tmp_path / "runs", jobs=1, out=tmp_path / "out")
    runs, loaded = results.read_runs("mazes", tmp_path / "out"), load_runs(tmp_path / "runs")
    assert set(runs["algorithm"]) == {"NSES", "MAPElites"}
    both = runs.merge(loaded, on=["algorithm", "env", "seed"], suffixes=("", "_loaded"))
    assert both["coverage.reachable"].tolist() == pytest.approx(
        both["coverage.reachable_loaded"].tolist(), rel=1e-5
    )
    curves = results.read_curves("mazes", tmp_path / "out")
    progress = load_progress(tmp_path / "runs")
    assert len(progress) == len(curves) == 6  # three generations each: nothing to leave out
    assert curves["coverage"].tolist() == pytest.approx(
        progress.sort_values(["algorithm", "time/total_timesteps"])["coverage/reachable"].tolist(),
        rel=1e-5,
    )


@pytest.mark.nightly
def test_no_policy_comes_back_at_a_weight_of_one():
    kept = results.read_rows("ppo_kept")
    assert (len(kept), kept["drawn"].max(), kept["best"].max()) == (9, 22, 0)
    assert not kept.loc[kept["env"] == "CuriosityMaze-Hard-v0", "drawn"].any()
    said = "22 of 100 episodes at most, in nine runs, and Hard's in none"
    assert said in " ".join((tables.ROOT / "README.md").read_text().split())


def test_kept_goals_are_counted_for_each_run(tmp_path, monkeypatch):
    """Of a goal as large as the maze, to which each policy comes, and of one that none comes to."""
    run = replace(bonuses.KEPT, settings={"n_steps": 8}, env_kwargs={"horizon": 100})
    near = replace(run, env_kwargs={"horizon": 100, "goal_radius": 99.0}, variant="near")
    monkeypatch.setitem(bonuses.RUNS, "recipe", [run, near])
    bonuses.main("recipe", seeds="0", timesteps=1280, runs=tmp_path, jobs=1, out=tmp_path)
    kept.main("recipe", tmp_path, episodes=9, out=tmp_path)
    counted = results.read_rows("recipe_kept", tmp_path).set_index("algorithm")
    assert counted[["episodes", "drawn", "best"]].to_numpy().tolist() == [[9, 0, 0], [9, 9, 9]]
    never, soon = counted["reliable_timesteps"]
    assert np.isnan(never)
    assert soon == 1280  # of 16 environments and 8 decisions of 10 steps each


@pytest.mark.extra("control")
@pytest.mark.nightly
def test_unseen_starts_are_counted_for_each_run(tmp_path, monkeypatch):
    env_id, starts = "CuriosityControl-BallInCup-v0", 12
    small = {"algos": ("CanonicalES",), "envs": (env_id,), "timesteps": 1}
    random = learning.SWEEPS["control_random"]
    monkeypatch.setitem(learning.SWEEPS, "control_random", random | small)
    learning.main("control_random", seeds="0", runs=tmp_path, jobs=1, out=tmp_path)
    unseen.main("control_random", tmp_path, starts=starts, out=tmp_path)
    runs = tmp_path / "control_random"
    run = runs / "CanonicalES" / env_id / "0"
    model = CanonicalES.load(RunFolder(run).checkpoint / "model")
    solved, env = 0, gym.make(env_id, random_start=True)
    for seed in range(starts):
        observation, _ = env.reset(seed=seed)
        terminated = truncated = False
        while not (terminated or truncated):
            action, _ = model.predict(observation, deterministic=True)
            observation, _, terminated, truncated, _ = env.step(action)
        solved += terminated
    assert 0 < solved < starts
    counted = results.read_rows("control_random_unseen", tmp_path)
    assert counted.values.tolist() == [["CanonicalES", env_id, 0, starts, solved]]
    shutil.copytree(run, runs / "Again" / "CanonicalES" / env_id / "0")
    assert results.label(load_runs(runs), runs).tolist() == ["CanonicalES, Again", "CanonicalES"]


def test_a_long_curve_is_thinned_to_points_equally_far_apart(monkeypatch):
    monkeypatch.setattr(results, "N_POINTS", 4)
    curve = pd.DataFrame(
        {
            "algorithm": "NSES",
            "env": "US",
            "seed": 0,
            "time/total_timesteps": [10, 20, 30, 40, 50, 60, 70, 80],
            "time/seconds": 1.0,
            "rollout/ep_rew_max": [0.0, 0.0, 0.7, 0.1, 0.0, 0.9, 0.0, 0.0],
            "coverage/reachable": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8],
        }
    )
    thin = results._thin(curve)
    assert thin["timesteps"].tolist() == [20, 40, 60, 80]
    assert thin["best_return"].tolist() == [0.0, 0.7, 0.9, 0.9]  # the best so far
    assert thin["coverage"].tolist() == [0.2, 0.4, 0.6, 0.8]


def test_the_headline_is_what_the_runs_came_to():
    runs = results.read_runs("mazes")
    found = runs[runs["algorithm"] == "CuriosityES"]["first_success_timesteps"].notna()
    mine, ppo, kept, speed = tables.headline().splitlines()[2:]
    assert f"CuriosityES, without a behavior: {found.sum()} of {len(found)} runs" in mine
    assert re.search(r"NSES \d+ of 30 runs.*; MAPElites \d+ of 30 runs", mine)
    assert re.search(r"with APT, at a weight of 1: \d+ of 15 .* without a bonus: \d+ of 15", ppo)
    for name, said in zip(
        ("recipe", "constant"), re.findall(r"(\d+) of (\d+) runs", kept), strict=True
    ):
        rows = results.read_rows(f"{name}_kept")
        solved = rows[rows["env"].isin(learning.MAZES)]["drawn"] >= 95
        assert [int(n) for n in said] == [solved.sum(), len(solved)]
    assert re.search(r"M steps/s .* Kheperax.* M steps/s", speed)


def test_what_robots_find_is_said_with_how_it_holds():
    runs, starts = results.read_runs("locomotion_long"), results.read_rows(tables.UNSEEN)
    own = [rows[rows["algorithm"] == "CuriosityES"] for rows in (runs, starts)]
    assert not runs["algorithm"].str.contains("unobserved").any()  # runs of an older default
    for row in tables.robots().splitlines()[2:]:
        name, said, best, robust, _ = row.strip("| ").split(" | ")
        found, solved = (rows[rows["env"].str.contains(name)] for rows in own)
        assert said == f"{found['first_success_timesteps'].notna().sum()} of {len(found)}"
        assert [int(n) for n in re.findall(r"\d+", best)] == [*solved["solved"], 100]
        of_robustify = results.read_rows("hold").set_index("task").loc[[name], "solved"]
        assert [int(n) for n in re.findall(r"\d+", robust)] == [*of_robustify, 100]
    for page in ("README.md", "docs/results/robots.md"):
        assert tables.robots() in (tables.ROOT / page).read_text()


@pytest.mark.nightly
def test_the_opening_shows_where_episodes_ended(tmp_path, monkeypatch):
    layout, origin = resolve_layout("us"), (1.0, 2.0)
    worlds = dict.fromkeys(learning.MAZES[:2], ("a robot", layout, origin))
    for env in worlds:
        run = tmp_path / opening.RUNS.format(env)
        model = CanonicalES(env, population_size=4, seed=0)
        model.learn(3e4, callback=SaveRun(run))
    ends, states = opening.read_ends(run, origin), load_final_states(run)
    np.testing.assert_array_equal(ends.positions, states["behavior"][:, :2] + origin)
    for name, value in {"WORLDS": worlds, "N_FRAMES": 3, "N_STILL": 1}.items():
        monkeypatch.setattr(opening, name, value)
    opening.main(tmp_path, out=tmp_path)
    for name in ("opening", "opening_dark"):
        with Image.open(tmp_path / f"{name}.gif") as image:
            assert image.n_frames == 3
        assert (figures.IMAGES / f"{name}.gif").is_file()


@pytest.mark.nightly
def test_figures_are_drawn_from_the_data(tmp_path, monkeypatch):
    monkeypatch.setattr(statistics, "N_RESAMPLES", 100)  # how wide intervals are is tested there
    figures.main(tmp_path)
    drawn = {path.stem for path in tmp_path.iterdir()}
    assert drawn == {*figures.TITLES, "minigrid", "random_mazes", "weights"}
    assert all((figures.IMAGES / f"{name}.png").is_file() for name in drawn)


def test_a_line_of_a_figure_has_a_curve_for_each_seed():
    curves = results.read_curves("mazes")
    curves = curves[curves["env"] == "CuriosityMaze-US-v0"]
    own = curves[curves["algorithm"] == "NSES"]
    (line,) = figures.lines_of(own, "coverage", {"NSES": "#123456"})
    assert (line.label, line.color) == ("NSES", "#123456")
    assert len(line.curves) == own["seed"].nunique()
    times, shares = line.curves[0]
    first = own[own["seed"] == own["seed"].min()]
    assert times.tolist() == [0.0, *first["timesteps"]]
    assert shares.tolist() == [0.0, *first["coverage"]]
