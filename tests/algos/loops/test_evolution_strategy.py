import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from curiosity_algos.loops.evolution_strategy import Fitness, standardize

SEED = np.random.SeedSequence(0)
POPULATIONS = hnp.arrays(
    np.float64, st.integers(1, 30), elements=st.floats(-1e6, 1e6, allow_subnormal=False)
)


class TestStandardize:
    @given(POPULATIONS)
    def test_mean_zero_deviation_one_and_never_nan(self, values):
        standardized = standardize(values)
        assert np.isfinite(standardized).all()
        assert abs(standardized.mean()) < 1e-3
        deviation = standardized.std()
        assert deviation == pytest.approx(1.0) or (standardized == 0.0).all()

    @given(POPULATIONS)
    def test_order_stays(self, values):
        standardized = standardize(values)
        ranked = standardized[np.argsort(values, kind="stable")]
        assert (np.diff(ranked) >= 0.0).all()

    @given(st.floats(-1e12, 1e12), st.integers(1, 60))
    def test_equal_values_are_zero(self, value, n):
        np.testing.assert_array_equal(standardize(np.full(n, value)), np.zeros(n))

    def test_values_stay_as_they_were(self):
        values = np.array([1.0, 2.0, 3.0])
        np.testing.assert_allclose(standardize(values), np.array([-1, 0, 1]) * np.sqrt(1.5))
        np.testing.assert_array_equal(values, [1.0, 2.0, 3.0])

    def test_rare_rewards_stand_out(self):
        values = np.zeros(56)
        values[7] = 1e-3
        assert standardize(values).argmax() == 7
        assert standardize(values)[7] == pytest.approx(np.sqrt(55))


class TestFitness:
    extrinsic = np.array([0.0, 1.0, 0.0, 3.0])
    intrinsic = np.array([9.0, 2.0, 4.0, 1.0])

    @pytest.mark.parametrize("phi", [0.0, 0.3, 0.8, 1.0])
    @pytest.mark.parametrize("no_reward", ["ignore", "random"])
    def test_the_weighted_sum_of_both(self, phi, no_reward):
        fitness = Fitness(phi, no_reward, SEED).combine(self.extrinsic, self.intrinsic)
        z = [(x - x.mean()) / x.std() for x in (self.extrinsic, self.intrinsic)]
        np.testing.assert_allclose(fitness, phi * z[0] + (1 - phi) * z[1])

    def test_without_reward_intrinsic_fitness_ranks_alone(self):
        fitness = Fitness(0.8, "ignore", SEED).combine(np.zeros(4), self.intrinsic)
        np.testing.assert_array_equal(np.argsort(fitness), np.argsort(self.intrinsic))

    def test_without_reward_noise_may_stand_for_it(self):
        random = Fitness(0.8, "random", SEED)
        drawn = [random.combine(np.zeros(4), self.intrinsic) for _ in range(2)]
        assert not np.array_equal(*drawn)
        again = Fitness(0.8, "random", SEED).combine(np.zeros(4), self.intrinsic)
        np.testing.assert_array_equal(again, drawn[0])

    def test_equal_rewards_are_no_absence_of_reward(self):
        random, ignore = (Fitness(0.8, mode, SEED) for mode in ("random", "ignore"))
        rewards = np.full(4, 2.0)
        np.testing.assert_array_equal(
            random.combine(rewards, self.intrinsic), ignore.combine(rewards, self.intrinsic)
        )

    def test_nothing_to_rank_by_is_zero(self):
        fitness = Fitness(0.8, "ignore", SEED).combine(np.zeros(4), np.zeros(4))
        np.testing.assert_array_equal(fitness, np.zeros(4))

    def test_the_noise_resumes(self):
        one, other = Fitness(0.8, "random", SEED), Fitness(0.8, "random", SEED)
        one.combine(np.zeros(4), self.intrinsic)
        other.load_state_dict(one.state_dict())
        np.testing.assert_array_equal(
            one.combine(np.zeros(4), self.intrinsic), other.combine(np.zeros(4), self.intrinsic)
        )
