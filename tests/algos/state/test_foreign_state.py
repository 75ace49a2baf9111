from functools import partial

import numpy as np
import pytest
from ribs.emitters import (
    EvolutionStrategyEmitter,
    GaussianEmitter,
    GeneticAlgorithmEmitter,
    IsoLineEmitter,
)
from saved_files import through_a_file

from curiosity_algos.algorithms.cma_me import STRATEGIES
from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.search.emitters import ParetoEmitter, TournamentEmitter
from curiosity_algos.state.foreign_state import foreign_state, load_foreign_state

N_PARAMETERS, BATCH = 20, 8


def make_archive(dtype, kind=SparseGridArchive):
    settings = {"solution_dim": N_PARAMETERS, "solution_dtype": dtype, "measure_dim": 2}
    if kind is UnstructuredArchive:
        return kind(**settings, target_size=30, k_neighbors=3, seed=0)
    del settings["measure_dim"]
    return kind(**settings, dims=[20, 20], ranges=[(-3, 3)] * 2, seed=0)


COMMON = {"x0": np.zeros(N_PARAMETERS), "batch_size": BATCH}
MUTATED = COMMON | {"sigma": 0.3}
STRATEGY = COMMON | {"sigma0": 0.3, "ranker": "2imp", "restart_rule": 5}
FILTER = {"es": "sep_cma_es", "selection_rule": "filter", "restart_rule": "basic"}
TOURNAMENT = {"score": lambda elites: elites["objective"], "tournament_size": 3}
ISO_LINE = {"operator": "isoline", "operator_kwargs": {"iso_sigma": 0.1, "line_sigma": 0.2}}
EMITTERS = {
    "gaussian": partial(GaussianEmitter, **MUTATED),
    "iso_line": partial(IsoLineEmitter, **COMMON),
    "genetic": partial(GeneticAlgorithmEmitter, **COMMON, **ISO_LINE),
    "tournament": partial(TournamentEmitter, **MUTATED, **TOURNAMENT),
    "pareto": partial(ParetoEmitter, **MUTATED, n_parents=3),
    **{es: partial(EvolutionStrategyEmitter, **STRATEGY, es=es) for es in STRATEGIES},
    "random_direction": partial(EvolutionStrategyEmitter, **(STRATEGY | {"ranker": "2rd"})),
    "filter": partial(EvolutionStrategyEmitter, **(STRATEGY | FILTER)),
}


def kind_of_archive(name):
    return UnstructuredArchive if name == "pareto" else SparseGridArchive


def live(emitter, n_generations):
    """All that is emitted in some generations of a search."""
    emitted = []
    for _ in range(n_generations):
        solution = np.array(emitter.ask())
        objective = -np.square(solution - 1.0).sum(axis=1)
        info = emitter.archive.add(solution, objective, solution[:, :2])
        emitter.tell(solution, objective, solution[:, :2], info)
        emitted.append(solution)
    return emitted


@pytest.mark.parametrize(
    ("name", "n_generations", "dtype"),
    [
        *[(name, 12, np.float32) for name in EMITTERS],
        ("cma_es", 0, np.float32),
        ("cma_es", 1, np.float64),
        ("pareto", 0, np.float64),
    ],
)
def test_emitters_go_on_in_every_bit(name, n_generations, dtype, assert_same):
    archives = [make_archive(dtype, kind_of_archive(name)) for _ in range(2)]
    one, other = (EMITTERS[name](each, seed=seed) for seed, each in enumerate(archives))
    live(one, n_generations)
    other.ask()  # what it did before leaves no trace
    archives[1].load_state_dict(archives[0].state_dict())
    load_foreign_state(other, through_a_file(foreign_state(one)))
    for each, twin in zip(live(one, 7), live(other, 7), strict=True):
        assert each.dtype == twin.dtype
        np.testing.assert_array_equal(each, twin)
    assert_same(foreign_state(one), foreign_state(other))


class Thing:
    """What an attribute may be."""

    def __init__(self, **attributes):
        vars(self).update(attributes)


# As if it were of this package.
Thing.__module__ = "curiosity_algos.made_up"


def round_trip(value, current=None):
    other = Thing(it=current)
    load_foreign_state(other, through_a_file(foreign_state(Thing(it=value))))
    return other.it


class TestKinds:
    def test_generators_go_on_in_place(self):
        one, other = np.random.default_rng(0), np.random.default_rng(1)
        one.random(3)
        assert round_trip(one, other) is other
        np.testing.assert_array_equal(one.random(5), other.random(5))

    def test_objects_are_changed_in_place(self):
        one, other = Thing(a=1, inner=Thing(b=np.arange(2))), Thing(a=2, inner=Thing(b=None))
        inner = other.inner
        assert round_trip(one, other) is other
        assert other.a == 1
        assert other.inner is inner
        assert inner.b.tolist() == [0, 1]

    def test_what_an_object_is_built_with_stays(self):
        archive, another = make_archive(np.float32), make_archive(np.float64)
        one = Thing(archive=archive, function=live, kind=Thing, dtype=np.dtype("f4"), method=str)
        other = Thing(archive=another, function=make_archive)
        assert foreign_state(one) == {}
        load_foreign_state(other, foreign_state(one))
        assert other.archive is another
        assert other.function is make_archive

    @pytest.mark.parametrize(
        ("value", "is_nested"),
        [({1, 2}, False), ([1], True), ({"a": 1}, False), (1j, False), (object(), True)],
    )
    def test_others_are_refused_by_name(self, value, is_nested):
        thing = Thing(fine=1, odd=(value,) if is_nested else value)
        with pytest.raises(TypeError, match=f"attribute odd is a {type(value).__name__}, which"):
            foreign_state(Thing(inner=thing) if is_nested else thing)
