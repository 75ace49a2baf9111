"""What Optuna samples, algorithms take."""

import inspect

import gymnasium as gym
import optuna
import pytest

from curiosity_algos.experiments.names import ALGORITHMS, find_algorithm
from curiosity_algos.experiments.search_spaces import SPACES, convert, sampler

optuna.logging.set_verbosity(optuna.logging.WARNING)


def sample(algorithm, seed):
    """A trial's parameters, and the keywords that were made of them."""
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=seed))
    trial = study.ask()
    keywords = sampler(algorithm)(trial, 2, 1, {})
    return trial.params, keywords


def test_there_is_one_for_every_algorithm():
    assert sorted(SPACES) == sorted(ALGORITHMS)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_an_algorithm_takes_what_is_sampled(algorithm):
    made = find_algorithm(algorithm)
    for seed in range(5):
        params, keywords = sample(algorithm, seed)
        model = made(gym.make("CuriosityMaze-US-v0"), seed=0, device="cpu", **keywords)
        for name, value in keywords.items():
            assert getattr(model, name) == value, name
        assert model.policy_kwargs["net_arch"] == keywords["policy_kwargs"]["net_arch"]
        assert set(keywords) <= set(inspect.signature(made).parameters)
        assert convert(params) == keywords


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_seeds_differ_in_all_that_is_sampled(algorithm):
    sampled = [sample(algorithm, seed)[0] for seed in range(12)]
    assert all(set(params) == set(SPACES[algorithm]) for params in sampled)
    for name in SPACES[algorithm]:
        assert len({params[name] for params in sampled}) > 1, name


def test_spaces_may_be_cut():
    assert convert({"sigma": 0.5}) == {"sigma": 0.5}


def test_algorithms_have_any_spelling():
    with pytest.raises(ValueError, match="did you mean CuriosityES"):
        sampler("curiosity-ee")
    trial = optuna.create_study().ask()
    assert "bonus" in sampler("curiosity_es")(trial, 2, 1, {})


def test_parameters_stand_for_keywords():
    params = {"net_arch": "small", "population_size_pow": 5, "parents_share": 0.26, "sigma": 0.5}
    assert convert(params) == {
        "policy_kwargs": {"net_arch": [32, 16]},
        "population_size": 32,
        "n_parents": 8,
        "sigma": 0.5,
    }
