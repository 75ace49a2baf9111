"""The paper's figures: the command that trains and draws them, the runs they need, each picture."""

import json
import math
import pathlib
import re
import sys
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
import typer
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.colors import to_hex
from padded_rollouts import rollouts_of
from PIL import Image

from benchmarks import paper_figures, projection
from benchmarks.paper_figures import EPISODES, generation_return, show_final_states, show_mazes
from benchmarks.plan import (
    BUDGETS,
    COMPARED,
    CONTROL,
    MAZES,
    NAMES,
    SMOKE_GOALS,
    Plan,
    Series,
    series_of,
)
from benchmarks.projection import (
    N_STATES,
    Projection,
    Rewarding,
    last_states,
    project_rewarding,
    replay_rewarding,
    show_projection,
)
from benchmarks.reproduce import TrainedRuns, app
from curiosity_algos import MAPElites
from curiosity_algos.cli import main
from curiosity_algos.evaluation import evaluator
from curiosity_algos.experiments import SaveRun, load_runs, statistics
from curiosity_algos.experiments.labels import COLORS
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.measures import best_return
from curiosity_algos.experiments.run_folder import RunFolder
from curiosity_gym.built_in import BUILT_IN

FIGURES = range(1, 9)


# -- the command ----------------------------------------------------------------------------------


@pytest.fixture
def reproduce(tmp_path, monkeypatch, capsys):
    """Runs the command in this process: its status, what it prints, and its errors."""
    monkeypatch.chdir(tmp_path)

    def run(words):
        monkeypatch.setattr(sys, "argv", ["reproduce", *words.split()])
        with pytest.raises(SystemExit) as ended:
            main(app)
        return (ended.value.code, *capsys.readouterr())

    return run


@pytest.mark.nightly
@pytest.mark.extra("control")
def test_all_eight_figures(reproduce, tmp_path, has_ink, monkeypatch):
    monkeypatch.setattr(statistics, "N_RESAMPLES", 100)  # how wide intervals are is tested there
    folder = tmp_path / "runs" / "paper-smoke"
    plan = Plan(folder, BUDGETS["smoke"], "paper", BUDGETS["smoke"].seeds)
    status, printed, errors = reproduce("1 2 3 4 5 6 7 8 --budget smoke")
    assert status == 0, errors
    paths = [pathlib.Path("runs", "paper-smoke", f"figure_{i}.png") for i in FIGURES]
    assert printed.splitlines()[-8:] == list(map(str, paths))
    for figure, path in enumerate(paths, start=1):
        assert min(Image.open(tmp_path / path).size) > 300
        drawing = paper_figures.draw(figure, TrainedRuns(plan))
        assert has_ink(drawing, *drawing.axes)
    needed = {run.folder(folder) for figure in FIGURES for run in plan.runs(figure)}
    assert set(map(pathlib.Path, load_runs(folder)["run"])) == needed


@pytest.mark.nightly
def test_what_is_finished_is_not_done_again(reproduce, tmp_path):
    words = "8 --seeds 5 --jobs 1 -f mine"
    status, _, errors = reproduce(f"{words} --out first.pdf")
    assert status == 0, errors
    assert load_runs("mine")["seed"].tolist() == [5, 5, 5]
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "mine").rglob("*")}
    said = "3 of 3 runs were finished before.\nsecond.svg\n"
    assert reproduce(f"{words} --out second.svg")[:2] == (0, said)
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "mine").rglob("*")} == before
    assert (tmp_path / "first.pdf").read_bytes().startswith(b"%PDF")
    assert "<!-- Budget smoke" in (tmp_path / "second.svg").read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        # Releases of typer differ in capitals, and in how they say what is allowed.
        ("9", "Invalid value for '(?i:figures).*(1<=x<=8|less than or equal to 8)"),
        ("2 --budget tiny", "`budget` must be one of smoke, short, tenth, paper"),
        ("1 --preset best", "`preset` must be one of paper, tuned"),
        ("2 --out reward.jpg", "`out` must be one of .png, .pdf, .svg"),
        ("2 3 --out both.png", "`out` must be left out"),
        ("2 --jobs 0", "`jobs` must be a whole number of at least 1"),
    ],
)
def test_a_mistake_is_one_line(words, message, reproduce, tmp_path):
    status, printed, errors = reproduce(words)
    (line,) = errors.splitlines()
    assert re.search(message, line)
    assert (status != 0, printed) == (True, "")
    assert not any(tmp_path.iterdir())


# -- the runs -------------------------------------------------------------------------------------


