"""The benchmarks run and print figures; how fast anything is, no test says."""

import math
import re
import subprocess
import sys
from functools import partial
from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from torch.profiler import profile

from benchmarks import (
    baselines,
    cluster,
    figures,
    gallery,
    learning,
    population,
    portraits,
    pretrained,
    products,
    roaming,
    run,
    training,
)
from benchmarks.measure import Plan, Row, Table, add_peer, interleave, number, ratios
from curiosity_algos import CanonicalES, CuriosityES, make_evaluator
from curiosity_algos.cli.sweep import sweep
from curiosity_algos.experiments.played import episode
from curiosity_gym import MazeLayout
from curiosity_gym.locomotion.locomotion_env import LocomotionEnv
from curiosity_gym.registration import SPECS

ROOT = Path(__file__).parents[1]
CONTROL = ["BallInCup", "Finger", "Stacker"]
TITLES = {
    "roofline": ["roofline: this machine"],
    "population": ["population: CuriosityMaze-Snake-v0", "population: every maze"],
    "scaling": ["scaling: threads", "scaling: sizes"],
    "python_loop": ["python_loop: one environment"],
    "processes": ["processes: Pendulum-v1"],
    "vector": ["vector: CuriosityMaze-Hard-v0"],
    "control": [f"control: CuriosityControl-{name}-v0" for name in CONTROL],
    "locomotion": ["locomotion: Ant-v5"],
    "learn": ["learn: CuriosityMaze-Hard-v0", "learn: where the time goes"],
    "td3": ["td3: CuriosityMaze-US-v0", "td3: where TD3ICM's time goes"],
    "novelty": ["novelty: the archive"],
    "diversity": ["diversity: share of the time"],
    "cold_start": ["cold_start: fresh processes"],
    "cluster": [
        "cluster: a generation in bytes",
        "cluster: time of a generation",
        "cluster: a model of more machines, over one",
    ],
    "whole_run": [
        "whole_run: from a cold process to the saved model",
        "whole_run: resident memory",
    ],
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
    "names",
    [
        ["roofline", "population", "scaling", "python_loop"],
        ["vector"],
        pytest.param(["control"], marks=pytest.mark.extra("control")),
        pytest.param(["processes"], marks=pytest.mark.extra("locomotion")),
        ["learn"],
        ["td3"],
        ["novelty"],
        ["diversity"],
        pytest.param(["cluster"], marks=pytest.mark.extra("control", "ray")),
        ["cold_start"],
        ["whole_run"],
    ],
)
def test_sections_print_figures(names, capsys):
    run.main(only=",".join(names), quick=True)
    printed = capsys.readouterr().out
    assert re.search(r"CPU: .+, \d+ cores", printed)
    tables = medians(printed)
    assert list(tables) == [title for name in names for title in TITLES[name]]
    for title, rows in tables.items():
        assert len(rows) >= 1
        for name, figure in rows.items():
            assert math.isfinite(figure), (title, name)
            # Only a difference of two times may come out below zero, and only a rounding as zero.
            assert figure >= 0.0 or name in DIFFERENCES, (title, name)


@pytest.mark.extra("control", "ray")
def test_the_cluster_is_left_when_it_is_measured(monkeypatch):
    ray = pytest.importorskip("ray")

    def fail(plan):
        ray.init("local", num_cpus=1, include_dashboard=False, log_to_driver=False)
        raise KeyboardInterrupt

    monkeypatch.setattr(cluster, "_run", fail)
    with pytest.raises(KeyboardInterrupt):
        cluster.run(Plan(1, quick=True))
    assert not ray.is_initialized()


