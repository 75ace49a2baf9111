from typing import ClassVar

import numpy as np
import pytest
import torch as th

from curiosity_algos import CanonicalES
from curiosity_algos.checkpoints.parts import stateful_parts


class Counter:
    """A part with a state."""

    def __init__(self):
        self.n = 0

    def state_dict(self):
        return {"n": self.n}

    def load_state_dict(self, state, strict=True):
        self.n = state["n"]


class Counting(CanonicalES):
    """Holds a part that no list names."""

    def _make_search(self, seed):
        super()._make_search(seed)
        self._counter = Counter()

    def _tell(self, rollouts):
        self._counter.n += 1
        return super()._tell(rollouts)


def test_a_part_of_a_subclass_is_saved_and_loaded(make_easy_maze, tmp_path):
    small = {"population_size": 4, "policy_kwargs": {"net_arch": [4]}}
    model = Counting(make_easy_maze(), **small).learn(300)
    assert model._counter.n == model.generation > 0
    model.save(tmp_path / "model")
    loaded = Counting.load(tmp_path / "model")
    assert loaded._counter.n == model._counter.n


class Drawing(CanonicalES):
    """Sets plain values and generators where it makes its parts, one of which it shares."""

    def _make_parts(self, fitness_seed, motivation_seed):
        self._n_told, self._cells = 0, {}
        self._rng = np.random.default_rng(fitness_seed)
        self._shared = self._search._rng

    def _tell(self, rollouts):
        self._n_told += 1
        self._cells[(self._n_told, "cell")] = self._rng.random()
        return super()._tell(rollouts)


class TestPlainState:
    SMALL: ClassVar = {"population_size": 4, "policy_kwargs": {"net_arch": [4]}}

    @pytest.fixture
    def model(self, make_easy_maze, tmp_path):
        model = Drawing(make_easy_maze(), **self.SMALL, seed=0).learn(600)
        model.save(tmp_path / "model")
        return model

    def load(self, make_easy_maze, tmp_path, **kwargs):
        # Keys that are no text are cloudpickle's to read.
        return Drawing.load(tmp_path / "model", make_easy_maze(), allow_pickle=True, **kwargs)

    def test_a_loaded_model_goes_on(self, model, make_easy_maze, assert_resumes):
        loaded = assert_resumes(model, make_easy_maze(), allow_pickle=True)
        assert loaded._n_told == model._n_told == model.generation > 3
        assert loaded._cells == model._cells

    def test_what_is_shared_stays_shared(self, model, make_easy_maze, tmp_path):
        loaded = self.load(make_easy_maze, tmp_path)
        assert loaded._shared is loaded._search._rng

    def test_a_seed_begins_its_draws_anew(self, model, make_easy_maze, tmp_path):
        one, twin, other = (self.load(make_easy_maze, tmp_path, seed=seed) for seed in (1, 1, 2))
        draws = [each._rng.random() for each in (one, twin, other, model)]
        assert draws[0] == draws[1]
        assert len(set(draws)) == 3

    def test_generators_need_no_pickle(self, model, make_easy_maze, tmp_path):
        model._cells = None
        model.save(tmp_path / "model")
        loaded = Drawing.load(tmp_path / "model", make_easy_maze())
        assert loaded._rng.random() == model._rng.random()

    def test_a_keyword_takes_the_place_of_what_was_saved(self, model, make_easy_maze, tmp_path):
        assert self.load(make_easy_maze, tmp_path, _n_told=7)._n_told == 7


def test_every_part_is_found(algorithm, make_model, make_easy_maze):
    model = make_model(algorithm, make_easy_maze())
    expected = {
        name
        for name, part in vars(model).items()
        if hasattr(part, "load_state_dict") and not isinstance(part, th.nn.Module | type)
    }
    saved = set(model.get_parameters())
    assert expected >= set(stateful_parts(model))
    assert saved >= {"policy", *expected}


def test_what_a_user_gave_is_in_its_part_alone(make_easy_maze):
    model = CanonicalES(make_easy_maze(), population_size=4)
    search = model._search
    given = CanonicalES(make_easy_maze(), search=search)
    assert given.search is given._search is search
    assert "search" not in stateful_parts(given)
    np.testing.assert_array_equal(given.get_parameters()["_search"]["center"], search.center)


class Remembering(CanonicalES):
    """Takes a part as an argument, and works with it itself."""

    def __init__(self, env, policy="MlpPolicy", *, memory=None, **kwargs):
        self.memory = memory or Counter()
        super().__init__(env, policy, **kwargs)

    def _tell(self, rollouts):
        self.memory.n += 1
        return super()._tell(rollouts)


def test_an_argument_that_nothing_else_holds_is_a_part(make_easy_maze, tmp_path):
    model = Remembering(make_easy_maze(), population_size=4).learn(300)
    model.save(tmp_path / "model")
    for kwargs in ({}, {"memory": Counter()}):
        loaded = Remembering.load(tmp_path / "model", env=make_easy_maze(), **kwargs)
        assert loaded.memory.n == model.memory.n > 0
