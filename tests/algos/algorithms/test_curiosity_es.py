import numpy as np
import pytest
import torch as th

from curiosity_algos import CanonicalES, CuriosityES
from curiosity_algos.common.evolution_strategy import standardize


def test_one_generation_of_algorithm_1(make_model, make_easy_maze, assert_same):
    model, twin = (make_model(CuriosityES, make_easy_maze(), phi=0.6, seed=1) for _ in range(2))
    for _ in range(4):
        rollouts = twin.evaluator.evaluate(twin._search.ask(), twin._episodes.draw())
        curiosity = twin._motivation.score(rollouts)
        twin._search.tell(0.6 * standardize(rollouts.returns) + 0.4 * standardize(curiosity))
        twin._motivation.update(rollouts)
        model.learn(1, reset_num_timesteps=False)
        for name in ("_search", "_motivation"):
            assert_same(getattr(model, name).state_dict(), getattr(twin, name).state_dict())
    assert model.best_return > 0


def test_with_phi_one_it_is_the_canonical_es(make_model, make_easy_maze, assert_same):
    curious = make_model(CuriosityES, make_easy_maze(), phi=1.0).learn(2000)
    canonical = make_model(CanonicalES, make_easy_maze()).learn(2000)
    assert_same(curious._search.state_dict(), canonical._search.state_dict())
    assert curious.num_timesteps == canonical.num_timesteps


@pytest.mark.parametrize(
    "changes",
    [
        {"phi": 0.0},
        {"gamma": 0.5},
        {"no_reward": "random"},
        {"bonus_kwargs": {"beta": 0.9}},
        {"bonus_kwargs": {"normalize": False}},
        {"n_updates": 5},
        {"n_transitions": 9},
        {"batch_size": 3},
        {"buffer_size": 7},
    ],
    ids=str,
)
def test_every_setting_has_an_effect(make_model, make_easy_maze, changes):
    settings = {"phi": 0.5, "seed": 2}
    plain = make_model(CuriosityES, make_easy_maze(), **settings).learn(3000)
    changed = make_model(CuriosityES, make_easy_maze(), **(settings | changes)).learn(3000)
    assert not np.array_equal(plain._search.center, changed._search.center)


@pytest.mark.parametrize("env", ["CartPole-v1", "Pendulum-v1"])
def test_discrete_and_continuous_actions_train_the_icm(make_model, env):
    model = make_model(CuriosityES, env)
    before = [p.detach().clone() for p in model._motivation.bonus.parameters()]
    model.learn(300)
    after = list(model._motivation.bonus.parameters())
    assert all(th.isfinite(p).all() for p in after)
    assert not any(th.equal(*pair) for pair in zip(before, after, strict=True))


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("phi", [-0.1, 1.1, float("nan")]),
        ("gamma", [-0.1, 1.1, float("nan")]),
        ("bonus", ["ICM", "", None]),
        ("no_reward", ["noise", None]),
        ("n_transitions", [0, 1.5]),
        ("n_updates", [0]),
        ("batch_size", [0]),
        ("buffer_size", [0]),
    ],
)
def test_errors_name_the_argument(make_model, make_maze, name, values):
    for value in values:
        with pytest.raises(ValueError, match=f"`{name}` must be"):
            make_model(CuriosityES, make_maze(), **{name: value})


@pytest.mark.parametrize(
    ("name", "value"), [("beta", 2.0), ("learning_rate", -1.0), ("n_features", 0), ("hidden", 0)]
)
def test_errors_of_the_bonus_name_the_argument(make_model, make_maze, name, value):
    with pytest.raises(ValueError, match=f"`{name}` must be"):
        make_model(CuriosityES, make_maze(), bonus_kwargs={name: value})


def test_an_observation_that_is_not_finite_teaches_nothing(make_model, make_easy_maze):
    model = make_model(CuriosityES, make_easy_maze())
    evaluate = model.evaluator.evaluate

    def spoil(parameters, seed):
        rollouts = evaluate(parameters, seed)
        rollouts.observations[1, 0] = np.inf
        return rollouts

    model.evaluator.evaluate = spoil
    before = [p.detach().clone() for p in model._motivation.bonus.parameters()]
    with pytest.raises(ValueError, match="`env` must give finite observations"):
        model.learn(1)
    after = model._motivation.bonus.parameters()
    assert all(th.equal(*pair) for pair in zip(before, after, strict=True))
