"""Episodes of policies, as a dataset needs them."""

import gymnasium as gym
import numpy as np
import pytest

from curiosity_algos.evaluation import vector
from curiosity_algos.evaluation.policies import build_mlp
from curiosity_algos.experiments.export import episodes, stages
from curiosity_algos.experiments.export.episodes import play
from curiosity_algos.experiments.export.population_run import Policies


def make_policies(env, n):
    mlp = build_mlp(env.observation_space, env.action_space, [4])
    parameters = np.random.default_rng(0).standard_normal((n, mlp.n_parameters))
    return mlp, Policies(parameters.astype(np.float32), np.arange(n) % 3)


def by_bytes(played):
    """Episodes whatever their order."""
    return sorted((e.seed, e.observations.tobytes(), e.rewards.tobytes()) for e in played)


@pytest.mark.parametrize("env_id", ["CartPole-v1", "CuriosityMaze-US-v0"])
def test_how_many_play_side_by_side_makes_no_difference(env_id, monkeypatch):
    env = gym.make(env_id, max_episode_steps=40)
    mlp, policies = make_policies(env, 7)
    many = list(play(env, mlp, policies))
    monkeypatch.setattr(stages, "N_ENVS", 2)
    monkeypatch.setattr(stages, "N_SIMULATIONS", 2)
    few = list(play(env, mlp, policies))
    assert len(few) == 7
    assert by_bytes(few) == by_bytes(many)


@pytest.mark.parametrize(("limit", "truncated"), [("horizon", False), ("max_episode_steps", True)])
def test_a_success_in_the_last_step_ends_as_in_the_environment(limit, truncated):
    env = gym.make("CuriosityMaze-US-v0", goal_radius=91.5)
    mlp, policies = make_policies(env, 40)
    found = min(play(env, mlp, policies), key=lambda episode: len(episode.actions))
    n_steps = len(found.actions)
    env = gym.make("CuriosityMaze-US-v0", goal_radius=91.5, **{limit: n_steps})
    env.reset(seed=0)
    ends = [env.step(action)[2:4] for action in found.actions]
    assert ends[-1] == (True, truncated)
    best = [e for e in play(env, mlp, policies) if np.array_equal(e.actions, found.actions)]
    assert {(e.terminated, e.truncated) for e in best} == {(True, truncated)}


def test_there_is_room_for_long_episodes(monkeypatch):
    env = gym.make("CuriosityMaze-US-v0", horizon=50)
    mlp, policies = make_policies(env, 3)
    at_once = list(play(env, mlp, policies))
    monkeypatch.setattr(episodes, "FIRST_STEPS", 6)
    assert by_bytes(play(env, mlp, policies)) == by_bytes(at_once)
    assert [len(each.actions) for each in at_once] == [50, 50, 50]


def test_endless_episodes_are_refused(monkeypatch):
    monkeypatch.setattr(vector, "MAX_EPISODE_STEPS", 30)
    env = gym.make("Pendulum-v1", max_episode_steps=-1)
    mlp, policies = make_policies(env, 2)
    with pytest.raises(ValueError, match="had not ended after 30 steps"):
        list(play(env, mlp, policies))
