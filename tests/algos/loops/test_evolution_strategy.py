import json

import numpy as np
import pytest
import torch as th
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from curiosity_algos import NSES, CanonicalES, CuriosityES
from curiosity_algos.loops.evolution_strategy import Fitness, standardize
from curiosity_algos.motivations.phi import Phi
from curiosity_algos.search.canonical import CanonicalSearch

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
        fitness = Fitness(Phi(phi), no_reward, SEED).combine(self.extrinsic, self.intrinsic)
        z = [(x - x.mean()) / x.std() for x in (self.extrinsic, self.intrinsic)]
        np.testing.assert_allclose(fitness, phi * z[0] + (1 - phi) * z[1])

    def test_without_reward_intrinsic_fitness_ranks_alone(self):
        fitness = Fitness(Phi(0.8), "ignore", SEED).combine(np.zeros(4), self.intrinsic)
        np.testing.assert_array_equal(np.argsort(fitness), np.argsort(self.intrinsic))

    def test_without_reward_noise_may_stand_for_it(self):
        random = Fitness(Phi(0.8), "random", SEED)
        drawn = [random.combine(np.zeros(4), self.intrinsic) for _ in range(2)]
        assert not np.array_equal(*drawn)
        again = Fitness(Phi(0.8), "random", SEED).combine(np.zeros(4), self.intrinsic)
        np.testing.assert_array_equal(again, drawn[0])

    def test_equal_rewards_are_no_absence_of_reward(self):
        random, ignore = (Fitness(Phi(0.8), mode, SEED) for mode in ("random", "ignore"))
        rewards = np.full(4, 2.0)
        np.testing.assert_array_equal(
            random.combine(rewards, self.intrinsic), ignore.combine(rewards, self.intrinsic)
        )

    def test_nothing_to_rank_by_is_zero(self):
        fitness = Fitness(Phi(0.8), "ignore", SEED).combine(np.zeros(4), np.zeros(4))
        np.testing.assert_array_equal(fitness, np.zeros(4))

    def test_the_weight_resumes(self):
        one, other = (Fitness(Phi("adaptive"), "ignore", SEED) for _ in range(2))
        one.phi._adapted = 0.2
        other.load_state_dict(one.state_dict())
        np.testing.assert_array_equal(
            one.combine(self.extrinsic, self.intrinsic),
            other.combine(self.extrinsic, self.intrinsic),
        )

    def test_the_noise_resumes(self):
        one, other = Fitness(Phi(0.8), "random", SEED), Fitness(Phi(0.8), "random", SEED)
        one.combine(np.zeros(4), self.intrinsic)
        other.load_state_dict(one.state_dict())
        np.testing.assert_array_equal(
            one.combine(np.zeros(4), self.intrinsic), other.combine(np.zeros(4), self.intrinsic)
        )


@pytest.mark.parametrize(
    ("algorithm", "settings"), [(CuriosityES, {}), (NSES, {"behavior": "final"})]
)
class TestMotivated:
    """What strategies with a motivation beside the returns do alike."""

    def test_a_generation_is_one_of_algorithm_1(
        self, algorithm, settings, make_model, make_easy_maze, assert_same
    ):
        given = {"phi": 0.6, "seed": 1, **settings}
        model, twin = (make_model(algorithm, make_easy_maze(), **given) for _ in range(2))
        for _ in range(4):
            rollouts = twin.evaluator.evaluate(twin._search.ask(), twin._episodes.draw())
            intrinsic = twin._motivation.score(rollouts)
            twin._search.tell(0.6 * standardize(rollouts.returns) + 0.4 * standardize(intrinsic))
            twin._motivation.update(rollouts)
            model.learn(1, reset_num_timesteps=False)
            for name in ("_search", "_motivation"):
                assert_same(getattr(model, name).state_dict(), getattr(twin, name).state_dict())
        assert model.best_return > 0

    def test_with_phi_one_it_is_the_canonical_es(
        self, algorithm, settings, make_model, make_easy_maze, assert_same
    ):
        model = make_model(algorithm, make_easy_maze(), phi=1.0, **settings).learn(2000)
        rate = model.learning_rate
        canonical = make_model(CanonicalES, make_easy_maze(), learning_rate=rate).learn(2000)
        assert_same(model._search.state_dict(), canonical._search.state_dict())
        assert model.num_timesteps == canonical.num_timesteps


class Climber:
    """A (1 + lambda) search, written outside the package."""

    def __init__(self, n_parameters, seed, population_size=6):
        self._rng = np.random.default_rng(seed)
        self._size = population_size
        self._best = 0.1 * self._rng.standard_normal(n_parameters)

    @property
    def center(self):
        return self._best

    def ask(self):
        self._asked = self.center + 0.1 * self._rng.standard_normal((self._size, len(self.center)))
        return self._asked.astype(np.float32)

    def tell(self, fitness):
        self._best = self._asked[np.argmax(fitness)]

    def state_dict(self):
        state = json.dumps(self._rng.bit_generator.state)
        return {"center": th.from_numpy(self.center), "rng": state}

    def load_state_dict(self, state):
        self._best = state["center"].numpy()
        self._rng.bit_generator.state = json.loads(state["rng"])


