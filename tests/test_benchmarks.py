"""The benchmarks run and print figures; how fast anything is, no test says."""

import math
import re
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from benchmarks import (
    baselines,
    dynamics,
    figures,
    gallery,
    hold,
    lasting,
    learning,
    pretrained,
    roaming,
    run,
)
from benchmarks.measure import Row, Table, interleave, number
from curiosity_algos import make_evaluator
from curiosity_gym.locomotion.locomotion_env import LocomotionEnv
from curiosity_gym.registration import SPECS

EXTRAS = {
    "control": ["control"],
    "locomotion": ["locomotion"],
    "envpool": ["control", "locomotion"],
    "cluster": ["control", "ray"],
}
DIFFERENCES = ["curiosity_gym beyond gymnasium", "overhead"]


def medians(printed):
    """Title: {row: median} of the printed tables."""
    tables = {}
    for section in printed.split("\n## ")[1:]:
        rows = [line.split(" | ") for line in section.splitlines() if line.startswith("| ")][1:]
        title = section.splitlines()[0]
        tables[title] = {row[0].strip("| "): float(row[1].replace(",", "")) for row in rows}
    return tables


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.extra(*EXTRAS.get(name, []))) for name in run.SECTIONS],
)
@pytest.mark.nightly
def test_sections_print_figures(name, capsys):
    run.main(only=name, quick=True)
    printed = capsys.readouterr().out
    assert re.search(r"CPU: .+, \d+ cores", printed)
    tables = medians(printed)
    assert tables
    for title, rows in tables.items():
        assert title.startswith(f"{name}: ")
        assert rows
        for row, figure in rows.items():
            assert math.isfinite(figure), (title, row)
            # Only a difference of two times may come out below zero, and only a rounding as zero.
            assert figure >= 0.0 or row in DIFFERENCES, (title, row)


def test_an_unknown_section_is_refused():
    with pytest.raises(typer.BadParameter, match="not nothing"):
        run.main(only="vector,nothing", quick=True)


@pytest.mark.extra("control")
@pytest.mark.nightly
def test_bare_physics_replays_the_evaluation():
    import mujoco

    from benchmarks import control

    name = "Finger"
    env = gym.make(f"CuriosityControl-{name}-v0", horizon=40)
    task, evaluator = env.unwrapped.task, make_evaluator(env)
    parameters = np.random.default_rng(0).normal(0.0, 1.0, (3, evaluator.n_parameters))
    rollouts = evaluator.evaluate(parameters)
    model = control.make_peer(name).unwrapped.physics.model.ptr
    data, start = mujoco.MjData(model), task.start_state(model)
    for i, actions in enumerate(rollouts.trajectories[1]):
        taken = actions[: rollouts.lengths[i]].astype(np.float64)
        control.bare_episode(model, data, start, taken, task.n_substeps)
        fields = SimpleNamespace(qpos=data.qpos[None], xpos=data.xpos[None])
        behavior = np.clip(task.behavior(fields)[0], task.behavior_low, task.behavior_high)
        assert behavior.tobytes() == rollouts.behaviors[i].tobytes()


@pytest.mark.extra("control", "locomotion")
@pytest.mark.nightly
def test_baselines_count_successes(tmp_path):
    baselines.main(quick=True, out=tmp_path)
    for file, rows in baselines.FILES.items():
        table = pd.read_csv(tmp_path / f"{file}.csv", index_col="Task")
        assert list(table.index) == list(rows)
        assert table.shape[1] == 5
        assert ((table >= 0) & (table <= 3)).all(axis=None)


def cells_of(positions):
    """Bins of 1 m along x and y, 2 cm along z; what is out of bounds is in the outermost."""
    places = [((x + 50.0) / 1.0, (y + 50.0) / 1.0, z / 0.02) for x, y, z in map(list, positions)]
    return {tuple(min(max(math.floor(value), 0), 99) for value in place) for place in places}


def cells_in(counter):
    return set(zip(*map(np.ndarray.tolist, counter.visited.nonzero()), strict=True))


@pytest.mark.extra("locomotion")
@pytest.mark.nightly
def test_every_step_of_a_population_is_counted():
    env = gym.make(roaming.ANT, env_kwargs=roaming.ENV_KWARGS)
    evaluator = make_evaluator(env)
    parameters = np.random.default_rng(1).normal(size=(3, evaluator.n_parameters))
    rollouts = evaluator.evaluate(parameters.astype(np.float32), seed=2)
    assert rollouts.lengths.min() < rollouts.lengths.max()  # one ends before the others
    positions = []
    for actions, length in zip(rollouts.actions, rollouts.lengths, strict=True):
        positions.append(env.reset(seed=2)[0][:3])
        positions += [env.step(action)[0][:3] for action in actions[:length]]
        positions.pop()  # no step begins there
    counter = roaming.Counter(rollouts.timesteps)
    roaming.CountingEvaluator(evaluator, counter).evaluate(parameters.astype(np.float32), seed=2)
    assert counter.is_full
    assert cells_in(counter) == cells_of(positions)


