import numpy as np
import pytest
import torch as th
from hypothesis import given
from hypothesis import strategies as st

from curiosity_algos.search.canonical import (
    INITIAL_DEVIATION,
    CanonicalSearch,
    recombination_weights,
)


def make_search(n_parameters=5, seed=0, **changes):
    settings = {"population_size": 8, "n_parents": 3, "sigma": 0.5, "learning_rate": 0.7}
    settings |= {"step": "canonical", "mirrored": False}
    return CanonicalSearch(n_parameters, **(settings | changes), seed=np.random.SeedSequence(seed))


@given(st.integers(1, 300))
def test_weights_sum_to_one_and_fall(n_parents):
    weights = recombination_weights(n_parents)
    assert weights.shape == (n_parents,)
    assert weights.sum() == pytest.approx(1.0)
    assert (np.diff(weights) < 0).all()
    assert (weights > 0).all()


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("step", "divisor"), [("canonical", 1.0), ("paper", 0.5 * 3)])
def test_a_step_by_hand(step, divisor, mirrored):
    search = make_search(step=step, mirrored=mirrored)
    center = search.center.copy()
    population = search.ask().astype(np.float64)
    fitness = np.array([1.0, 5.0, -2.0, 9.0, 0.0, 3.0, 4.0, -1.0])
    search.tell(fitness)
    w = recombination_weights(3)
    best = population[[3, 1, 6]]
    expected = center + 0.7 / divisor * (w @ (best - center))
    np.testing.assert_allclose(search.center, expected, atol=1e-6)


def test_samples_have_the_deviation_asked_for():
    search = make_search(200, population_size=200, sigma=0.3)
    assert search.center.std() == pytest.approx(INITIAL_DEVIATION, rel=0.2)
    population = search.ask()
    assert population.dtype == np.float32
    assert population.shape == (200, 200)
    deviations = population - search.center
    assert deviations.std() == pytest.approx(0.3, rel=0.02)
    assert abs(deviations.mean()) < 0.01


@pytest.mark.parametrize("population_size", [8, 7])
def test_mirrored_samples_are_opposite(population_size):
    search = make_search(population_size=population_size, mirrored=True)
    deviations = search.ask() - search.center
    half = (population_size + 1) // 2
    opposite = deviations[half:]
    np.testing.assert_allclose(opposite, -deviations[: len(opposite)], atol=1e-6)
    assert deviations.shape == (population_size, 5)
    assert len(np.unique(deviations[:half, 0])) == half


def test_a_state_resumes_the_search():
    one, other = make_search(), make_search(seed=9)
    one.ask()
    one.tell(np.arange(8.0))
    other.load_state_dict(one.state_dict())
    for search in (one, other):
        search.ask()
        search.tell(np.arange(8.0) % 3)
    np.testing.assert_array_equal(one.center, other.center)
    np.testing.assert_array_equal(one.ask(), other.ask())


def test_a_state_is_a_copy():
    search = make_search()
    state = search.state_dict()
    before = state["center"].copy()
    search.center += 1.0
    np.testing.assert_array_equal(state["center"], before)


@pytest.mark.parametrize(
    "center",
    [
        np.full(5, np.nan),
        np.zeros(3),
        np.zeros((1, 5)),
        np.zeros(5, np.float32),
        th.zeros(5, dtype=th.float64),
    ],
)
def test_a_center_that_does_not_fit_changes_nothing(center):
    search = make_search()
    before = search.center.copy()
    with pytest.raises(ValueError, match=r"`search\.center` must be"):
        search.load_state_dict(search.state_dict() | {"center": center})
    np.testing.assert_array_equal(search.center, before)
