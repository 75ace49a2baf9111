import json

import numpy as np
import pytest
import torch as th

from curiosity_algos import NSES, CanonicalES, CuriosityES
from curiosity_algos.motivations.fitness import Fitness, standardize
from curiosity_algos.search.canonical import CanonicalSearch


@pytest.mark.parametrize(
    ("algorithm", "settings"), [(CuriosityES, {}), (NSES, {"behavior": "final"})]
)
class TestMotivated:
    """What strategies with a motivation beside the returns do alike."""

    @pytest.mark.parametrize(("phi", "n_generations"), [(0.6, 4), ("adaptive", 20)])
    def test_a_generation_is_one_of_algorithm_1(
        self, algorithm, settings, phi, n_generations, make_model, make_easy_maze, assert_same
    ):
        given = {"phi": phi, "seed": 1, **settings}
        model, twin = (make_model(algorithm, make_easy_maze(), **given) for _ in range(2))
        fitness, weights = Fitness(phi, "ignore", np.random.SeedSequence(0)), set()
        for _ in range(n_generations):
            rollouts = twin.evaluator.evaluate(
                twin._search.ask(), int(twin._episode_seeds.integers(2**31))
            )
            fitness.adapt(rollouts.returns.max())
            weights.add(phi := fitness.weight)
            intrinsic = standardize(twin._motivation.score(rollouts))
            twin._search.tell(phi * standardize(rollouts.returns) + (1 - phi) * intrinsic)
            twin._motivation.update(rollouts)
            model.learn(1, reset_num_timesteps=False)
            for name in ("_search", "_motivation"):
                assert_same(getattr(model, name).state_dict(), getattr(twin, name).state_dict())
        assert model.best_return > 0
        assert len(weights) > 1 or n_generations == 4

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
    sizes = {"population_size": 56, "n_parents": 28, "sigma": 0.3, "learning_rate": 2.0}
    return CanonicalSearch(n_parameters, **sizes, step="canonical", mirrored=False, seed=seed)


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

    def test_a_run_with_it_goes_on(self, make_easy_maze, assert_resumes):
        model = self.make(CuriosityES, make_easy_maze(), search=Climber).learn(1000)
        assert_resumes(model, make_easy_maze(), search=Climber)

    @pytest.mark.parametrize(
        "search", [3, lambda n, seed: 3, lambda n, seed: Climber(n + 1, seed), Climber(5, 0)]
    )
    def test_what_is_no_search_is_refused(self, make_easy_maze, search):
        with pytest.raises(ValueError, match=r"`search` must be, or make, a Search with a center"):
            self.make(CanonicalES, make_easy_maze(), search=search)

    def test_one_that_cannot_be_saved_is_refused_at_once(self, make_easy_maze):
        class Unsaved(Climber):
            def state_dict(self):
                return {"center": {1}}

        with pytest.raises(ValueError, match="at `search/center` there is a set"):
            self.make(CanonicalES, make_easy_maze(), search=Unsaved)