def canonical(n_parameters, seed):
    return CanonicalSearch(
        n_parameters,
        population_size=56,
        n_parents=28,
        sigma=0.3,
        learning_rate=2.0,
        step="canonical",
        mirrored=False,
        seed=seed,
    )


class TestSearch:
    small = {"policy_kwargs": {"net_arch": [4]}, "seed": 0}  # noqa: RUF012  # only read
    icm = {"n_transitions": 5, "n_updates": 2, "batch_size": 16, "buffer_size": 100}  # noqa: RUF012  # only read

    def make(self, algorithm, env, **kwargs):
        settings = self.icm if algorithm is CuriosityES else {}
        return algorithm(env, **self.small, **settings, **kwargs)

    @pytest.mark.parametrize("algorithm", [CanonicalES, CuriosityES, NSES])
    def test_another_search_is_asked_and_told(self, algorithm, make_easy_maze):
        model = self.make(algorithm, make_easy_maze(), search=Climber)
        begun = model._search.center.copy()
        model.learn(1000)
        assert isinstance(model._search, Climber)
        assert not np.array_equal(model._search.center, begun)
        assert model.best_return > 0.0

    def test_the_canonical_search_given_is_the_default(self, make_easy_maze, assert_same_run):
        given = self.make(NSES, make_easy_maze(), search=canonical).learn(10_000)
        assert_same_run(given, self.make(NSES, make_easy_maze()).learn(10_000))

    def test_an_object_is_held(self, make_easy_maze):
        n_parameters = self.make(CanonicalES, make_easy_maze()).policy.mlp.n_parameters
        search = Climber(n_parameters, seed=0)
        assert self.make(CanonicalES, make_easy_maze(), search=search).learn(500)._search is search

    def test_a_run_with_it_goes_on(self, make_easy_maze, assert_resumes):
        model = self.make(CuriosityES, make_easy_maze(), search=Climber).learn(1000)
        assert_resumes(model, make_easy_maze(), search=Climber)

    def test_it_begins_where_it_was_made_to(self, make_easy_maze):
        model = self.make(CanonicalES, make_easy_maze(), search=Climber)
        before = model.policy.vector.copy()
        policy = {"flat": th.ones(model.policy.mlp.n_parameters)}
        with pytest.raises(ValueError, match="`policy` cannot be set alone where `search`"):
            model.set_parameters({"policy": policy}, exact_match=False)
        np.testing.assert_array_equal(model.policy.vector, before)

    @pytest.mark.parametrize("search", ["cma_es", 3, np.zeros(4)])
    def test_what_is_no_search_is_refused(self, make_easy_maze, search):
        with pytest.raises(ValueError, match="`search` must be None, a Search, or a function"):
            self.make(CanonicalES, make_easy_maze(), search=search)

    def test_one_of_other_parameters_is_refused(self, make_easy_maze):
        with pytest.raises(ValueError, match=r"`search` must have a center of the policy's \d+"):
            self.make(CanonicalES, make_easy_maze(), search=lambda n, seed: Climber(n + 1, seed))

    def test_what_makes_no_search_is_refused(self, make_easy_maze):
        with pytest.raises(ValueError, match="`search` must make a Search, got 3"):
            self.make(CanonicalES, make_easy_maze(), search=lambda n, seed: 3)

    def test_one_that_cannot_be_saved_is_refused_at_once(self, make_easy_maze):
        class Unsaved(Climber):
            def state_dict(self):
                return {"center": {1}}

        with pytest.raises(ValueError, match="at `search/center` there is a set"):
            self.make(CanonicalES, make_easy_maze(), search=Unsaved)

    def test_one_like_the_default_is_given_again_too(self, make_easy_maze, tmp_path):
        self.make(CanonicalES, make_easy_maze(), search=canonical).save(tmp_path / "model")
        with pytest.raises(ValueError, match=r"^`search` must be .*, CanonicalSearch, got none"):
            CanonicalES.load(tmp_path / "model")

    @pytest.mark.parametrize("saved", [None, Climber])
    def test_load_takes_the_one_that_was_saved(self, make_easy_maze, tmp_path, saved):
        self.make(CanonicalES, make_easy_maze(), search=saved).save(tmp_path / "model")

        class Other(Climber):
            pass

        with pytest.raises(ValueError, match="`search` must be given to `load` as to the"):
            CanonicalES.load(tmp_path / "model", env=make_easy_maze(), search=Other)

    def test_one_may_be_called_too(self, make_easy_maze):
        class Callable(Climber):
            def __call__(self):
                raise AssertionError

        n_parameters = self.make(CanonicalES, make_easy_maze()).policy.mlp.n_parameters
        search = Callable(n_parameters, seed=0)
        assert self.make(CanonicalES, make_easy_maze(), search=search)._search is search
