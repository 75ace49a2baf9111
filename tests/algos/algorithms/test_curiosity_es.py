import gymnasium as gym
import numpy as np
import pytest
import torch as th

from curiosity_algos import CuriosityES, CuriosityMAPElites


@pytest.mark.parametrize("algorithm", [CuriosityES, CuriosityMAPElites])
def test_the_trained_bonus_is_at_hand(algorithm, make_model, make_easy_maze, tmp_path):
    model = make_model(algorithm, make_easy_maze())
    steps = [np.full((1, n), value, np.float32) for n, value in [(36, 0), (2, 0), (36, 1)]]
    before = model.trained_bonus.score(*steps)
    model.learn(300).save(tmp_path / "model")
    assert model.trained_bonus.score(*steps) != before
    loaded = algorithm.load(tmp_path / "model").trained_bonus
    assert loaded.score(*steps) == model.trained_bonus.score(*steps)


def test_curiosity_does_not_depend_on_the_unit_of_actions(make_model, assert_same):
    def learned(unit):  # a power of 2, which rounds nothing
        env, highest = gym.make("Pendulum-v1"), np.float32(unit)
        env = gym.wrappers.RescaleAction(env, -highest, highest)
        return make_model(CuriosityES, env).learn(4000)

    models = [learned(unit) for unit in (1, 2**10, 0.5)]
    bonuses = [model.trained_bonus.state_dict() for model in models]
    assert_same(bonuses[0], bonuses[1])
    assert_same(bonuses[0], bonuses[2])
    np.testing.assert_array_equal(models[0]._ask(), models[1]._ask())


def test_a_loaded_model_may_learn_otherwise(make_model, make_maze, tmp_path):
    make_model(CuriosityES, make_maze()).learn(300).save(tmp_path / "model")
    loaded = CuriosityES.load(tmp_path / "model", bonus_kwargs={"learning_rate": 0.01})
    assert loaded._motivation.bonus.optimizer.param_groups[0]["lr"] == 0.01
    with pytest.raises(ValueError, match="`bonus` must be made as the one that was saved"):
        CuriosityES.load(tmp_path / "model", bonus_kwargs={"horizon": 7, "n_features": 3})


@pytest.mark.parametrize(("n_states", "place"), [(None, 0), (20, -1), (20, -2)])
def test_an_observation_that_is_not_finite_teaches_nothing(
    make_model, make_easy_maze, n_states, place
):
    model = make_model(CuriosityES, make_easy_maze(), n_states=n_states)
    evaluate = model.evaluator.evaluate

    def spoil(parameters, seed):
        rollouts = evaluate(parameters, seed)
        rollouts.observations[1, : rollouts.lengths[1] + 1][place] = np.inf
        return rollouts

    model.evaluator.evaluate = spoil
    before = [p.detach().clone() for p in model._motivation.bonus.parameters()]
    with pytest.raises(ValueError, match="`env` must give finite observations"):
        model.learn(1)
    after = model._motivation.bonus.parameters()
    assert all(th.equal(*pair) for pair in zip(before, after, strict=True))