def test_cells_are_counted_along_a_training():
    positions = np.random.default_rng(0).uniform([-50, -50, 0], [50, 50, 2], (70, 3)).round()
    counter = roaming.Counter(65, every=20)
    for part in np.array_split(positions, 3):
        counter.add(part)
    ends = [20, 40, 60, 65]
    cells = [cells_of(positions[:end]) for end in ends]
    assert [row["timesteps"] for row in counter.rows] == ends
    assert [row["xyz"] for row in counter.rows] == [len(each) for each in cells]
    assert [row["xy"] for row in counter.rows] == [len({c[:2] for c in each}) for each in cells]


def test_tasks_take_turns():
    calls = []
    tasks = {name: lambda name=name: calls.append(name) or float(len(calls)) for name in "abc"}
    assert interleave(tasks, 3) == {
        "a": [1.0, 6.0, 7.0],
        "b": [2.0, 5.0, 8.0],
        "c": [3.0, 4.0, 9.0],
    }
    assert calls == list("abccbaabc")


def test_a_table_gives_shares_of_the_roof_where_there_is_one():
    rows = [Row("steps", [3.0, 1.0], "s", "", [0.5, 0.25]), Row("others", [3.0], "s")]
    assert Table("learn", rows).markdown().splitlines()[2:6] == [
        "| What | Median | Spread | Unit | Target | Of the roof |",
        "|---|--:|--:|---|---|--:|",
        "| steps | 2.00 | 1.00 to 3.00 | s |  | 37.5 % |",
        "| others | 3.00 | 3.00 to 3.00 | s |  |  |",
    ]


@given(st.floats(1e-3, 1e9))
def test_numbers_keep_three_digits_without_exponents(value):
    text = number(value)
    assert "e" not in text
    assert float(text.replace(",", "")) == pytest.approx(value, rel=0.0051)


@pytest.mark.nightly
def test_the_gallery_films_what_was_found(tmp_path, monkeypatch, capsys):
    search = gallery.Search("CuriosityMaze-Snake-v0", 1.0)
    monkeypatch.setattr(gallery, "FOUND", {"snake": search})
    gallery.main(only="snake", out=tmp_path)
    assert capsys.readouterr().out == "snake: 2000 steps, at no goal\n"
    with Image.open(tmp_path / "snake.gif") as image:
        assert image.n_frames <= gallery.N_FRAMES
        assert image.height == gallery.HEIGHT


@pytest.mark.extra("locomotion")
@pytest.mark.nightly
def test_the_gallery_knows_plans_that_come_to_the_goal(monkeypatch):
    monkeypatch.setattr(LocomotionEnv, "render", lambda env: np.zeros((4, 4, 3), np.uint8))
    for env_id in gallery.PLANNED.values():
        frames, success = gallery.film(env_id, *gallery.read_actions(env_id))
        assert success, env_id
        assert 1 < len(frames) <= gallery.N_FRAMES


def test_pictures_show_every_environment_and_algorithm():
    shown = {search.env_id for search in gallery.FOUND.values()}
    shown |= {*gallery.PLANNED.values(), *gallery.RANDOM.values()}
    ids = {name for name in SPECS if name.startswith("Curiosity")}
    assert ids - shown == {"CuriosityMaze-v0"}  # whose layout is the user's
    for name in learning.ALGORITHMS:
        assert (figures.IMAGES / f"portrait_{name}.png").is_file()


@pytest.mark.nightly
def test_policies_are_trained_and_written(tmp_path, monkeypatch, capsys):
    settings = {
        "algos": ("NSES", "MAPElites"),
        "envs": ("CuriosityMaze-Hard-v0",),
        "timesteps": 1.0,
        "env_kwargs": ["horizon:50", "goal_radius:300.0"],
    }
    names = ["NSES", "NSES", "NSES, learned"]  # whose settings are others
    rows = {"algorithm": names, "env": "CuriosityMaze-Hard-v0", "seed": [5, 7, 9]}
    table = pd.DataFrame(rows | {"best_return": [0.0, 0.5, 0.9]})
    monkeypatch.setitem(pretrained.SWEEPS, "mazes", settings)
    monkeypatch.setattr(pretrained, "read_runs", lambda name: table)
    pretrained.main(tmp_path / "runs", jobs=1, tables="mazes", out=tmp_path)
    printed = capsys.readouterr().out
    assert "NSES CuriosityMaze-Hard-v0 7: 0.9800, 0.5000 in the results\n" in printed
    assert printed.count("in the results") == 1
    with np.load(tmp_path / "NSES_CuriosityMaze-Hard-v0.npz") as file:
        assert file["parameters"].shape == (1746,)
        assert file["net_arch"].tolist() == [32, 16]
        assert file["return"] == 0.98


