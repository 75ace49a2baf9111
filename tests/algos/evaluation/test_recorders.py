"""What a user wraps to record episodes records those that are played, or a warning says so."""

import gc
import itertools
import warnings
from functools import partial

import gymnasium as gym
import pytest
from gymnasium.wrappers import RecordEpisodeStatistics
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.monitor import Monitor, load_results
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecMonitor

from curiosity_algos import CanonicalES, GoExplore

N_EPISODES = 6
STEPPED = ("Pendulum-v1", {"max_episode_steps": 5})
COMPILED = [
    ("CuriosityMaze-US-v0", {"horizon": 5}),
    pytest.param(
        ("CuriosityControl-BallInCup-v0", {"horizon": 5}), marks=pytest.mark.extra("control")
    ),
    pytest.param(("Swimmer-v5", {"max_episode_steps": 5}), marks=pytest.mark.extra("locomotion")),
]


@pytest.fixture
def monitored(tmp_path):
    """Makes environments in a Monitor with a file, each with its own."""
    numbers = itertools.count()

    def make(kind, task):
        env_id, kwargs = task

        def make_one(number=None):
            number = next(numbers) if number is None else number
            return Monitor(gym.make(env_id, **kwargs), str(tmp_path / str(number)))

        return {
            "function": lambda: lambda: make_one(),
            "env": make_one,
            "VecEnv of 4": lambda: DummyVecEnv([make_one] * 4),
            "VecMonitor": lambda: VecMonitor(DummyVecEnv([make_one] * 2)),
            "processes": lambda: SubprocVecEnv(
                [partial(make_one, i) for i in range(2)], start_method="fork"
            ),
        }[kind]()

    return make


KINDS = ["function", "env", "VecEnv of 4"]


@pytest.mark.filterwarnings("ignore:The environment is already wrapped with a `Monitor`")
@pytest.mark.parametrize("kind", [*KINDS, "VecMonitor", "processes"])
def test_a_monitor_has_a_row_of_each_episode(kind, monitored, make_model, tmp_path):
    model = make_model(CanonicalES, monitored(kind, STEPPED))
    with warnings.catch_warnings(action="error"):
        model.learn(1)
    best = model.best_return
    model.get_env().close()
    rows = load_results(str(tmp_path))
    assert len(rows) == N_EPISODES
    assert rows["r"].max() == best


def test_monitors_of_a_function_must_not_write_one_file(make_model, tmp_path):
    make = lambda: Monitor(gym.make(STEPPED[0]), str(tmp_path / "one"))  # noqa: E731
    with pytest.raises(ValueError, match="`env` must make no Monitors that write one file"):
        make_model(CanonicalES, make).learn(1)
    gc.collect()  # closes them


@pytest.mark.parametrize("task", COMPILED, ids=str)
@pytest.mark.parametrize("kind", KINDS)
def test_of_a_task_that_plays_compiled_it_has_none_and_a_warning_says_so(
    kind, task, monitored, make_model
):
    with pytest.warns(UserWarning, match="Monitor or VecMonitor with a file that gets no rows"):
        model = make_model(CanonicalES, monitored(kind, task))
    model.get_env().close()


def test_a_search_by_restored_states_says_so_too(tmp_path):
    env = Monitor(gym.make("CuriosityMaze-US-v0"), str(tmp_path / "log"))
    with pytest.warns(UserWarning, match="Monitor or VecMonitor with a file that gets no rows"):
        GoExplore(env)


def test_so_does_one_of_a_vec_monitor(make_model, tmp_path):
    inner = DummyVecEnv([lambda: gym.make(STEPPED[0])] * 2)
    with pytest.warns(UserWarning, match="with a file that gets no rows"):
        model = make_model(CanonicalES, VecMonitor(inner, str(tmp_path / "log")))
    model.get_env().close()


def test_nothing_is_said_without_a_file(make_model):
    with warnings.catch_warnings(action="error"):
        make_model(CanonicalES, make_vec_env("CuriosityMaze-US-v0", 2))


@pytest.mark.parametrize("task", [STEPPED, *COMPILED], ids=str)
@pytest.mark.parametrize("n_envs", [None, 1, 4])
def test_recorders_of_gymnasium_see_every_episode(task, n_envs, make_model):
    recorders = []

    def make():
        recorders.append(RecordEpisodeStatistics(gym.make(task[0], **task[1])))
        return recorders[-1]

    model = make_model(CanonicalES, make if n_envs is None else DummyVecEnv([make] * n_envs))
    model.learn(1)
    assert sum(len(each.length_queue) for each in recorders) == N_EPISODES
    assert max(max(each.return_queue) for each in recorders) == pytest.approx(
        model.best_return, abs=1e-5
    )
