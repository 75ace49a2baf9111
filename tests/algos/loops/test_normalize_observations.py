"""Strategies that search among policies of standardized observations."""

import numpy as np
import pytest

from curiosity_algos import NSES, CanonicalES, CuriosityES

STRATEGIES = [CanonicalES, CuriosityES, NSES]


@pytest.fixture(params=STRATEGIES, ids=lambda cls: cls.__name__)
def model(request, make_model, make_easy_maze):
    return make_model(request.param, make_easy_maze(), normalize_observations=True)


def test_a_run_that_is_loaded_goes_on_bit_for_bit(model, make_easy_maze, assert_resumes):
    assert_resumes(model.learn(2000), make_easy_maze(), timesteps=2000)


def test_threads_and_blocks_do_not_matter(model, make_model, make_easy_maze):
    settings = {"normalize_observations": True, "n_threads": 3}
    other = make_model(type(model), make_easy_maze(), **settings)
    other.evaluator.block_size = 2
    centers = [each.learn(4000)._search.center for each in (model, other)]
    np.testing.assert_array_equal(*centers)


def test_it_is_another_search(model, make_model, make_easy_maze):
    plain = make_model(type(model), make_easy_maze()).learn(4000)
    model.learn(4000)
    assert np.abs(model._search.center - plain._search.center).max() > 1e-3


def test_predict_acts_as_what_was_evaluated(make_model, make_easy_maze):
    model = make_model(CanonicalES, make_easy_maze(), normalize_observations=True).learn(20_000)
    assert model.best_return > 0.0
    evaluated = model.evaluator.evaluate(model.policy.vector[None])
    assert evaluated.returns[0] == pytest.approx(model.best_return, abs=1e-6)
