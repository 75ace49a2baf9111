"""What a user does to the training environment is what plays, or an error."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor
from tracked import Tracked

from curiosity_algos import CanonicalES
from curiosity_algos.evaluation.maze import MazeEvaluator
from curiosity_algos.evaluation.vector import VectorEvaluator

MAZE = "CuriosityMaze-Hard-v0"
ROBOT = "Swimmer-v5"


def make(env_id):
    return gym.make(env_id, **({"horizon": 20} if env_id == MAZE else {"max_episode_steps": 20}))


KINDS = {
    "id": lambda: MAZE,
    "env": lambda: make(MAZE),
    "VectorEnv": lambda: SyncVectorEnv([lambda: make(MAZE)] * 2),
    "VecEnv": lambda: VecMonitor(DummyVecEnv([lambda: make(MAZE)] * 2)),
}


def all_envs(model):
    """Those that a user can lay hands on."""
    env = model.get_env()
    return [*env.unwrapped.envs, *getattr(getattr(env, "vector_env", None), "envs", [])]


@pytest.fixture
def learn(make_model):
    """Lets a model learn for a generation, and gives the lengths of its episodes."""

    def go_on(model):
        lengths = []
        model.learn(1, callback=lambda found, _: lengths.append(found["rollouts"].lengths))
        return set(lengths[0].tolist())

    return go_on


@pytest.mark.parametrize("kind", KINDS)
def test_the_horizon_of_a_maze_can_be_changed(kind, make_model, learn):
    model = make_model(CanonicalES, KINDS[kind]())
    learn(model)
    for env in all_envs(model):
        env.unwrapped.horizon = 7
    assert learn(model) == {7}


def test_so_it_can_of_a_native_vector_env_and_by_set_attr(make_model, learn):
    envs = gym.make_vec(MAZE, 2, "vector_entry_point")
    model = make_model(CanonicalES, envs)
    envs.horizon = 7
    assert learn(model) == {7}
    model = make_model(CanonicalES, MAZE)
    model.get_env().set_attr("horizon", 7)
    assert model.get_env().get_attr("horizon") == [7]
    assert learn(model) == {7}
    assert type(model.evaluator) is MazeEvaluator
    with pytest.raises(AttributeError, match="`env` has no attribute 'horizn'"):
        model.get_env().set_attr("horizn", 7)
    model.get_env().set_attr("horizon", 0)
    with pytest.raises(ValueError, match="`horizon` must be"):
        learn(model)


def test_an_env_that_is_not_changed_keeps_its_evaluator(make_model, learn):
    model = make_model(CanonicalES, make(MAZE))
    evaluator = model.evaluator
    learn(model)
    assert model.evaluator is evaluator


def test_mazes_are_played_as_one_while_they_are_alike(make_model, learn):
    model = make_model(CanonicalES, DummyVecEnv([lambda: make(MAZE)] * 2))
    for horizon, kind in ((7, VectorEvaluator), (20, MazeEvaluator)):
        model.get_env().envs[1].unwrapped.horizon = horizon
        assert learn(model) == {horizon, 20}
        assert type(model.evaluator) is kind


def test_a_method_that_only_the_env_in_sight_has_is_played(make_model, learn):
    model = make_model(CanonicalES, lambda: make(MAZE))
    env = model.get_env().envs[0].unwrapped
    env.step = lambda action: (np.zeros(36, np.float32), 1.0, True, False, {"behavior": np.ones(4)})
    assert learn(model) == {1}
    model.get_env().set_attr("horizon", 9)
    del env.step
    assert learn(model) == {9}


@pytest.mark.parametrize("n_envs", [1, 2])
def test_what_a_monitor_gets_in_its_place_is_refused(n_envs, make_model):
    model = make_model(CanonicalES, make_vec_env(MAZE, n_envs))
    model.get_env().set_attr("horizon", 50)
    with pytest.raises(ValueError, match="`horizon` was set of a wrapper, which MazeEnv does not"):
        model.learn(1)
    assert model.num_timesteps == 0


@pytest.mark.extra("locomotion")
@pytest.mark.parametrize("change", ["gravity", "limit", "method"])
def test_a_robot_of_gymnasium_is_played_as_it_is_now(change, make_model):
    def altered():
        env = make(ROBOT)
        alter(env)
        return env

    def alter(env):
        if change == "gravity":
            env.unwrapped.model.opt.gravity[0] = 9.0
        elif change == "limit":
            env.set_wrapper_attr("_max_episode_steps", 9)
        else:
            env.unwrapped.reset_model = lambda: np.ones(8)

    model, expected = make_model(CanonicalES, make(ROBOT)), make_model(CanonicalES, altered())
    alter(model.get_env().envs[0])
    for each in (model, expected):
        each.learn(1)
    assert model.best_return == expected.best_return
    np.testing.assert_array_equal(model.policy.vector, expected.policy.vector)


@pytest.mark.parametrize("kind", ["id", "function", "VectorEnv"])
def test_what_does_not_reach_all_that_plays_is_refused(kind, tracked, make_model):
    env = SyncVectorEnv([Tracked] * 2) if kind == "VectorEnv" else Tracked
    model = make_model(CanonicalES, tracked if kind == "id" else env)
    venv = model.get_env()
    with pytest.raises(ValueError, match="`env_method` does not reach all environments that play"):
        venv.env_method("set_difficulty", 3)
    with pytest.raises(ValueError, match="`set_attr` does not reach all environments that play"):
        venv.set_attr("difficulty", 3)
    assert venv.get_attr("difficulty") == [0]
    if kind == "VectorEnv":
        venv.vector_env.set_attr("difficulty", 3)
        assert model.learn(1).best_return == 9.0
    venv.close()


def test_nor_does_it_reach_an_evaluator_of_ones_own(make_model):
    own = make_model(CanonicalES, "CartPole-v1").evaluator
    model = make_model(CanonicalES, "CartPole-v1", evaluator=own)
    with pytest.raises(ValueError, match="`set_attr` does not reach all environments that play"):
        model.get_env().set_attr("gravity", 1.0)


@pytest.mark.parametrize("kind", ["env", "VecEnv"])
def test_all_else_reaches_it(kind, tracked, make_model):
    env = Tracked() if kind == "env" else make_vec_env(tracked, 3)
    model = make_model(CanonicalES, env)
    for difficulty in (3, 4):
        model.get_env().env_method("set_difficulty", difficulty)
        model.learn(1, reset_num_timesteps=False)
        assert model.best_return == 3.0 * difficulty
    model.get_env().close()


@pytest.mark.parametrize("kind", KINDS)
def test_options_of_a_reset_are_refused(kind, make_model):
    model = make_model(CanonicalES, KINDS[kind]())
    model.get_env().set_options({"state": (8.0, 8.0, 0.0, 0.0)})
    with pytest.raises(ValueError, match="`set_options` does not reach the episodes"):
        model.learn(1)
    model.get_env().set_options(None)
    model.learn(1)