def test_an_unknown_section_is_refused():
    command = [sys.executable, "-m", "benchmarks.run", "--quick", "--only", "vector,nothing"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 2
    assert "nothing" in result.stderr
    assert result.stdout == ""


def test_a_missing_peer_leaves_a_note(monkeypatch):
    monkeypatch.setitem(sys.modules, "jax", None)
    tasks, notes = {}, []
    add_peer(tasks, notes, "Kheperax", lambda: population.kheperax_task(Plan(1, quick=True)))
    assert tasks == {}
    assert notes == ["Kheperax is left out: the package jax is not installed."]


@pytest.mark.extra("control")
@pytest.mark.parametrize("name", CONTROL)
def test_bare_physics_replays_the_evaluation(name):
    import mujoco

    from benchmarks import control

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


@pytest.mark.extra("control")
def test_a_stream_repeats_the_episode_after_a_reset():
    from benchmarks import control

    episodes = [np.array([[1.0, 2.0]]), np.array([[3.0, 4.0], [5.0, 6.0], [7.0, 8.0]])]
    streams = control.streams(episodes, 6)
    assert streams[:, 0].tolist() == [[1.0, 2.0], [0.0, 0.0]] * 3
    assert streams[:4, 1].tolist() == [[3.0, 4.0], [5.0, 6.0], [7.0, 8.0], [0.0, 0.0]]
    assert streams[4:, 1].tolist() == streams[:2, 1].tolist()


@pytest.mark.extra("control", "locomotion")
def test_baselines_count_successes(tmp_path):
    baselines.main(quick=True, out=tmp_path)
    for file, rows in baselines.FILES.items():
        table = pd.read_csv(tmp_path / f"{file}.csv", index_col="Task")
        assert list(table.index) == list(rows)
        assert table.shape[1] == 5
        assert ((table >= 0) & (table <= 3)).all(axis=None)


@pytest.mark.extra("control")
def test_a_row_of_baselines_joins_those_that_are_there(tmp_path):
    for label in ("Finger", "BallInCup", "Finger"):
        baselines.main(only=label, quick=True, out=tmp_path / "new")
    table = pd.read_csv(tmp_path / "new" / "control_baselines.csv")
    assert list(table["Task"]) == ["BallInCup", "Finger"]


@pytest.mark.extra("control")
@pytest.mark.parametrize("random_start", [False, True])
@pytest.mark.parametrize("draw", [baselines.uniform, baselines.bang_bang])
def test_open_loop_counts_what_single_envs_succeed_in(draw, random_start):
    env = gym.make("CuriosityControl-BallInCup-v0", horizon=200, random_start=random_start)
    n = 4

    def succeeds(i):
        env.reset(seed=i)
        terminated = truncated = False
        actions = draw(np.random.default_rng(0), (n, 2))
        while not (terminated or truncated):
            _, _, terminated, truncated, _ = env.step(next(actions)[i])
        return terminated

    expected = sum(map(succeeds, range(n)))
    assert baselines.open_loop(env, n, draw(np.random.default_rng(0), (n, 2))) == expected


@pytest.mark.extra("locomotion")
def test_open_loop_counts_goals_and_not_falls():
    near = MazeLayout("near", 30.0, 30.0, (15.0, 15.0), (17.15, 15.0), [])
    env = gym.make("CuriosityLocomotion-AntTrap-v0", world=near, horizon=40)
    n = 12

    def succeeds(i):
        env.reset(seed=i)
        ended = False
        actions = baselines.bang_bang(np.random.default_rng(0), (n, 8))
        while not ended:
            _, _, terminated, truncated, info = env.step(next(actions)[i])
            ended = terminated or truncated
        return info["is_success"]

    successes = list(map(succeeds, range(n)))
    actions = baselines.bang_bang(np.random.default_rng(0), (n, 8))
    assert 0 < sum(successes) < n
    assert baselines.open_loop(env, n, actions) == sum(successes)


def cells_of(positions):
    """Bins of 1 m along x and y, 2 cm along z; what is out of bounds is in the outermost."""
    places = [((x + 50.0) / 1.0, (y + 50.0) / 1.0, z / 0.02) for x, y, z in map(list, positions)]
    return {tuple(min(max(math.floor(value), 0), 99) for value in place) for place in places}


def cells_in(counter):
    return set(zip(*map(np.ndarray.tolist, counter.visited.nonzero()), strict=True))


def test_a_counter_counts_the_cells_of_the_first_steps():
    positions = np.random.default_rng(0).normal(size=(100, 3)) * [40.0, 3.0, 1.0]
    counter = roaming.Counter(80)
    for part in np.split(positions, [7, 60]):
        assert not counter.is_full
        counter.add(part)
    assert counter.is_full
    assert cells_in(counter) == cells_of(positions[:80])


@pytest.mark.extra("locomotion")
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


@pytest.mark.extra("locomotion")
def test_every_random_step_is_counted(monkeypatch):
    monkeypatch.setattr(roaming, "N_ENVS", 2)
    counter = roaming.Counter(400)
    roaming.act_at_random(counter, seed=3)
    envs = [gym.make(roaming.ANT, env_kwargs=roaming.ENV_KWARGS) for _ in range(2)]
    space = gym.vector.utils.batch_space(envs[0].action_space, 2)
    space.seed(3)
    observations, ended = [env.reset()[0] for env in envs], [False, False]
    positions = []
    while len(positions) < 400:
        for i, action in enumerate(space.sample()):
            if ended[i]:  # the action of a step that resets is nobody's
                observations[i], _ = envs[i].reset()
                ended[i] = False
                continue
            positions.append(observations[i][:3])
            observations[i], _, terminated, truncated, _ = envs[i].step(action)
            ended[i] = terminated or truncated
    assert cells_in(counter) == cells_of(positions[:400])


@pytest.mark.extra("locomotion")
def test_a_search_is_counted(monkeypatch):
    class Search:
        def __init__(self, env, seed, evaluator, n_threads):
            self.played = evaluator.evaluate, np.zeros((2, evaluator.n_parameters), np.float32)

        def learn(self, timesteps):
            evaluate, parameters = self.played
            evaluate(parameters, 0)

    monkeypatch.setattr(roaming, "find_algorithm", lambda name: Search)
    counter = roaming.Counter(1_500)
    roaming.search("any", counter, seed=0)
    assert counter.is_full  # of two that stand still for a thousand steps each
    assert 0 < counter.visited.sum() < 100


def test_runs_of_the_ant_are_done_once(tmp_path, monkeypatch):
    def walk(counter, seed):
        done.append((seed, counter.timesteps))
        counter.add(np.zeros((counter.timesteps, 3)))

    done: list[tuple[int, int]] = []
    monkeypatch.setattr(roaming, "WAYS", {"here": walk, "there": walk})
    words = {"seeds": "0,4", "runs": tmp_path / "runs", "jobs": 1, "out": tmp_path / "out"}
    for names in ("here", "there,here", "there"):
        roaming.main(names, timesteps=90, **words)
    assert done == [(0, 90), (4, 90)] * 2
    table = pd.read_csv(tmp_path / "out" / "roaming.csv")
    rows = [[name, seed, 90, 1, 1] for name in ("here", "there") for seed in (0, 4)]
    assert table.to_numpy().tolist() == rows
    roaming.main("here", timesteps=80, **words)  # beside which the others are too long
    assert set(pd.read_csv(tmp_path / "out" / "roaming.csv")["algorithm"]) == {"here"}
    with pytest.raises(typer.BadParameter, match="--names knows here, there, not nowhere"):
        roaming.main("nowhere", **words)


def test_bang_bang_actions_are_held():
    rng = np.random.default_rng(0)
    steps = np.array(list(islice(baselines.bang_bang(rng, (50, 2)), 30)))
    assert set(steps.ravel()) == {-1.0, 1.0}
    blocks = steps.reshape(3, baselines.N_HELD, 50, 2)
    assert (blocks == blocks[:, :1]).all()
    assert not (blocks[0] == blocks[1]).all()


def test_tasks_take_turns():
    calls = []
    tasks = {name: lambda name=name: calls.append(name) or float(len(calls)) for name in "abc"}
    assert interleave(tasks, 3) == {
        "a": [1.0, 6.0, 7.0],
        "b": [2.0, 5.0, 8.0],
        "c": [3.0, 4.0, 9.0],
    }
    assert calls == list("abccbaabc")


def test_a_table_gives_median_spread_and_target():
    row = Row("steps", [3.0, 1.0, 2.5, 9.0, 2.0], "M steps/s", ">= 2")
    lines = Table("vector", [row], ["A note."]).markdown().splitlines()
    assert lines[0] == "## vector"
    assert "| steps | 2.50 | 1.00 to 9.00 | M steps/s | >= 2 |" in lines
    assert lines[-1] == "A note."
    assert "Of the roof" not in "".join(lines)
    assert ratios([4.0, 9.0], [2.0, 3.0]) == [2.0, 3.0]


def test_a_table_gives_shares_of_the_roof_where_there_is_one():
    rows = [Row("steps", [3.0, 1.0], "s", "", [0.5, 0.25]), Row("others", [3.0], "s")]
    assert Table("learn", rows).markdown().splitlines()[2:6] == [
        "| What | Median | Spread | Unit | Target | Of the roof |",
        "|---|--:|--:|---|---|--:|",
        "| steps | 2.00 | 1.00 to 3.00 | s |  | 37.5 % |",
        "| others | 3.00 | 3.00 to 3.00 | s |  |  |",
    ]


@pytest.mark.parametrize("preset", [None, "paper"])
def test_products_are_those_that_torch_counts(preset):
    make = CuriosityES if preset is None else partial(CuriosityES.from_preset, preset)
    model = make("CuriosityMaze-US-v0", seed=0)
    model.learn(1)
    motivation, bonus = model._motivation, model._motivation.bonus
    updates = products.products_of_updates(model)
    batch = motivation.buffer.sample(motivation.batch_size)
    counted = count_products(lambda: bonus.losses(*batch)["loss"].backward())
    assert counted * motivation.n_updates == pytest.approx(updates)

    n = model.num_timesteps if preset else model.population_size * motivation.n_states
    states, actions = np.ones((n + 1, 36), dtype=np.float32), np.ones((n, 2), dtype=np.float32)
    bonus._compiled = lambda: None  # torch counts its own
    counted = count_products(lambda: bonus.score_trajectory(states, actions))
    before = products.products_of_scores(model)
    model.learn(1, reset_num_timesteps=False)
    scores = products.products_of_scores(model) - before
    assert counted == pytest.approx(scores, rel=1e-3)


def count_products(task):
    """Billions of operations in the matrix products of a task, by torch's own count.

    Not by its `FlopCounterMode`, which imports triton: where that is installed, it may crash.
    """
    with profile(with_flops=True) as profiled:
        task()
    products = ("aten::mm", "aten::addmm", "aten::bmm")
    return 1e-9 * sum(each.flops for each in profiled.key_averages() if each.key in products)


@given(st.floats(1e-3, 1e9))
def test_numbers_keep_three_digits_without_exponents(value):
    text = number(value)
    assert "e" not in text
    assert float(text.replace(",", "")) == pytest.approx(value, rel=0.0051)


def test_a_stage_does_not_count_the_stages_within_it(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(training.time, "perf_counter", lambda: now[0])

    class Algorithm:
        def inner(self):
            now[0] += 3.0

        def outer(self):
            now[0] += 1.0
            self.inner()
            self.inner()
            return "done"

    algorithm, watch = Algorithm(), training.Stopwatch()
    watch.wrap(algorithm, "inner", "inner")
    watch.wrap(algorithm, "outer", "outer")
    assert algorithm.outer() == "done"
    algorithm.inner()
    assert watch.seconds == {"inner": 9.0, "outer": 1.0}


class TestGallery:
    def test_films_what_was_found(self, tmp_path, monkeypatch, capsys):
        search = gallery.Search("CuriosityMaze-Snake-v0", 1.0)
        monkeypatch.setattr(gallery, "FOUND", {"snake": search})
        gallery.main(only="snake", out=tmp_path)
        assert capsys.readouterr().out == "snake: 2000 steps, at no goal\n"
        with Image.open(tmp_path / "snake.gif") as image:
            assert image.n_frames <= gallery.N_FRAMES
            assert image.height == gallery.HEIGHT

    @pytest.mark.extra("locomotion")
    def test_shows_the_best_of_some_starts(self, monkeypatch):
        monkeypatch.setattr(gallery, "N_STARTS", 3)
        search = gallery.Search("CuriosityLocomotion-Hopper-v0", 1.0, "CanonicalES", 4)
        actions, best = gallery.find_actions(search)
        policy = CanonicalES(search.env_id, seed=4).learn(1.0).policy
        env = gym.make(search.env_id)
        played = [list(episode(policy, env, seed))[1:] for seed in range(3)]
        assert best == np.argmax([sum(step.reward for step in steps) for steps in played])
        expected = [step.action for step in played[best]]
        np.testing.assert_allclose(actions, expected, atol=1e-5)

    @pytest.mark.extra("locomotion")
    @pytest.mark.parametrize("name", gallery.PLANNED)
    def test_knows_plans_that_come_to_the_goal(self, name, monkeypatch):
        env_id = gallery.PLANNED[name]
        monkeypatch.setattr(LocomotionEnv, "render", lambda env: np.zeros((4, 4, 3), np.uint8))
        frames, success = gallery.film(env_id, *gallery.read_actions(env_id))
        assert success
        assert 1 < len(frames) <= gallery.N_FRAMES

    @pytest.mark.extra("locomotion")
    def test_plays_at_random_until_an_episode_ends(self):
        env_id, actions, seed = gallery.play("robot_hopper")
        env = gym.make(env_id)
        env.reset(seed=seed)
        ends = [env.step(action)[2] for action in actions]
        assert ends == [False] * (len(actions) - 1) + [True]
        assert len(actions) < gallery.N_STEPS
        assert len(np.unique(actions, axis=0)) == -(-len(actions) // gallery.N_HELD)

    def test_shows_every_environment(self):
        shown = {search.env_id for search in gallery.FOUND.values()}
        shown |= {*gallery.PLANNED.values(), *gallery.RANDOM.values()}
        ids = {name for name in SPECS if name.startswith("Curiosity")}
        assert ids - shown == {"CuriosityMaze-v0"}  # whose layout is the user's

    def test_knows_no_others(self, tmp_path):
        with pytest.raises(typer.BadParameter, match="--only knows snake, us"):
            gallery.main(only="nope", out=tmp_path)


class TestPoliciesAndPortraits:
    """What is made of the runs of the results: policies of the package, pictures of the pages."""

    settings: ClassVar = {
        "algos": ("NSES", "MAPElites"),
        "envs": ("CuriosityMaze-Hard-v0",),
        "timesteps": 1.0,
        "env_kwargs": ["horizon:50"],
    }

    def test_the_best_run_of_each_pair_that_was_rewarded_comes_first(self):
        runs = pd.DataFrame(
            [("A", "x", 0, 0.2), ("A", "x", 3, 0.5), ("A", "y", 1, 0.0), ("B", "y", 2, 0.1)],
            columns=["algorithm", "env", "seed", "best_return"],
        )
        tried = [
            rows[["algorithm", "env", "seed"]].to_numpy().tolist()
            for rows in pretrained.rewarded_pairs(runs)
        ]
        assert tried == [[["A", "x", 3], ["A", "x", 0]], [["B", "y", 2]]]

    @pytest.mark.parametrize("radius", [1.0, 300.0])
    def test_policies_are_trained_and_written(self, radius, tmp_path, monkeypatch, capsys):
        rows = {"algorithm": "NSES", "env": "CuriosityMaze-Hard-v0", "seed": [5, 7]}
        env_kwargs = ["horizon:50", f"goal_radius:{radius}"]
        monkeypatch.setitem(pretrained.SWEEPS, "mazes", self.settings | {"env_kwargs": env_kwargs})
        monkeypatch.setattr(
            pretrained, "read_runs", lambda name: pd.DataFrame(rows | {"best_return": [0.0, 0.5]})
        )
        pretrained.main(tmp_path / "runs", jobs=1, tables="mazes", out=tmp_path)
        told = [line for line in capsys.readouterr().out.splitlines() if line.endswith(" there")]
        path = tmp_path / "NSES_CuriosityMaze-Hard-v0.npz"
        if radius == 1.0:
            assert told == [
                "NSES CuriosityMaze-Hard-v0 7: 0.0000, 0.5000 there",
                "NSES CuriosityMaze-Hard-v0 5: 0.0000, 0.0000 there",
            ]
            assert not path.exists()
            return
        with np.load(path) as file:
            assert file["parameters"].shape == (1746,)
            assert file["net_arch"].tolist() == [32, 16]
            assert file["return"] == 0.98
        assert told == ["NSES CuriosityMaze-Hard-v0 7: 0.9800, 0.5000 there"]

    def test_each_algorithm_has_its_curve_and_map(self, tmp_path, monkeypatch):
        sweep(
            algos="NSES,MAPElites",
            envs="CuriosityMaze-Hard-v0",
            seeds="0",
            timesteps=1.0,
            env_kwargs=self.settings["env_kwargs"],
            log_folder=tmp_path / "runs",
            jobs=1,
        )
        monkeypatch.setattr(portraits, "ALGORITHMS", ("NSES", "MAPElites"))
        portraits.main(tmp_path / "runs", tmp_path)
        for name in ("NSES", "MAPElites"):
            with Image.open(tmp_path / f"portrait_{name}.png") as picture:
                assert min(picture.size) > 300

    def test_the_pages_have_theirs(self):
        for name in learning.ALGORITHMS:
            assert (figures.IMAGES / f"portrait_{name}.png").is_file()
