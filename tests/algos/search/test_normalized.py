import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from padded_rollouts import rollouts_of

from curiosity_algos.evaluation.mlp import act, build_mlp
from curiosity_algos.search.canonical import CanonicalSearch
from curiosity_algos.search.normalized import SMALLEST_DEVIATION, NormalizedSearch

N_INPUTS = 3
SCALES, CENTERS = np.array([0.1, 1.0, 30.0]), np.array([-1.0, 0.0, 100.0])


def make_search(net_arch=(5,), seed=0):
    inputs = spaces.Box(-np.inf, np.inf, (N_INPUTS,), np.float32)
    mlp = build_mlp(inputs, spaces.Box(-1.0, 1.0, (2,), np.float32), net_arch)
    settings = {"population_size": 4, "n_parents": 2, "sigma": 0.5, "learning_rate": 1.0}
    settings |= {"step": "canonical", "mirrored": False, "seed": np.random.SeedSequence(seed)}
    return NormalizedSearch(CanonicalSearch(mlp.n_parameters, **settings), mlp), mlp


def make_rollouts(lengths=(7, 2, 9), seed=0):
    noise = np.random.default_rng(seed).normal(size=(len(lengths), max(lengths) + 1, N_INPUTS))
    seen = (CENTERS + SCALES * noise).astype(np.float32)
    for each, length in zip(seen, lengths, strict=True):
        each[length:] = np.nan  # no policy acts on the last observation, or on padding
    return rollouts_of(seen, lengths)


def acted_on(rollouts):
    pairs = zip(rollouts.observations, rollouts.lengths, strict=True)
    return np.concatenate([each[:length] for each, length in pairs]).astype(np.float64)


@pytest.mark.parametrize("net_arch", [(), (5,), (6, 4)])
def test_policies_act_as_those_of_the_search_on_standardized_observations(net_arch):
    search, mlp = make_search(net_arch)
    rollouts = make_rollouts()
    search.observe(rollouts)
    inner, _ = make_search(net_arch)
    seen = acted_on(rollouts)
    standardized = (seen - seen.mean(axis=0)) / seen.std(axis=0)
    for mine, its in zip(search.ask(), inner.search.ask(), strict=True):
        expected = act(mlp, its[None], standardized)
        np.testing.assert_allclose(act(mlp, mine[None], seen), expected, atol=1e-3)


@pytest.mark.parametrize("outlier", [1e4, 1e9, -1e9])
def test_one_observation_hides_no_others(outlier):
    search, _ = make_search()
    for seed in range(10):
        search.observe(make_rollouts(seed=seed))
    before = search.state_dict()
    rollouts = make_rollouts(seed=10)
    rollouts.observations[1, 0] = outlier
    search.observe(rollouts)
    after = search.state_dict()
    assert (after["var"] < 200.0 * before["var"]).all()
    assert (np.abs(after["mean"] - before["mean"]) < 10.0 * np.sqrt(before["var"])).all()


@given(st.lists(st.integers(1, 12), min_size=1, max_size=6), st.integers(1, 4))
def test_statistics_are_those_of_all_that_policies_acted_on(lengths, n_generations):
    search, _ = make_search()
    generations = [make_rollouts(lengths, seed) for seed in range(n_generations)]
    for each in generations:
        search.observe(each)
    seen = np.concatenate([acted_on(each) for each in generations])
    # SB3's own begin with 1e-4 of an observation.
    np.testing.assert_allclose(search._seen.mean, seen.mean(axis=0), rtol=0.02, atol=0.01)
    np.testing.assert_allclose(search._seen.var, seen.var(axis=0), rtol=0.02, atol=2.0)


def test_an_entry_that_never_changes_is_not_blown_up():
    search, _ = make_search()
    rollouts = make_rollouts()
    rollouts.observations[:, :, 1] = 0.5
    search.observe(rollouts)
    assert search._deviation[1] == pytest.approx(SMALLEST_DEVIATION, rel=0.5)
    assert np.abs(search.ask()).max() < 1e4


def test_it_goes_on_from_its_state():
    search, _ = make_search()
    search.observe(make_rollouts())
    search.ask()
    search.tell(np.arange(4.0))
    twin, _ = make_search(seed=7)
    twin.load_state_dict(search.state_dict())
    for each in (search, twin):
        each.observe(make_rollouts(seed=5))
    np.testing.assert_array_equal(search.ask(), twin.ask())


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda state: state["search"], "`search` must have"),
        (lambda state: {**state, "mean": state["mean"][:2]}, "mean` must be"),
        (lambda state: {**state, "var": state["var"] * np.nan}, "var` must be"),
    ],
)
def test_the_state_of_another_is_refused(change, match):
    search, _ = make_search()
    with pytest.raises(ValueError, match=match):
        search.load_state_dict(change(search.state_dict()))


def test_infinite_observations_are_refused():
    search, _ = make_search()
    rollouts = make_rollouts()
    rollouts.observations[0, 0, 0] = np.inf
    with np.errstate(invalid="ignore"), pytest.raises(ValueError, match="finite observations"):
        search.observe(rollouts)
