import numpy as np
from scipy.stats import chisquare

from curiosity_algos.experiments.save_run import Reservoir


def policies(n):
    for i in range(n):
        yield {
            "parameters": np.full(3, i, np.float32),
            "return": i / 10,
            "generation": i,
            "episode_seed": 7,
        }


def filled(size, n, seed=0):
    reservoir = Reservoir(size, np.random.SeedSequence(seed))
    for policy in policies(n):
        reservoir.add(policy)
    return reservoir


def test_it_keeps_as_many_as_it_may():
    for n, kept in [(0, 0), (1, 1), (5, 5), (6, 5), (100, 5)]:
        reservoir = filled(5, n)
        assert reservoir.n_seen == n
        arrays = reservoir.arrays()
        assert len(arrays["parameters"]) == len(arrays["return"]) == kept
        assert len(set(arrays["generation"].tolist())) == kept
        np.testing.assert_array_equal(arrays["return"], arrays["generation"] / 10)


def test_each_is_kept_as_often():
    counts = np.zeros(20)
    for seed in range(2000):
        counts[filled(5, 20, seed).arrays()["generation"]] += 1
    assert counts.sum() == 2000 * 5
    assert chisquare(counts).pvalue > 0.001


def test_it_goes_on_from_its_arrays(assert_same):
    whole, begun = filled(5, 60), filled(5, 30)
    going_on = Reservoir(5, np.random.SeedSequence(99))
    going_on.load(begun.arrays())
    for policy in list(policies(60))[30:]:
        going_on.add(policy)
    one, other = whole.arrays(), going_on.arrays()
    assert str(one.pop("rng")) == str(other.pop("rng"))
    assert_same(one, other)
