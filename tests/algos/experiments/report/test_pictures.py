import gymnasium as gym
import numpy as np
import pandas as pd
import pytest

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


def traces_of(figure, panel):
    return [trace for trace in figure["data"] if trace["yaxis"] == f"y{panel}"]


def test_curves_are_those_of_the_runs(maze):
    figure = draw_curves(maze, color_labels(maze["label"]))
    axes = [figure["layout"][f"yaxis{i}"]["title"] for i in (1, 2, 3)]
    assert axes == ["coverage", "best return so far", "runs without success"]
    _, alone, thin, low, high, mean = traces_of(figure, 1)
    assert [trace["name"] for trace in (alone, mean)] == ["MAPElites", "NSES"]
    ends = maze[maze["label"] == "NSES"]["coverage.reachable"]
    assert mean["y"][-1] == pytest.approx(ends.mean(), rel=1e-6)
    assert np.isnan(thin["x"]).sum() == 3
    assert (low["y"] <= mean["y"] + 1e-9).all()
    assert (mean["y"] <= high["y"] + 1e-9).all()
    assert traces_of(figure, 3)[0]["y"].tolist() == [1.0, 1.0]


def test_elites_are_those_of_the_log(maze):
    alone = maze[maze["algorithm"] == "MAPElites"]
    figure = draw_elites(alone, color_labels(alone["label"]))
    log = load_progress(alone["run"].item())
    for panel, column in enumerate(("archive/qd_score", "archive/size"), 1):
        thin, mean = traces_of(figure, panel)
        np.testing.assert_allclose(thin["y"][:-1], log[column])
        assert mean["y"][-1] == pytest.approx(log[column].iloc[-1])


def test_a_maze_is_drawn_with_its_walls(maze):
    plane = plane_of(maze)
    assert plane.names == ("x (maze units)", "y (maze units)")
    figure = draw_map(maze, plane, 1500.0)
    assert figure["layout"]["xaxis"]["range"] == [0.0, 200.0]
    goal, walls, _ = figure["layout"]["shapes"]
    assert goal["x1"] - goal["x0"] == 4.0
    assert walls["path"].count("Z") == len(plane.maze.layout.walls)
    assert (figure["data"][1]["x"], figure["data"][1]["y"]) == (195, 5)


def test_cells_of_a_maze_are_those_of_coverage(maze):
    grid = plane_of(maze).maze.coverage_grid
    for i in maze.index:
        cells = ~np.isnan(draw_map(maze.loc[[i]], plane_of(maze), 1.0)["data"][0]["z"].T)
        share = (cells & grid.reachable).sum() / grid.reachable.sum()
        assert share == pytest.approx(maze.loc[i, "coverage.reachable"])


def test_a_cell_counts_from_the_first_episode_of_any_run_that_ended_in_it(write_run):
    places = [[0.0, 0.0], [0.99, 0.0], [np.nan, 0.5], [0.0, 9.0]]
    one, other = write_run(places, [10, 20, 30, 40]), write_run([[0.0, 0.0]], [5])
    cells = draw_map(pd.concat([one, other]), SQUARE, 40.0)["data"][0]["z"]
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
        figure = draw_map(runs, plane_of(runs), 1.0)
        assert [figure["layout"][axis]["title"] for axis in ("xaxis", "yaxis")] == expected
        assert f"{expected[1]}: %{{y:.3~g}}" in figure["data"][0]["hovertemplate"]


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
