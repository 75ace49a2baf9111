"""pyribs' own dense grid is the oracle: what enters, what it is worth, what is drawn."""

import dataclasses
import functools
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ribs.archives import GridArchive
from ribs.emitters import EvolutionStrategyEmitter, GaussianEmitter, IsoLineEmitter
from ribs.schedulers import Scheduler

from curiosity_algos.archives.sparse_grid import SparseGridArchive

KINDS = (GridArchive, SparseGridArchive)
GRIDS = [
    {"dims": [3], "ranges": [(0.0, 1.0)]},
    {"dims": [4, 3], "ranges": [(-1.0, 1.0), (0.0, 30.0)]},
    {"dims": [2, 3, 2], "ranges": [(-1.0, 0.5), (1e-3, 2e-3), (5.0, 800.0)]},
]
EDGE_OFFSETS = (0.0, 1e-9, -1e-9, 1e-7, -1e-7, 4e-7, -4e-7, 1e-5, -1e-5, 0.4)
"""From a cell's edge, in widths of the range: within pyribs' allowance and beyond it."""


def without_threshold(fields):
    return {name: values for name, values in fields.items() if name != "threshold"}


def assert_equal(one, other):
    """Equal values and keys; the threshold of soft archives is pyribs' alone."""
    one, other = without_threshold(one), without_threshold(other)
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


def assert_alike(dense, sparse, n_drawn=7):
    """Two archives hold the same, and draw the same."""
    assert_equal(dense.data(), sparse.data())
    assert dataclasses.asdict(dense.stats) == dataclasses.asdict(sparse.stats)
    assert len(dense) == len(sparse)
    assert dense.empty == sparse.empty
    assert (dense.best_elite is None) == (sparse.best_elite is None)
    if not dense.empty:
        assert_equal(dense.best_elite, sparse.best_elite)
        assert_equal(dense.sample_elites(n_drawn), sparse.sample_elites(n_drawn))
    for one, other in zip(dense, sparse, strict=True):
        assert_equal(one, other)


@st.composite
def measures_of(draw, grid):
    """One behavior: inside, beyond the bounds, at a cell's edge or a rounding away from it."""
    values = []
    for n, (low, high) in zip(grid["dims"], grid["ranges"], strict=True):
        edge = draw(st.integers(-1, n + 1)) / n
        values.append(low + (high - low) * (edge + draw(st.sampled_from(EDGE_OFFSETS))))
    return values


@st.composite
def streams(draw):
    """A grid, an offset and batches of (objectives, measures) in which ties are common."""
    grid = draw(st.sampled_from(GRIDS))
    # Tenths: sums of them depend on their order, in the last bits.
    objective = st.integers(-2, 3).map(lambda k: k / 10)
    batch = st.lists(st.tuples(objective, measures_of(grid)), min_size=0, max_size=12)
    batches = draw(st.lists(batch, min_size=1, max_size=6))
    return grid, draw(st.sampled_from([0.0, -0.2, 7.5])), batches


def make_pair(grid, offset=0.0, **kwargs):
    settings = {"solution_dim": 2, "qd_score_offset": offset, "seed": 5} | kwargs
    return [kind(**settings, **grid) for kind in KINDS]


def as_arrays(batch, grid, begin=0):
    """Solutions that tell every offer apart, objectives, measures."""
    n = len(batch)
    solution = np.stack([np.arange(begin, begin + n), np.full(n, begin)], axis=1)
    objective = np.array([objective for objective, _ in batch])
    measures = np.array([measures for _, measures in batch]).reshape(n, len(grid["dims"]))
    return solution, objective, measures


def fill(archive, n=20, number=0, **fields):
    """Add n random solutions at once."""
    rng = np.random.default_rng(number)
    width = archive.upper_bounds - archive.lower_bounds
    solution = rng.normal(size=(n, archive.solution_dim))
    measures = archive.lower_bounds + width * rng.random((n, archive.measure_dim))
    return archive.add(solution, rng.normal(size=n), measures, **fields)


