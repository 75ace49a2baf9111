import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from curiosity_algos import NSES, CuriosityES
from curiosity_algos.motivations.fitness import HIGHEST, Fitness, check_phi, standardize

SEED = np.random.SeedSequence(0)


def adapted(*generations):
    """The weight after each generation, which had a better return or had not."""
    fitness, values = Fitness("adaptive", "ignore", SEED), []
    for best_return in returns_of(generations):
        fitness.adapt(best_return)
        values.append(fitness.weight)
    return values


def returns_of(generations):
    """Best returns, which are better than all before or are not."""
    return [float(i) if improved else -np.inf for i, improved in enumerate(generations)]


class TestStandardize:
    @given(hnp.arrays(np.float64, st.integers(1, 30), elements=st.floats(-1e6, 1e6)))
    def test_mean_zero_deviation_one_in_the_same_order(self, values):
        standardized = standardize(values)
        assert np.isfinite(standardized).all()
        assert abs(standardized.mean()) < 1e-3
        deviation = standardized.std()
        assert deviation == pytest.approx(1.0) or (standardized == 0.0).all()
        ranked = standardized[np.argsort(values, kind="stable")]
        assert (np.diff(ranked) >= 0.0).all()

    @given(st.floats(-1e12, 1e12), st.integers(1, 60))
    def test_equal_values_are_zero(self, value, n):
        np.testing.assert_array_equal(standardize(np.full(n, value)), np.zeros(n))

    def test_values_stay_as_they_were(self):
        values = np.array([1.0, 2.0, 3.0])
        np.testing.assert_allclose(standardize(values), np.array([-1, 0, 1]) * np.sqrt(1.5))
        np.testing.assert_array_equal(values, [1.0, 2.0, 3.0])


class TestCombination:
    extrinsic = np.array([0.0, 1.0, 0.0, 3.0])
    intrinsic = np.array([9.0, 2.0, 4.0, 1.0])

    @pytest.mark.parametrize("phi", [0.0, 0.3, 1.0])
    @pytest.mark.parametrize("no_reward", ["ignore", "random"])
    def test_the_weighted_sum_of_both(self, phi, no_reward):
        fitness = Fitness(phi, no_reward, SEED).combine(self.extrinsic, self.intrinsic)
        z = [(x - x.mean()) / x.std() for x in (self.extrinsic, self.intrinsic)]
        np.testing.assert_allclose(fitness, phi * z[0] + (1 - phi) * z[1])

    def test_without_reward_intrinsic_fitness_ranks_alone(self):
        fitness = Fitness(0.8, "ignore", SEED).combine(np.zeros(4), self.intrinsic)
        np.testing.assert_array_equal(np.argsort(fitness), np.argsort(self.intrinsic))

    def test_without_reward_noise_may_stand_for_it_and_resumes(self):
        one, other = (Fitness(0.8, "random", np.random.SeedSequence(seed)) for seed in (0, 1))
        drawn = [one.combine(np.zeros(4), self.intrinsic)]
        other.load_state_dict(one.state_dict())
        drawn += [fitness.combine(np.zeros(4), self.intrinsic) for fitness in (one, other)]
        assert not np.array_equal(*drawn[:2])
        np.testing.assert_array_equal(*drawn[1:])

    def test_equal_rewards_are_no_absence_of_reward(self):
        random, ignore = (Fitness(0.8, mode, SEED) for mode in ("random", "ignore"))
        rewards = np.full(4, 2.0)
        np.testing.assert_array_equal(
            random.combine(rewards, self.intrinsic), ignore.combine(rewards, self.intrinsic)
        )


class TestAdaptive:
    def test_patience_lowers_it_by_a_step_and_a_better_return_raises_it(self):
        lowered = [0.8, 0.8, 0.6, 0.6, 0.6, 0.4]
        assert adapted(*[False] * 7) == [*lowered, 0.4]
        assert adapted(*[False] * 6, True, True) == [*lowered, 0.6, 0.8]
        assert adapted(False, False, True, *[False] * 3) == [0.8] * 5 + [0.6]  # it waits anew
        assert adapted(True) == [0.8]
        assert adapted(*[False] * 12)[-1] == adapted(*[False] * 30)[-1] == 0.0
        assert adapted(*[False] * 15, True)[-1] == 0.2

    @given(st.lists(st.booleans(), max_size=30), st.lists(st.booleans(), max_size=30))
    def test_it_resumes(self, before, after):
        phi, resumed = Fitness("adaptive", "ignore", SEED), Fitness("adaptive", "ignore", SEED)
        returns = returns_of([*before, *after])
        for best_return in returns[: len(before)]:
            phi.adapt(best_return)
        resumed.load_state_dict(json.loads(json.dumps(phi.state_dict())))
        for best_return in returns[len(before) :]:
            phi.adapt(best_return)
            resumed.adapt(best_return)
            assert resumed.state_dict() == phi.state_dict()


def test_a_fixed_one_stays():
    phi = Fitness(0.7, "ignore", SEED)
    for best_return in [1.0, *[0.0] * 9]:
        phi.adapt(best_return)
    assert phi.weight == 0.7


@pytest.mark.parametrize("phi", ["auto", 1.1, float("nan"), np.zeros(2)])
def test_errors_say_what_phi_may_be(phi):
    with pytest.raises(ValueError, match=r'^`phi` must be from 0 to 1, or "adaptive", got'):
        check_phi(phi)


@pytest.mark.parametrize(("saved", "given"), [("adaptive", 0.3), (0.3, "adaptive")])
def test_load_takes_another(make_model, make_easy_maze, tmp_path, saved, given):
    make_model(NSES, make_easy_maze(), phi=saved).learn(3500).save(tmp_path / "model")
    loaded = NSES.load(tmp_path / "model", env=make_easy_maze(), phi=given)
    assert loaded._fitness.weight == {"adaptive": HIGHEST}.get(given, given)


def test_another_environment_has_another_best_return(make_model, make_easy_maze, make_maze):
    model = make_model(NSES, make_easy_maze(), phi="adaptive").learn(6000)
    before = model._fitness.weight
    assert model.best_return > 0.0
    model.set_env(make_maze())
    model.learn(1, reset_num_timesteps=False)
    assert model._fitness.weight > before


def test_it_reaches_the_flag_of_the_mountain_car():
    model = CuriosityES("MountainCarContinuous-v0", seed=100, device="cpu")
    model.learn(1.5e6, callback=lambda *_: model.best_return <= 0.0)  # until a reward
    assert model.best_return > 0.0