def make_plan(budget="paper"):
    return Plan(pathlib.Path("runs"), BUDGETS[budget], "paper", (3, 4))


def folders(figure):
    return [str(run.folder("runs")) for run in make_plan().runs(figure)]


def test_figures_share_runs():
    assert not folders(1)
    assert set(folders(2)) == set(folders(3))
    assert len(folders(2)) == len(COMPARED) * len(MAZES) * 2
    assert set(folders(4)) | set(folders(8)) < set(folders(2))
    assert {folder.split("/")[1] for folder in folders(8)} == {"CuriosityES", "CMAME", "MAPElites"}
    assert len(folders(4)) == 9 * 2
    assert set(folders(5)) & set(folders(6))  # those that have nothing to switch off


def test_no_two_runs_share_a_folder():
    runs = {}
    for figure in FIGURES:
        for run in make_plan().runs(figure):
            assert runs.setdefault(run.folder("runs"), run) == run


def test_coverage_of_control_tasks_is_without_reward():
    settings = {run.algorithm: run.settings for run in make_plan().runs(6)}
    assert settings["CuriosityES"]["phi"] == settings["NSES"]["phi"] == 0.0
    assert settings["TD3ICM"]["extrinsic"] is False
    assert not {"phi", "extrinsic"} & (settings["MAPElites"].keys() | settings["CMAME"].keys())
    assert not any({"phi", "extrinsic"} & run.settings.keys() for run in make_plan().runs(5))
    assert "runs/phi=0.0/NSES/CuriosityControl-Finger-v0/3" in folders(6)


def test_the_bottleneck_compares_behaviors():
    panels = series_of(7)
    assert [env.split("-")[1] for env in panels] == ["Snake", "US", "Finger"]
    labels = ["Curiosity-ES", "NS-ES", "NSLC", "NS-ES (whole state)", "NSLC (whole state)"]
    for panel in panels.values():
        assert [series.label for series in panel] == [*labels, "AURORA", "MAP-Elites"]
    assert "runs/behavior=state,phi=0.0/NSES/CuriosityControl-Finger-v0/3" in folders(7)
    assert "runs/behavior=state/NSES/CuriosityMaze-US-v0/3" in folders(7)


def test_budgets():
    assert BUDGETS["paper"].seeds == (0, 1, 2, 3, 4)
    for env, horizon in [(MAZES[0], 2000), (CONTROL[0], 1000)]:
        run = make_plan().run(Series("NSES"), env, 0)
        assert run.timesteps == 2000 * 56 * horizon
        assert run.settings["preset"] == "paper"
        assert not run.env_kwargs
        assert make_plan().run(Series("TD3ICM"), env, 0).timesteps < run.timesteps / 100
    for name, budget in BUDGETS.items():
        plan = make_plan(name)
        assert all(run.timesteps > 0 for figure in FIGURES for run in plan.runs(figure))
        assert bool(budget.env_kwargs) == bool(plan.note(2))


def test_figures_of_easier_tasks_say_so():
    for env, radius in SMOKE_GOALS.items():
        assert BUDGETS["smoke"].env_kwargs[env]["goal_radius"] == radius
        assert f"{radius:g} ({env.split('-')[1]})" in make_plan("smoke").note(2)
    assert not make_plan("smoke").note(1)  # the mazes as they are


# -- curves ---------------------------------------------------------------------------------------

RESULT = {"total_timesteps": 0, "n_episodes": 0, "best_return": None, "coverage": {}}
RESULT |= {"first_success_timesteps": None, "seconds": 0.0, "pending_log": {}, "ended": True}


@pytest.fixture
def plan(tmp_path):
    return Plan(tmp_path, BUDGETS["smoke"], "paper", (0, 1))


