"""The command `curiosity`, as users run it."""

import builtins
import inspect
import os
import pathlib
import re
import signal
import subprocess
import sys
import time
import traceback

import gymnasium as gym
import numpy as np
import pytest
from filelock import FileLock

from curiosity_algos.cli import app, list_names, main
from curiosity_algos.cli.options import numbers
from curiosity_algos.experiments import film, load_final_states, load_runs, training
from curiosity_algos.experiments import sweep as sweeps
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.robust.measure import Starts

ROOT = pathlib.Path(__file__).parents[3]
HALF = Starts(np.array([True]), np.array([0.5]))
SMALL = ["--env-kwargs", "horizon:100", "--hyperparams", "population_size:8"]


@pytest.mark.extra("render")
def test_train_and_enjoy(curiosity, run_here, tmp_path):
    words = ["--algo", "map_elites", "--env", "CuriosityMaze-US-v0", "-n", "1e4", "--seed", "3"]
    status, printed, errors = curiosity("train", *words, *SMALL, "--preset", "paper")
    assert status == 0, errors
    folder = pathlib.Path("runs", "MAPElites", "CuriosityMaze-US-v0", "3")
    assert printed.startswith(f"{folder}: best return 0.000, no success, coverage reachable")
    runs = load_runs(tmp_path)
    assert runs["settings.sigma"].item() == 0.5
    assert runs["env_kwargs.horizon"].item() == 100
    again = run_here("train", *words, *SMALL, "--preset", "paper")[1]
    assert again == f"{folder} is finished.\n"
    printed = curiosity("enjoy", folder, variables={"SDL_VIDEODRIVER": "dummy"})[1]
    assert printed == f"Return 0.000: {folder / 'best_policy.gif'}\n"
    assert (tmp_path / folder / "best_policy.gif").stat().st_size > 1000


def test_a_window_is_opened_where_there_is_a_screen(run_here, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    called = []
    for name in ("film", "play", "watch"):
        note = lambda source, *_, name=name, **__: called.append((name, source)) or HALF  # noqa: E731
        monkeypatch.setattr(film, name, note)
    for words, variables, shown in [
        ([], {"DISPLAY": ":0"}, "watch"),
        ([], {"WAYLAND_DISPLAY": "wayland-0"}, "watch"),
        ([], {"DISPLAY": ":0", "SDL_VIDEODRIVER": "dummy"}, "film"),
        ([], {}, "film"),
        (["--out", "a.gif"], {"DISPLAY": ":0"}, "film"),
        (["--no-render"], {"DISPLAY": ":0"}, "play"),
        (["--pretrained", "nses"], {}, "film"),
    ]:
        for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
            monkeypatch.delenv(name, raising=False)
        for name, value in variables.items():
            monkeypatch.setenv(name, value)
        assert run_here("enjoy", "run", *words)[1].startswith("Return 0.500")
        source = ("nses", "run") if "--pretrained" in words else pathlib.Path("run")
        assert called.pop() == (shown, source)


@pytest.mark.parametrize(
    ("variables", "libraries", "chosen"),
    [
        ({}, {"EGL", "OSMesa"}, "egl"),
        ({}, {"OSMesa"}, "osmesa"),
        ({"MUJOCO_GL": "glfw"}, {"EGL"}, "glfw"),
        ({"DISPLAY": ":0"}, {"EGL"}, None),
    ],
)
def test_robots_are_drawn_without_a_screen(variables, libraries, chosen, run_here, monkeypatch):
    """By what Gymnasium and dm_control, too, read as they begin to draw."""
    monkeypatch.setattr(sys, "platform", "linux")
    names = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER", "MUJOCO_GL")
    for name in names:
        monkeypatch.setenv(name, "")  # also where it was not set: it is restored
        monkeypatch.delenv(name)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr("ctypes.util.find_library", libraries.__contains__)
    seen = []
    monkeypatch.setattr(
        film, "film", lambda *_, **__: seen.append(os.environ.get(names[3])) or HALF
    )
    assert run_here("enjoy", "run", "--out", "a.gif")[0] == 0
    assert seen == [chosen]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["train", "--algo", "curiosity_ee"], "did you mean CuriosityES"),
        (["train", "--hyperparams", "sigma"], "--hyperparams must be NAME:VALUE"),
        (["train", "-n", "many"], "Invalid value for '--timesteps'"),
        (["train", "--device", "cuda:99"], "`device` must be"),
        (["sweep", "--interval", "0"], "`interval` must be"),
        (["enjoy", "nothing"], "`folder` must be that of a run"),
        (["sweep", "--algos", "ppo", "--seeds", "99999999999,0"], "between 0 and 2**32 - 1"),
        (["sweep", "--envs", "CuriosityMaze-US-v0,"], "--envs must be names with commas"),
        (["trian"], "trian"),
        (["train", "--wrapper", "Mine"], "--wrapper must be MODULE.CLASS"),
        (["train", "--wrapper", "nowhere.Mine"], "nowhere:Mine: No module"),
        (["train", "--wrapper", "gymnasium.wrappers.TimeLimit"], "'max_episode_steps'"),
        (
            ["sweep", "--env-kwargs", "horizon:1", "--env-kwargs", "horizon:2"],
            "--env-kwargs must give horizon one value, got [1, 2]",
        ),
    ],
)
def test_a_mistake_is_one_line(words, message, refused, tmp_path):
    assert message in refused(*words)
    assert not any(tmp_path.iterdir())


