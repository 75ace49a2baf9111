import copy

import gymnasium as gym
import numpy as np
import pytest
from padded_rollouts import LENGTHS, make_rollouts

from curiosity_algos import ICM, CuriosityMAPElites
from curiosity_algos.bonuses.transitions import draw_transitions
from curiosity_gym import BehaviorWrapper


def test_parents_are_the_most_curious_of_their_tournaments(make_model, make_easy_maze):
    model = make_model(CuriosityMAPElites, make_easy_maze(), tournament_size=4).learn(2000)
    drawn, scored = [], []
    sample, emitter = model.archive.sample_elites, model._emitters.emitters[0]
    model.archive.sample_elites = lambda n: drawn.append(sample(n)) or drawn[-1]
    emitter._sigma = np.float32(0.0)
    asked = model._ask()
    (elites,) = drawn
    for i in range(4 * 6):
        bonus = model._motivation.bonus.score(
            elites["observations"][i], elites["actions"][i], elites["next_observations"][i]
        )
        scored.append(elites["length"][i] * bonus.mean())
    winners = np.arange(6) * 4 + np.reshape(scored, (6, 4)).argmax(axis=1)
    np.testing.assert_array_equal(asked, elites["solution"][winners])
    assert len(np.unique(scored)) > 4


@pytest.mark.parametrize("is_discrete", [False, True])
def test_what_is_kept_are_steps_of_each_episode(is_discrete, make_model, make_easy_maze):
    rollouts = make_rollouts(is_discrete)
    model = make_model(CuriosityMAPElites, make_easy_maze(), n_kept=60)
    draw = draw_transitions(copy.deepcopy(model._draws), len(LENGTHS), 60)
    before, actions, after = draw(rollouts, slice(0, len(LENGTHS)))
    expected = {"observations": before, "actions": actions, "next_observations": after}
    fields = model._fields(rollouts)
    for name, values in (expected | {"length": LENGTHS}).items():
        np.testing.assert_array_equal(fields[name], values)
        assert fields[name].dtype == values.dtype


@pytest.mark.parametrize(("env_id", "shape"), [("CartPole-v1", (4,)), ("Pendulum-v1", (4, 1))])
@pytest.mark.parametrize("algorithm", [CuriosityMAPElites])
def test_discrete_and_continuous_actions(
    make_model, make_classic, algorithm, env_id, shape, monkeypatch
):
    def see(self, observations, actions, next_observations):
        seen.add(actions.ndim)
        return score(self, observations, actions, next_observations)

    seen, score = set(), ICM.score
    monkeypatch.setattr(ICM, "score", see)
    model = make_model(algorithm, make_classic(env_id)).learn(1500)
    assert model.archive.data("actions").shape == (len(model.archive), *shape)
    assert seen == {len(shape)}  # actions (n,) or (n, A), as every bonus is asked for them
    assert model.archive.verify(make_classic(env_id)).share == 1.0


def test_parents_do_not_depend_on_the_unit_of_actions(make_model):
    space = gym.spaces.Box(-2.0, 2.0, (2,))
    asked = []
    for unit in map(np.float32, (1, 2**10)):  # a power of 2 rounds nothing
        env = gym.wrappers.RescaleAction(gym.make("Pendulum-v1"), -unit, unit)
        env = BehaviorWrapper(env, lambda env, seen, info: seen[:2], space)
        asked.append(make_model(CuriosityMAPElites, env).learn(4000)._ask())
    np.testing.assert_array_equal(*asked)