def write(folder, returns, timesteps):
    """A finished run whose generations, of 100 timesteps, had these returns."""
    run = RunFolder(folder)
    run.begin({"algorithm": folder.parts[-3], "env": folder.parts[-2], "seed": 0})
    returns = np.array(returns)
    steps = 100 * np.arange(1, len(returns) + 1)
    columns = {"generation": steps // 100, "timesteps": steps, "return": returns.astype(float)}
    run.add_final_states(0, columns | {"behavior": np.zeros((len(steps), 2))})
    rows = [f"{step},{min(1.0, step / 1e4)}" for step in steps]
    run.progress.write_text("\n".join(["time/total_timesteps,coverage/reachable", *rows, ""]))
    result = json.dumps(RESULT | {"timesteps": timesteps})
    run.commit(timesteps, lambda to: (to / "result.json").write_text(result))


@pytest.fixture
def finished(plan):
    """All the runs on mazes; of CMAME none has found reward."""
    for i, run in enumerate(plan.runs(2)):
        returns = [0.0, 0.0, 0.0] if run.algorithm == "CMAME" else [0.0, 0.5 + i / 100, 0.3]
        write(run.folder(plan.folder), returns, int(run.timesteps))
    return plan


def lines_of(ax, width):
    return [line for line in ax.get_lines() if line.get_linewidth() == width]


def test_lines_are_those_of_the_runs(finished, has_ink):
    figure = paper_figures.draw(2, TrainedRuns(finished))
    assert len(figure.axes) == len(MAZES)
    for ax in figure.axes:
        assert ax.get_xlabel() == "timesteps (millions)\nno reward: CMA-ME"
        assert has_ink(figure, ax)
    shown = [text.get_text() for text in figure.legends[0].get_texts()]
    assert shown == ["Curiosity-ES", "NS-ES", "MAP-Elites", "TD3-ICM"]
    assert figure.legends[0].get_title().get_text() == "Highest return so far: preset paper"
    assert "interquartile mean of 2 runs" in figure._supxlabel.get_text()
    ax = figure.axes[1]  # US; its runs are numbered from 10 on, two of each algorithm
    ends = [line.get_ydata()[-1] for line in lines_of(ax, 2.0)]
    np.testing.assert_allclose(ends, [0.605, 0.625, 0.645, 0.685])
    runs = [run for run in finished.runs(2) if (run.algorithm, run.env) == ("NSES", MAZES[1])]
    curves = [best_return(Run(run.folder(finished.folder))) for run in runs]
    for line, (timesteps, values) in zip(lines_of(ax, 0.6)[2:4], curves, strict=True):
        np.testing.assert_allclose(line.get_xdata(), timesteps / 1e6)
        np.testing.assert_array_equal(line.get_ydata(), values)


def test_a_panel_without_reward_says_so(finished, has_ink):
    for run in finished.runs(5):
        write(run.folder(finished.folder), [0.0], int(run.timesteps))
    figure = paper_figures.draw(5, TrainedRuns(finished))
    names = [NAMES[name] for name in COMPARED]
    assert len(figure.axes) == len(CONTROL)  # none has any
    for ax in figure.axes:
        assert has_ink(figure, ax)
        assert " ".join(ax.get_xlabel().split()).endswith(f"no reward: {', '.join(names)}")


@pytest.mark.parametrize("has_generations", [True, False])
def test_56_episodes_are_a_generation_where_there_is_none(has_generations, tmp_path):
    n = 2 * EPISODES + 3
    returns = np.random.default_rng(0).random(n)
    generation = np.arange(n) // 50 if has_generations else np.zeros(n, int)
    run = RunFolder(tmp_path)
    run.begin({"algorithm": "TD3ICM", "env": MAZES[1], "seed": 0})
    columns = {"generation": generation, "timesteps": 10 * np.arange(1, n + 1), "return": returns}
    run.add_final_states(0, columns | {"behavior": np.zeros((n, 2))})
    timesteps, best = generation_return(Run(tmp_path))
    ends = [50, 100, n] if has_generations else [56, 112, n]
    assert timesteps.tolist() == [10 * end for end in ends]
    assert best.tolist() == [max(returns[a:b]) for a, b in zip([0, *ends[:2]], ends, strict=True)]


def test_a_run_that_is_missing_is_named(finished):
    run = finished.runs(2)[3]
    checkpoint = RunFolder(run.folder(finished.folder)).checkpoint
    (checkpoint / "result.json").write_text(json.dumps(RESULT | {"timesteps": 5}))
    missing = str(pathlib.Path(run.algorithm, run.env, str(run.seed)))
    with pytest.raises(FileNotFoundError, match=rf"^`log_folder` must hold .*{missing}.*$"):
        paper_figures.draw(3, TrainedRuns(finished))


def evidence(points_of, n=3):
    """What a figure is drawn of: n curves of two points, at these times and heights, or none."""

    def curves(series, env, measure):
        points = points_of(series.algorithm, env)
        return [tuple(map(np.array, zip((0.0, 0.0), points, strict=True)))] * n if points else []

    return SimpleNamespace(about="all", curves=curves)


def test_coverage_of_control_tasks_has_a_ceiling():
    of_searches = evidence(lambda algorithm, _: None if algorithm == "TD3ICM" else (1e6, 1e-3))
    figure = paper_figures.draw(6, of_searches)
    n_cells = dict(zip(CONTROL, (50**4, 50**3, 50**2), strict=True))
    for ax, env in zip(figure.axes, CONTROL, strict=True):
        assert ax.get_yscale() == "log"
        (ceiling,) = [line for line in ax.get_lines() if line.get_color() == "gray"]
        x, y = ceiling.get_data()
        assert x[-1] == 1.0  # of a thousand episodes, each in a cell of its own
        assert y[-1] == pytest.approx(100.0 * 1000 / n_cells[env])
        assert ax.get_ylim()[1] > y[-1]
    assert "logarithmic" in figure._supxlabel.get_text()


def test_a_panel_that_nobody_has_is_left_out():
    def points_of(algorithm, env):
        return 1e5 if algorithm == "TD3ICM" else 1e6, 0.0 if env == CONTROL[1] else 0.5

    figure = paper_figures.draw(5, evidence(points_of, 5))
    assert [ax.get_title() for ax in figure.axes] == ["BallInCup", "Stacker"]
    assert figure._supxlabel.get_text().endswith("No algorithm found a reward in Finger.")
    dots = [line for line in figure.axes[0].get_lines() if line.get_marker() == "."]
    assert [line.get_xdata() for line in dots] == [[0.1]]  # no line goes on beyond its runs


def test_what_was_not_trained_is_named():
    of_searches = evidence(lambda algorithm, _: None if algorithm == "TD3ICM" else (10.0, 0.5))
    for ax in paper_figures.draw(2, of_searches).axes:
        assert ax.get_xlabel() == "timesteps (millions)\nnot trained: TD3-ICM"


# -- mazes ----------------------------------------------------------------------------------------

ENVS = MAZES[:2]


def walk(start, angle, reach, layout):
    """Length of a beam, by small steps until a wall or the border is met."""
    lengths = np.arange(0.0, reach, 0.01)
    x, y = start[0] + lengths * math.cos(angle), start[1] + lengths * math.sin(angle)
    is_hit = (x <= 0.0) | (x >= layout.width) | (y <= 0.0) | (y >= layout.height)
    for left, bottom, width, height in layout.walls:
        is_hit |= (left < x) & (x < left + width) & (bottom < y) & (y < bottom + height)
    return lengths[is_hit.argmax()] if is_hit.any() else reach


def test_beams_end_where_a_wall_begins(has_ink):
    figure = show_mazes(ENVS)
    layout = BUILT_IN["us"]
    ax = figure.axes[1]
    (beams,) = [each for each in ax.collections if isinstance(each, LineCollection)]
    segments = np.array(beams.get_segments())
    assert segments.shape == (32, 2, 2)
    reach = gym.make(ENVS[1]).unwrapped.lidar_range
    for i, (start, end) in enumerate(segments):
        assert tuple(start) == layout.start
        angle = 2.0 * math.pi * i / 32
        expected = walk(layout.start, angle, reach, layout)
        direction = math.cos(angle), math.sin(angle)
        np.testing.assert_allclose(end - start, expected * np.array(direction), atol=0.02)
    hits = ax.get_lines()[2].get_xydata()
    assert 0 < len(hits) < 32  # along the corridor nothing is hit
    assert has_ink(figure, *figure.axes)
    assert [each.get_title() for each in figure.axes] == ["Snake", "US"]


def test_every_final_state_is_in_its_square():
    rng = np.random.default_rng(0)
    states = {
        name: {env: rng.poisson(rate, (100, 100)) for env, rate in zip(ENVS, rates, strict=True)}
        for name, rates in {"NSES": (0.1, 5.0), "CMAME": (1.0, 0.0)}.items()
    }
    figure = show_final_states(states, "all")
    *panels, bar = figure.axes
    assert "positions in a square of 2 x 2" in bar.get_ylabel()
    titles = [(name, env) for name in states for env in ENVS]
    norms = set()
    for ax, (name, env) in zip(panels, titles, strict=True):
        counts = states[name][env]
        shown = f"{NAMES[name]} on {env.split('-')[1]}, {counts.sum():,} episodes"
        assert ax.get_title() == shown
        (squares,) = [each for each in ax.collections if isinstance(each, QuadMesh)]
        shown = squares.get_array()
        np.testing.assert_array_equal(shown.filled(0), counts)
        assert (shown.mask == (counts == 0)).all()  # which are left as they are
        norms.add(squares.norm)
    assert len(norms) == 1  # a color means the same in every panel


# -- rewarding policies ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Of a maze that many policies solve."""
    folder = tmp_path_factory.mktemp("run")
    env = gym.make(MAZES[1], horizon=60, goal_radius=91.5)
    small = {"population_size": 8, "policy_kwargs": {"net_arch": [4]}, "n_threads": 1}
    MAPElites(env, seed=0, **small).learn(3000, SaveRun(folder))
    return folder


def stored(run):
    return np.load(RunFolder(run).checkpoint / "rewarding.npz")


def test_policies_that_are_played_again_do_what_they_did(run, monkeypatch):
    rewarding, returns = replay_rewarding(Run(run)), stored(run)["return"]
    assert len(np.unique(stored(run)["episode_seed"])) > 2
    assert len(returns) > 10
    np.testing.assert_allclose(rewarding.returns, returns, atol=5e-7)  # stored with 6 digits
    assert rewarding.states.shape == (len(returns), N_STATES, 36)
    # The last state is at the goal: 91.5 from the middle.
    x, y = 100.0 + 100.0 * rewarding.states[:, -1, :2].T.astype(float)
    assert (np.hypot(x - 100.0, y - 100.0) <= 91.51).all()
    monkeypatch.setattr(projection, "MOST_POLICIES", 5)
    monkeypatch.setattr(evaluator, "BATCH", 2)
    some = replay_rewarding(Run(run))
    assert len(some.returns) == 5
    assert set(some.returns) <= set(rewarding.returns)


def test_the_first_state_stands_before_a_short_episode():
    observations = np.arange(2 * 6 * 1, dtype=np.float32).reshape(2, 6, 1)
    last = last_states(rollouts_of(observations, [2, 5]), 4)
    assert last[:, :, 0].tolist() == [[0.0, 0.0, 1.0, 2.0], [8.0, 9.0, 10.0, 11.0]]


def test_policies_of_all_runs_are_projected_together():
    """On the singular vectors of their states."""
    rng = np.random.default_rng(0)
    states = rng.normal(size=(40, 3, 5)) * np.array([9.0, 5.0, 1.0, 1.0, 1.0])
    parts = np.split(states.astype(np.float32), [10, 25])
    returns = [rng.random(len(part)) for part in parts]
    one, other, third = map(Rewarding, parts, returns)
    found = project_rewarding({"NSES": [one, other], "CMAME": [], "NSLC": [third]})
    assert found.algorithms == ("NSES", "CMAME", "NSLC")
    assert found.owners.tolist() == [0] * 25 + [2] * 15
    np.testing.assert_array_equal(found.returns, np.concatenate(returns))
    flat = states.reshape(40, -1)
    u, s, _ = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)
    for i in range(2):
        sign = np.sign(u[0, i] * found.scores[0, i])
        np.testing.assert_allclose(found.scores[:, i], sign * u[:, i] * s[i], rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(found.shares, s[:2] ** 2 / (s**2).sum(), rtol=1e-4)


def test_both_panels_show_every_policy(has_ink):
    rng = np.random.default_rng(0)
    shown = Projection(
        algorithms=("CuriosityES", "CMAME", "MAPElites"),
        owners=np.repeat([0, 2], [30, 8]),
        scores=rng.normal(size=(38, 2)),
        returns=rng.random(38),
        shares=np.array([0.5, 0.2]),
    )
    figure = show_projection(shown, [3000, 0, 8], "US")
    left, right, bar = figure.axes
    assert bar.get_ylabel() == "return"
    assert left.get_xlabel() == "component 1 (50% of the variance)"
    dots = [ax.collections[0] for ax in (left, right)]
    np.testing.assert_array_equal(*(each.get_offsets() for each in dots))
    colors = [COLORS["CuriosityES"]] * 30 + [COLORS["MAPElites"]] * 8
    expected = zip(shown.scores.tolist(), shown.returns, map(str.lower, colors), strict=True)
    faces = [to_hex(color) for color in dots[0].get_facecolors()]
    drawn = zip(dots[0].get_offsets().tolist(), dots[1].get_array(), faces, strict=True)
    assert sorted(drawn) == sorted(expected)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["Curiosity-ES (3,000)", "CMA-ME (no reward)", "MAP-Elites (8)"]
    assert has_ink(figure, left, right)


def test_there_must_be_something_to_project():
    none = Rewarding(np.empty((0, N_STATES, 36), np.float32), np.empty(0))
    with pytest.raises(typer.BadParameter, match="`runs` must have 3 rewarding policies, they"):
        project_rewarding({"NSES": [none]})