class TestAgainstPyribs:
    @settings(deadline=None)
    @given(streams())
    def test_batches_enter_alike(self, stream):
        grid, offset, batches = stream
        dense, sparse = make_pair(grid, offset)
        begin = 0
        for batch in batches:
            arrays = as_arrays(batch, grid, begin)
            assert_equal(dense.add(*arrays), sparse.add(*arrays))
            assert_alike(dense, sparse)
            cells = dense.index_of(arrays[-1])
            np.testing.assert_array_equal(cells, sparse.index_of(arrays[-1]))
            positions = dense.int_to_grid_index(cells)
            np.testing.assert_array_equal(positions, sparse.int_to_grid_index(cells))
            begin += len(batch)

    @settings(deadline=None)
    @given(streams(), st.integers(0, 10))
    def test_draws_are_alike(self, stream, n):
        grid, _, batches = stream
        everything = [offer for batch in batches for offer in batch]
        pair = make_pair(grid)
        for archive in pair:
            archive.add(*as_arrays(everything, grid))
        dense, sparse = pair
        for replace in (True, False):
            if dense.empty:
                for archive in pair:
                    with pytest.raises(IndexError):
                        archive.sample_elites(n, replace)
            elif n > len(dense) and not replace:
                for archive in pair:
                    with pytest.raises(ValueError, match="larger sample"):
                        archive.sample_elites(n, replace)
            else:
                assert_equal(dense.sample_elites(n, replace), sparse.sample_elites(n, replace))

    def test_many_elites(self):
        """More than the arrays begin with, and several times."""
        pair = make_pair({"dims": [40, 50], "ranges": [(0, 1), (-3, 3)]}, solution_dtype=np.float32)
        for number in range(8):
            infos = [fill(archive, 150, number) for archive in pair]
            assert_equal(*infos)
            assert_alike(*pair)
        assert len(pair[1]) > 512

    def test_extra_fields(self):
        fields = {"seed": ((), np.int64), "path": ((2, 3), np.float32)}
        pair = make_pair(GRIDS[1], extra_fields=fields)
        values = {"seed": np.arange(20), "path": np.arange(120.0).reshape(20, 2, 3)}
        for archive in pair:
            fill(archive, **values)
        assert_alike(*pair)
        dense, sparse = pair
        assert [name for name in dense.field_list if name != "threshold"] == sparse.field_list
        for name in sparse.field_list:
            assert sparse.dtypes[name].kind == np.dtype(dense.dtypes[name]).kind

    @pytest.mark.parametrize(
        ("fields", "return_type"),
        [
            (None, None),
            (None, "pandas"),
            ("objective", None),
            ("index", "dict"),
            (["index", "objective", "solution"], "tuple"),
            (["index", "objective", "solution"], "pandas"),
            (["measures"], "pandas"),
        ],
    )
    def test_data_comes_in_the_same_containers(self, fields, return_type):
        dense, sparse = make_pair(GRIDS[1])
        for archive in (dense, sparse):
            fill(archive)
        # pyribs has the threshold among all fields.
        asked = sparse.field_list if fields is None else fields
        one, other = dense.data(asked, return_type), sparse.data(fields, return_type)
        if return_type == "pandas":
            assert list(one.columns) == list(other.columns)
            np.testing.assert_array_equal(one.to_numpy(), other.to_numpy())
        elif return_type == "dict" or (return_type is None and not isinstance(asked, str)):
            assert list(one) == list(other)
            assert_equal(one, other)
        else:
            assert type(one) is type(other)
            assert len(one) == len(other)
            for each, twin in zip(one, other, strict=True):
                np.testing.assert_array_equal(each, twin)


ES = functools.partial(EvolutionStrategyEmitter, sigma0=0.3)
EMITTERS = {
    "gaussian": functools.partial(GaussianEmitter, sigma=0.3),
    "iso-line": functools.partial(IsoLineEmitter, iso_sigma=0.2),
    "cma-2imp-10": functools.partial(ES, ranker="2imp", restart_rule=10),
    "cma-2obj-none": functools.partial(ES, ranker="2obj", restart_rule="no_improvement"),
    "sep-2imp-none": functools.partial(
        ES, es="sep_cma_es", ranker="2imp", restart_rule="no_improvement"
    ),
    "sep-obj-basic": functools.partial(ES, es="sep_cma_es", ranker="obj", restart_rule="basic"),
    "sep-rd-5": functools.partial(ES, es="sep_cma_es", ranker="rd", restart_rule=5),
}


