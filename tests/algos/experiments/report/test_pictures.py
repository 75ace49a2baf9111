import gymnasium as gym
import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import PatchCollection, QuadMesh

from curiosity_algos import TD3ICM
from curiosity_algos.experiments import load_final_states, load_progress
from curiosity_algos.experiments.description import describe_env
from curiosity_algos.experiments.labels import color_labels
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.report.pictures import (
    N_CELLS,
    Plane,
    draw_curves,
    draw_elites,
    draw_map,
    plane_of,
)
from curiosity_algos.experiments.run_folder import RunFolder
from curiosity_gym import BehaviorWrapper, MazeLayout

SQUARE = Plane(np.zeros(2), np.ones(2), ("x (m)", "y (m)"))
BOX = gym.spaces.Box(-1.0, 1.0, (2,))


@pytest.fixture
def write_run(tmp_path):
    """Writes a run of one environment whose episodes ended in places (n, B) at timesteps (n,)."""

    def write(places, timesteps=(1,), env="Unknown-v0", **described):
        run = RunFolder(tmp_path / f"{len([*tmp_path.iterdir()])}")
        run.begin({"algorithm": "A", "env": env, "seed": 0} | described)
        zeros = np.zeros(len(places))
        columns = {"behavior": places, "timesteps": timesteps, "return": zeros, "generation": zeros}
        run.add_final_states(0, {name: np.array(each) for name, each in columns.items()})
        return pd.DataFrame({"files": [Run(run.path)], "label": ["A"]})

    return write


def cells_of(figure):
    """The timesteps of the cells of a map, by y and x; NaN where no episode ended."""
    (squares,) = [each for each in figure.axes[0].collections if isinstance(each, QuadMesh)]
    return squares.get_array().filled(np.nan)


def test_curves_are_those_of_the_runs(maze, has_ink):
    figure = draw_curves(maze, color_labels(maze["label"]))
    labels = ["coverage (%)", "highest return so far", "runs without success (%)"]
    assert [ax.get_ylabel() for ax in figure.axes] == labels
    coverage = [line for line in figure.axes[0].get_lines() if line.get_linewidth() == 2.0]
    shares = 100.0 * maze.groupby("label", sort=False)["coverage.reachable"].mean()
    assert [line.get_ydata()[-1] for line in coverage] == pytest.approx(list(shares))
    assert set(figure.axes[2].get_lines()[0].get_ydata()) == {100.0}
    assert has_ink(figure, figure.axes[0])


def test_elites_are_those_of_the_log(maze):
    alone = maze[maze["algorithm"] == "MAPElites"]
    figure = draw_elites(alone, color_labels(alone["label"]))
    log = load_progress(alone["run"].item())
    for ax, column in zip(figure.axes, ("archive/qd_score", "archive/size"), strict=True):
        thin, mean = ax.get_lines()
        np.testing.assert_allclose(thin.get_ydata(), log[column])
        assert mean.get_ydata()[-1] == pytest.approx(log[column].iloc[-1])


def test_a_maze_is_drawn_with_its_walls(maze):
    plane = plane_of(maze)
    assert plane.names == ("x (maze units)", "y (maze units)")
    ax = draw_map(maze, plane, 1500.0).axes[0]
    assert ax.get_xlim() == (0.0, 200.0)
    (walls,) = [each for each in ax.collections if isinstance(each, PatchCollection)]
    assert len(walls.get_paths()) == len(plane.maze.layout.walls)


def test_cells_of_a_maze_are_those_of_coverage(maze):
    grid = plane_of(maze).maze.coverage_grid
    for i in maze.index:
        cells = ~np.isnan(cells_of(draw_map(maze.loc[[i]], plane_of(maze), 1.0)).T)
        share = (cells & grid.reachable).sum() / grid.reachable.sum()
        assert share == pytest.approx(maze.loc[i, "coverage.reachable"])


def test_a_cell_counts_from_the_first_episode_of_any_run_that_ended_in_it(write_run):
    places = [[0.0, 0.0], [0.99, 0.0], [np.nan, 0.5], [0.0, 9.0]]
    one, other = write_run(places, [10, 20, 30, 40]), write_run([[0.0, 0.0]], [5])
    cells = cells_of(draw_map(pd.concat([one, other]), SQUARE, 40.0))
    assert (cells[0, 0], cells[0, -1], cells[-1, 0]) == (5, 20, 40)  # what is outside counts beside
    assert np.isnan(cells).sum() == N_CELLS**2 - 3


def test_another_environment_is_drawn_around_most_final_states(mountain, write_run):
    plane = plane_of(mountain)
    points = load_final_states(mountain["run"].item())["behavior"]
    np.testing.assert_allclose(plane.low, points.min(axis=0), atol=0.1)
    np.testing.assert_allclose(plane.high, points.max(axis=0), atol=0.1)
    assert plane.maze is None
    far = write_run([*np.random.default_rng(0).random((500, 2)), [1e9, 0.0]], np.arange(501))
    assert (plane_of(far).high < 1.01).all()
    same = plane_of(write_run([[0.1, 0.2]]))
    np.testing.assert_allclose(same.high, [1.1, 1.2])
    for places in ([[0.1]], [[]], [[np.nan, 1.0]]):
        assert plane_of(write_run(places)) is None


def test_axes_have_the_names_of_the_behavior(write_run):
    old = write_run([[0.1, 0.2, 0.0]])  # of a folder that was written before there were names
    names = {"behavior_names": ["ball x (m)", "ball z (m)", "cup x (m)"]}
    for runs, expected in [
        (old, ["behavior 1", "behavior 2"]),
        (pd.concat([old, write_run([[0.1, 0.2, 0.0]], **names)]), ["ball x (m)", "ball z (m)"]),
    ]:
        ax = draw_map(runs, plane_of(runs), 1.0).axes[0]
        assert [ax.get_xlabel(), ax.get_ylabel()] == expected


def test_an_environment_that_cannot_be_made_again_has_no_walls(write_run, monkeypatch):
    def maze_of(**described):
        return plane_of(write_run([[0.1, 0.2]], **described)).maze

    def described(env):
        return describe_env(TD3ICM._wrap_env(env))

    hard = gym.make("CuriosityMaze-Hard-v0")
    assert maze_of(**described(gym.wrappers.RepeatAction(hard, 10))) is not None
    other = BehaviorWrapper(hard, lambda env, observation, info: observation[:2], BOX)
    for run in ({"env": "Unknown-v0"}, {"env": None}, described(other)):
        assert maze_of(**run) is None
    # A stranger's folder makes no environment, and imports no module, that is not known here.
    monkeypatch.setattr(gym, "make", lambda *args, **kwargs: pytest.fail("made"))
    spec = {"id": "Mine-v0", "entry_point": "antigravity:Mine", "additional_wrappers": []}
    assert maze_of(env="Mine-v0", env_spec=described(hard)["env_spec"] | spec) is None


def test_walls_are_those_that_the_file_had(write_run, tmp_path):
    drawn, moved = (MazeLayout.from_ascii(text) for text in ("S.G.\n....", "S..G\n...."))
    drawn.to_json(tmp_path / "own.json")
    env = gym.make("CuriosityMaze-v0", layout=str(tmp_path / "own.json"))
    moved.to_json(tmp_path / "own.json")
    run = write_run([[0.1, 0.2]], **describe_env(TD3ICM._wrap_env(env)))
    assert plane_of(run).maze.layout == drawn