class TestErrorsOfAnEnvironment:
    """Whatever their type, and wherever they arise, they keep their traceback."""

    def words(self, place, kind):
        return ["-n", "64", "--env-kwargs", f"fails:{place}", "--env-kwargs", f"error:{kind}"]

    @pytest.mark.parametrize("kind", ["ValueError", "ImportError"])
    @pytest.mark.parametrize("algo", ["ppo", "canonical_es"])
    def test_that_cannot_be_made(self, algo, kind, tracked, monkeypatch):
        words = [*self.words("__init__", kind), "--algo", algo, "--env", tracked]
        monkeypatch.setattr(sys, "argv", ["curiosity", "train", *words])
        with pytest.raises(Exception, match="its own") as raised:
            main()
        assert "in _fail_in\n" in "".join(traceback.format_exception(raised.value))

    @pytest.mark.parametrize(("place", "kind"), [("reset", "OSError"), ("step", "ValueError")])
    def test_that_breaks(self, place, kind, tracked, run_here, tmp_path):
        words = [*self.words(place, kind), "-f", str(tmp_path), "--hyperparams", "n_steps:64"]
        with pytest.raises(getattr(builtins, kind), match="its own") as raised:
            run_here("train", "--algo", "ppo", "--env", tracked, *words)
        error = tmp_path / "PPO" / tracked / "0" / "error.txt"
        assert raised.value.__notes__ == [f"traceback in {error}"]
        assert f"in {place}" in error.read_text()
        words += ["--algos", "ppo", "--envs", tracked, "--seeds", "0", "--jobs", "1"]
        errors = run_here("sweep", *words)[2]
        assert errors.endswith(f"0: its own (traceback in {error})\n")


class TestSweep:
    words = ("sweep", "--algos", "map_elites,nslc", "--seeds", "0,1", "-n", "1e5", *SMALL)

    def kill(self, begin, folder):
        """Begin the sweep, and kill all of it after a checkpoint."""
        silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        words = [*self.words, "--interval", "0.05", "-f", folder]
        process = begin(*words, start_new_session=True, **silent)
        while not list(folder.rglob("checkpoints/[0-9]*")) and process.poll() is None:
            time.sleep(0.01)
        time.sleep(0.1)
        process.kill()  # alone: its commands end by themselves
        process.wait()
        wait_for_the_end_of_runs(folder)

    def test_killed_it_ends_in_the_same_runs(self, run_here, begin, tmp_path, assert_same):
        whole, killed = tmp_path / "whole", tmp_path / "killed"
        here = ("--jobs", "1")
        assert run_here(*self.words, "-f", str(whole), *here)[0] == 0
        self.kill(begin, killed)
        status, _, errors = run_here(*self.words, "-f", str(killed), *here)
        assert status == 0, errors
        one, other = (load_runs(folder) for folder in (whole, killed))
        assert len(one) == 4
        left_out = ["run", "seconds", "total_timesteps"]
        assert one.drop(columns=left_out).equals(other.drop(columns=left_out))
        for first, second in zip(one["run"], other["run"], strict=True):
            assert_same(load_final_states(first), load_final_states(second))

        before = {path: path.stat().st_mtime_ns for path in killed.rglob("*")}
        said = "4 of 4 runs were finished before.\n"
        assert run_here(*self.words, "-f", str(killed))[:2] == (0, said)
        assert {path: path.stat().st_mtime_ns for path in killed.rglob("*")} == before

    @pytest.mark.parametrize("send", [os.kill, os.killpg])
    def test_ctrl_c_leaves_runs_that_go_on(self, begin, tmp_path, send):
        """Whether it comes to all of the sweep, as from a terminal, or to its own process alone."""
        words = [*self.words[: -len(SMALL)], "-n", "1e12", *SMALL, "--jobs", "2"]
        process = begin(*words, start_new_session=True, stderr=subprocess.PIPE)
        while len(list(tmp_path.rglob("progress.csv"))) < 2 and process.poll() is None:
            time.sleep(0.05)
        time.sleep(0.5)
        send(process.pid, signal.SIGINT)
        try:
            said = process.communicate(timeout=120)[1]
        finally:
            process.kill()
        assert process.returncode == 130
        assert "Traceback" not in said
        assert said.endswith(
            "Interrupted: a training goes on from its last checkpoint, if there is one, when the "
            "same command is given again.\n"
        )
        assert load_runs(tmp_path)["seed"].tolist() == [0, 1]  # each has a checkpoint
        wait_for_the_end_of_runs(tmp_path)


