from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from saved_files import through_a_file
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecFrameStack, VecMonitor

from curiosity_algos.sb3.gymnasium_vec_env import GymnasiumVecEnv
from curiosity_algos.state.episodes import episode_states, load_episode_states, record_episodes
from curiosity_gym import RecordEpisode

MAZE = "CuriosityMaze-US-v0"


def step_n(venv, n, seed):
    rng = np.random.default_rng(seed)
    for _ in range(n):
        actions = rng.uniform(-1, 1, (venv.num_envs, 2)).astype(np.float32)
        observations, rewards, dones, infos = venv.step(actions)
    return observations, rewards, dones, infos


def make_recorded(n_envs=2, horizon=50):
    return make_vec_env(
        MAZE, n_envs, seed=0, env_kwargs={"horizon": horizon}, wrapper_class=RecordEpisode
    )


def make_batched(env_id=MAZE, horizon=50, num_envs=2):
    mode = {"vectorization_mode": "vector_entry_point", "autoreset_mode": "SameStep"}
    envs = gym.make_vec(env_id, num_envs=num_envs, horizon=horizon, **mode)
    return VecMonitor(GymnasiumVecEnv(envs))


@pytest.mark.parametrize(
    "make",
    [
        make_recorded,
        lambda: VecMonitor(make_recorded()),
        make_batched,
        pytest.param(
            partial(make_batched, "CuriosityControl-BallInCup-v0"),
            marks=pytest.mark.extra("control"),
        ),
    ],
)
def test_episodes_go_on_elsewhere(make):
    one, other = make(), make()
    one.reset()
    step_n(one, 70, seed=0)
    assert load_episode_states(other, through_a_file(episode_states(one)))
    ends = [step_n(venv, 30, seed=1) for venv in (one, other)]
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    for mine, theirs in zip(ends[0][3], ends[1][3], strict=True):
        assert mine["episode"]["l"] == theirs["episode"]["l"] == 50
        assert mine["episode"]["r"] == theirs["episode"]["r"]


def test_episodes_of_other_processes_go_on():
    makers = [partial(_record, 0), partial(_record, 1)]
    one = SubprocVecEnv(makers, start_method="spawn")
    one.reset()
    step_n(one, 20, seed=0)
    state = episode_states(one)
    here = DummyVecEnv(makers)
    assert load_episode_states(here, state)
    np.testing.assert_array_equal(step_n(one, 5, seed=1)[0], step_n(here, 5, seed=1)[0])
    one.close()


def _record(seed):
    env = RecordEpisode(gym.make(f"curiosity_gym:{MAZE}"))
    env.np_random = np.random.default_rng(seed)
    return env


def test_environments_are_recorded_from_their_next_resets_on():
    venv = make_vec_env(MAZE, 2, env_kwargs={"horizon": 20})
    venv.reset()
    record_episodes(venv)
    assert episode_states(venv) is None
    step_n(venv, 25, seed=0)
    assert [len(each["actions"]) for each in episode_states(venv)["episodes"]] == [5, 5]
    record_episodes(venv)
    assert not isinstance(venv.envs[0].env, RecordEpisode)


class Own(VecFrameStack):
    """A user's wrapper, whose state is none that a file of this package could hold."""

    def __init__(self, venv):
        super().__init__(venv, n_stack=2)

    def state_dict(self):
        return {"thing": object()}


@pytest.mark.parametrize(
    "make",
    [
        lambda: Own(make_recorded()),
        lambda: make_vec_env("Pendulum-v1"),
        lambda: VecFrameStack(make_recorded(), 2),
        lambda: DummyVecEnv([lambda: RecordEpisode(gym.make(MAZE)), lambda: gym.make(MAZE)]),
    ],
    ids=["of a user", "not recorded", "a stack of observations", "recorded by half"],
)
def test_there_is_no_state_rather_than_half_of_it(make):
    venv = make()
    venv.reset()
    assert episode_states(venv) is None
    assert not load_episode_states(venv, None)


def test_options_that_no_file_can_hold_are_no_state():
    venv = DummyVecEnv([lambda: RecordEpisode(gym.make("Pendulum-v1"))])
    venv.set_options({"x_init": 1.0, "goals": {1}})
    venv.reset()
    assert episode_states(venv) is None


def test_environments_that_are_stepped_at_once_have_no_state_before_they_begin():
    assert episode_states(make_batched()) is None


@pytest.mark.parametrize(
    "other",
    [
        make_recorded,
        lambda: make_recorded(horizon=10),
        lambda: VecMonitor(make_batched()),
        lambda: make_batched(num_envs=3),
        lambda: make_vec_env(MAZE, 2),
    ],
)
@pytest.mark.parametrize("make", [lambda: VecMonitor(make_recorded()), make_batched])
def test_other_environments_begin_anew_and_say_so(make, other):
    one, other = make(), other()
    one.reset()
    step_n(one, 30, seed=0)
    with pytest.warns(UserWarning, match="Episodes begin anew: `env` is another"):
        assert not load_episode_states(other, episode_states(one))