def run_emitters(kind, emitter, n_generations=40):
    """What two emitters emit in each generation, and the archive that they fill."""
    archive = kind(
        solution_dim=5, dims=[10, 7], ranges=[(-1, 1), (-2, 2)], qd_score_offset=-5.0, seed=3
    )
    emitters = [emitter(archive, x0=np.full(5, x), batch_size=9, seed=x) for x in (0, 1)]
    scheduler, emitted = Scheduler(archive, emitters), []
    for _ in range(n_generations):
        solutions = scheduler.ask()
        emitted.append(solutions.copy())
        # Rounded, so that some of a generation are worth the same.
        objective = -np.round(np.square(solutions - 0.2).sum(axis=1), 1)
        scheduler.tell(objective, solutions[:, :2] + 0.1 * solutions[:, 2:4])
    return np.array(emitted), archive, [getattr(each, "restarts", 0) for each in emitters]


@pytest.mark.parametrize("emitter", EMITTERS.values(), ids=EMITTERS)
def test_emitters_see_no_difference(emitter):
    (one, dense, restarts), (other, sparse, other_restarts) = (
        run_emitters(kind, emitter) for kind in KINDS
    )
    np.testing.assert_array_equal(one, other)
    assert_alike(dense, sparse)
    assert restarts == other_restarts
    assert len(sparse) > 20


class TestSize:
    def test_memory_grows_with_the_elites(self):
        """A dense grid would ask for 50**4 * 1746 * 4 bytes, 41 GiB."""
        rng = np.random.default_rng(0)
        tracemalloc.start()
        archive = SparseGridArchive(
            solution_dim=1746, dims=[50] * 4, ranges=[(0.0, 1.0)] * 4, solution_dtype=np.float32
        )
        for _ in range(10):
            solution = rng.random((100, 1746), dtype=np.float32)
            archive.add(solution, rng.random(100), rng.random((100, 4)))
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert len(archive) > 990
        assert peak < 20e6

    def test_cells_nearly_without_number(self):
        archive = SparseGridArchive(solution_dim=2, dims=(50,) * 11, ranges=[(-1.0, 1.0)] * 11)
        corners = np.array([[-1.0] * 11, [1.0] * 11])
        assert archive.cells == 50**11
        assert archive.index_of(corners).tolist() == [0, 50**11 - 1]
        np.testing.assert_array_equal(
            archive.int_to_grid_index([0, 50**11 - 1]), [[0] * 11, [49] * 11]
        )
        assert fill(archive, 300)["status"].tolist() == [2] * 300
        archive.add(np.ones((2, 2)), [5.0, 6.0], corners)
        assert archive.best_elite["index"] == 50**11 - 1
        assert archive.stats.coverage == 302 / 50**11


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("dims", dims) for dims in ([0, 2], [2.5, 2], ["2", 2])),
        *(("ranges", ranges) for ranges in ([(0, 1)], [(0, 1), (1, 1)], [(0, 1), (np.nan, 1)])),
    ],
)
def test_errors_name_the_argument(name, value):
    arguments = {"solution_dim": 1, "dims": [2, 3], "ranges": [(0, 1)] * 2} | {name: value}
    with pytest.raises(ValueError, match=f"^`{name}` must "):
        SparseGridArchive(**arguments)


@pytest.mark.parametrize("measures", [0.5, [[0.5]], [[0.5, np.nan]]])
def test_measures_of_another_kind(measures):
    archive = SparseGridArchive(solution_dim=1, dims=[2, 3], ranges=[(0, 1), (0, 1)])
    with pytest.raises(ValueError, match=r"`measures` must be finite of shape \(n, 2\)"):
        archive.index_of(measures)