REGISTERS = """
import gymnasium as gym
from curiosity_gym.maze.maze_env import MazeEnv

class Mine(MazeEnv):
    pass

for layout in ("us", "hard"):
    gym.register(f"mine/{layout}-v0", Mine, kwargs={"layout": layout, "horizon": 20})
"""


@pytest.fixture
def my_worlds(tmp_path, monkeypatch):
    """A package that nobody has imported, with two environments."""
    (tmp_path / "site" / "my_worlds").mkdir(parents=True)
    (tmp_path / "site" / "my_worlds" / "__init__.py").write_text(REGISTERS)
    monkeypatch.syspath_prepend(tmp_path / "site")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path / "site"), str(ROOT)]))

    def forget():
        sys.modules.pop("my_worlds", None)
        for layout in ("us", "hard"):
            gym.registry.pop(f"mine/{layout}-v0", None)

    yield forget
    forget()


def test_environments_of_another_package_need_nothing_but_their_ids(run_here, tmp_path, my_worlds):
    """In every command, in processes that have not imported the package, and when played again."""
    envs = "my_worlds:mine/us-v0,my_worlds:mine/hard-v0"
    words = ["sweep", "--algos", "map_elites", "--envs", envs, "--seeds", "0", *SMALL[2:]]
    for command in (
        [*words, "-n", "300", "--jobs", "2"],
        [*words, "-n", "600", "--jobs", "1"],  # goes on
        ["enjoy", "runs/MAPElites/mine-us-v0/0", "--no-render", "--trust", "--starts", "2"],
        ["plot", "runs"],
        ["report", "runs", "--out", "report.html"],
    ):
        my_worlds()
        status, printed, errors = run_here(*command)
        assert status == 0, errors
        if command[0] == "enjoy":
            assert printed.startswith("Mean return 0.000, success from 0 of 2 starts (95 % ")
    runs = load_runs(tmp_path)
    assert sorted(runs["env"]) == ["mine/hard-v0", "mine/us-v0"]
    assert (runs["timesteps"] >= 600).all()
    assert "mine/hard-v0" in (tmp_path / "report.html").read_text()


def test_a_module_of_the_working_directory_is_found_where_one_is_named(begin, run_here, tmp_path):
    words = ["train", "--algo", "map_elites", "-n", "300", *SMALL[2:], "--env"]
    as_installed = {"PYTHONSAFEPATH": "1"}  # the folder of a script is not searched
    (tmp_path / "mine.py").write_text(REGISTERS)
    assert begin(*words, "mine:mine/us-v0", variables=as_installed).wait() == 0
    assert load_runs(tmp_path)["env"].item() == "mine/us-v0"
    assert run_here(*words, "CuriosityMaze-US-v0")[0] == 0
    assert str(tmp_path) not in sys.path


SCALES = """
import gymnasium as gym

class Scaled(gym.Wrapper):
    def __init__(self, env, by):
        super().__init__(env)
        self.by = by

    def step(self, action):
        observation, reward, *rest = super().step(action)
        return observation, self.by * reward, *rest
"""