@pytest.mark.nightly
def test_a_task_is_searched_trained_tested_and_collected(tmp_path, monkeypatch):
    maze = {"layout": "S..\n...\n..G", "horizon": 200, "start_radius": 2.0}
    task = hold.Task("CuriosityMaze-v0", 1e5, 1, {"env_kwargs": maze}, is_perturbed=True)
    monkeypatch.setattr(hold, "TASKS", {"easy": task})
    hold.run("easy", 3, runs=tmp_path)
    hold.alone("easy", 3, runs=tmp_path)
    hold.collect(runs=tmp_path, out=tmp_path)
    (row,) = pd.read_csv(tmp_path / "hold.csv").to_dict("records")
    assert (row["task"], row["seed"], row["starts"]) == ("easy", 3, 100)
    assert 0 < row["search_solved"] <= 100
    assert row["timesteps"] == 8192
    (alone,) = pd.read_csv(tmp_path / "hold_alone.csv").to_dict("records")
    total = row["search_timesteps"] + row["timesteps"]
    assert total - 10 < alone["timesteps"] < total + 20_000
    assert 0 <= alone["solved"] <= 100
    monkeypatch.setattr(hold, "read_rows", lambda name: pd.read_csv(tmp_path / f"{name}.csv"))
    rows = pd.DataFrame([row, row | {"seed": 4}])
    assert f"| {alone['solved']} / - |" in hold.table(rows)


def test_mazes_are_perturbed_a_little():
    plain, perturbed = gym.make("CuriosityMaze-US-v0"), gym.make("CuriosityMaze-US-v0")
    perturbed = hold.Perturbed(perturbed)
    (expected, _), (seen, _) = plain.reset(seed=0), perturbed.reset(seed=0)
    assert 0.0 < np.abs(seen - expected).max() < 0.06
    action = np.array([1.0, 0.0], np.float32)
    for _ in range(3):
        *_, expected = plain.step(action)
        *_, info = perturbed.step(action)
    assert 0.0 < np.linalg.norm(info["velocity"] - expected["velocity"]) < 3 * 0.5 * np.deg2rad(5)


@pytest.mark.parametrize("name", ["constant, shared", "constant, own", "drifting, own"])
def test_noise_lasts_and_is_shared_where_it_shall(name):
    env = lasting.Noisy("CuriosityMaze-US-v0", lasting.NOISES[name], seed=0)
    seen = [env.reset(seed=[3] * lasting.N_ENVS)[0]]
    actions = np.zeros((lasting.N_ENVS, 2), dtype=np.float32)
    seen += [env.step(actions)[0] for _ in range(300)]
    assert seen[-1].shape == env.observation_space.shape
    beside = np.array(seen)[..., -lasting.N_ENTRIES :]
    assert beside.std() == pytest.approx(1.0, abs=0.4)
    assert (np.ptp(beside, axis=0).max() > 0.1) == name.startswith("drifting")
    is_shared = name.endswith("shared")
    assert (np.ptp(beside, axis=1).max() == 0.0) == is_shared
    again, _ = env.reset(seed=[3] * lasting.N_ENVS)
    assert np.array_equal(again, seen[0]) == is_shared


def test_what_dynamics_make_easy_is_added_to_files(tmp_path, monkeypatch):
    monkeypatch.setattr(dynamics, "ALGORITHMS", ("NSES", "MAPElites"))
    for _ in range(2):  # the second time nothing is left to do
        dynamics.main(seeds=1, timesteps=1, policies=60, out=tmp_path)
    rows, played = (
        pd.read_csv(tmp_path / f"{name}.csv") for name in ("dynamics", "dynamics_random")
    )
    assert len(rows) == 2 * len(dynamics.MAZES)
    assert dynamics.table(rows).count("of 1") == len(rows)
    found = played.set_index(["dynamics", "env"])["found"].groupby("dynamics").sum()
    assert found["as here"] == 0 < found["the code's"]
    assert "Dynamics, of 60 policies" in dynamics.random_table(played)


def test_actions_of_curiosity_es_are_those_of_the_code():
    """`100 tanh(z / 100)` is nearly the output itself: of small outputs, nearly no acceleration."""
    envs = [
        gym.make("CuriosityMaze-US-v0", horizon=1, max_acceleration=largest, **dynamics.CODE)
        for largest in (5.0, 100.0)
    ]
    drawn = np.random.default_rng(0).normal(0.0, 0.3, (20, 1746)).astype(np.float32)
    parts = drawn, dynamics.strong(drawn)
    weak, strong = (
        10.0 * make_evaluator(env).evaluate(each).behaviors[:, 2:]  # a tenth of a second at rest
        for env, each in zip(envs, parts, strict=True)
    )
    outputs = np.arctanh(weak / 5.0)
    np.testing.assert_allclose(strong, 100.0 * np.tanh(outputs / 100.0), rtol=1e-3)


def test_what_lasting_noise_does_is_added_to_a_file(tmp_path, monkeypatch):
    monkeypatch.setattr(lasting, "MAZES", ("US",))
    monkeypatch.setattr(lasting, "NOISES", {"own": lasting.NOISES["constant, own"]})
    for _ in range(2):  # the second time nothing is left to do
        lasting.main(seeds=1, timesteps=1, out=tmp_path)
    rows = pd.read_csv(tmp_path / "lasting.csv")
    assert rows["algorithm"].tolist() == sorted(lasting.ALGORITHMS)
    assert (rows["timesteps"] == lasting.N_ENVS * 2000).all()
    assert "| own | 0 of 1 | 0 of 1 | 0 of 1 |" in lasting.table(rows)