@pytest.fixture
def my_wrapper(tmp_path, monkeypatch):
    """A module of the working directory, with a wrapper that says nowhere how it was made."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "mine.py").write_text(SCALES)
    yield "mine.Scaled"
    del sys.modules["mine"]


@pytest.mark.parametrize(
    ("algo", "given"),
    [("canonical_es", ["population_size:4", "n_parents:2"]), ("ppo", ["n_steps:64"])],
)
def test_a_wrapper_is_there_again_whoever_plays(
    algo, given, run_here, refused, tmp_path, my_wrapper
):
    words = ["train", "--algo", algo, "--env", "CartPole-v1"]
    words += [word for each in given for word in ("--hyperparams", each)]
    wrapped = ["--wrapper", f"{my_wrapper}:by=3.5"]
    wrapped += ["--wrapper", "gymnasium.wrappers.ClipReward:max_reward=1e9"]
    for timesteps in ("64", "1000"):  # from the beginning, and on from there
        status, _, errors = run_here(*words, *wrapped, "-n", timesteps)
        assert status == 0, errors
    run = load_runs(tmp_path).iloc[0]
    assert run["wrappers.Scaled.by"] == 3.5
    assert run["wrappers.ClipReward.max_reward"] == 1e9
    assert run["best_return"] % 3.5 == 0
    assert "`trust` must be given" in refused("enjoy", run["run"], "--no-render")
    printed = run_here("enjoy", run["run"], "--no-render", "--trust")[1]
    assert float(printed.split()[1]) % 3.5 == 0
    other = [*words, "--wrapper", f"{my_wrapper}:by=2", "-n", "1000"]
    assert "wrappers.Scaled.by is 3.5, not 2" in refused(*other)


def wait_for_the_end_of_runs(folder):
    """Until no process holds the folder of a run."""
    for path in folder.rglob("lock"):
        with FileLock(path):
            pass


class TestHelp:
    def test_lists_names(self, run_here):
        status, listed, _ = run_here("list")
        assert status == 0
        for name in ("CuriosityMaze-Hard-v0", "CuriosityES", "PPO", "QRDQN", "apt", "paper"):
            assert f"\n  {name}\n" in listed

    def test_every_command_is_described_whole(self, run_here, monkeypatch):
        monkeypatch.setenv("COLUMNS", "80")
        printed = run_here()[1]
        assert "..." not in printed.replace("[ARGS]...", "")
        for command in app.registered_commands:
            summary = inspect.getdoc(command.callback).split("\n\n")[0]
            assert re.fullmatch(r"[A-Z][^.]{20,}\.", summary)
            assert (
                command.callback is list_names
                or "Example: curiosity " in (run_here(command.callback.__name__, "--help")[1])
            )

    def test_every_option_says_what_it_is(self):
        for command in app.registered_commands:
            for name, parameter in inspect.signature(
                command.callback, eval_str=True
            ).parameters.items():
                text = parameter.annotation.__metadata__[0].help
                assert re.fullmatch(r"[A-Z].* .*\.", text), name
                # Python's word, and what stands where its noun is missing.
                assert not re.search(r"None|^Of |^There\b", text), name


def test_numbers_are_whole_and_in_order():
    assert numbers("seeds", "0-3, 7,9-9") == [0, 1, 2, 3, 7, 9]
    for text in ("", "0,", "3-1", "-1", "0-1-2", "0_1"):
        with pytest.raises(ValueError, match="--seeds must be whole numbers such as 0,1,2 or 0-4"):
            numbers("seeds", text)


@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_terminal_shows_a_bar(is_terminal, run_here, monkeypatch):
    seen = []
    monkeypatch.setattr(training, "train", lambda *_, progress_bar, **__: seen.append(progress_bar))
    for name in ("stdout", "stderr"):
        monkeypatch.setattr(getattr(sys, name), "isatty", lambda: is_terminal)
    assert run_here("train", "--env", "CuriosityMaze-US-v0")[0] == 0
    assert seen == [is_terminal]


def test_several_values_are_a_sweep(run_here, monkeypatch):
    swept = []
    monkeypatch.setattr(sweeps, "sweep", lambda runs, folder, **_: swept.extend(runs))
    words = ["--algos", "map_elites,nslc", "--seeds", "0,1", "--bonus", "none", "-n", "9"]
    for value in ("sigma:0.1", "sigma:0.5", "sigma:0.1"):
        words += ["--hyperparams", value]
    assert run_here("sweep", *words)[0] == 0
    assert len({(run.algorithm, run.seed, run.variant) for run in swept}) == len(swept) == 8
    assert {run.variant: run.settings for run in swept} == {
        f"sigma={sigma}": {"sigma": sigma} for sigma in (0.1, 0.5)
    }


def test_every_option_reaches_the_run(run_here, monkeypatch):
    trained = []
    monkeypatch.setattr(training, "train", lambda *args, **_: trained.append(args))
    words = "--algo ppo --env CartPole-v1 --seed 3 -n 5e3 -f mine --env-kwargs a:[1,None]"
    words += " --hyperparams n_steps:64 --bonus APT --bonus-kwargs weight:.5 --n-envs 2"
    words += " --repeat-action 3 --settle 6e4 --preset paper --device cpu"
    words += " --wrapper gymnasium.wrappers.TimeLimit:max_episode_steps=7"
    assert run_here("train", *words.split())[0] == 0
    ((run, folder),) = trained
    assert folder == pathlib.Path("mine", "PPO+apt", "CartPole-v1", "3")
    assert run == RunSpec(
        *("PPO", "CartPole-v1", 3, 5e3, {"a": [1, None]}),
        {"n_steps": 64, "preset": "paper", "device": "cpu"},
        bonus="apt",
        bonus_kwargs={"weight": 0.5},
        n_envs=2,
        repeat_action=3,
        wrappers=[("gymnasium.wrappers:TimeLimit", {"max_episode_steps": 7})],
        settle=6e4,
    )
