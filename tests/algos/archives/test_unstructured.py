"""The oracles are plain Python: what the docstrings say, with lists and loops."""

import math
import tracemalloc
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from saved_files import through_a_file

from curiosity_algos.archives import unstructured
from curiosity_algos.archives.base import IMPROVED, NEW, NOT_ADDED
from curiosity_algos.archives.unstructured import UnstructuredArchive

EXTRA = {"seed": ((), np.int64), "states": ((2, 3), np.float32)}


def distance(one, other):
    return math.sqrt(sum((a - b) ** 2 for a, b in zip(one, other, strict=True)))


def closest_pair(elites):
    """The first of the closest pairs, and how far its two are from each other."""
    pairs = [(i, j) for i in range(len(elites)) for j in range(i + 1, len(elites))]
    gaps = [distance(elites[i]["measures"], elites[j]["measures"]) for i, j in pairs]
    gap = min(gaps, default=math.inf)
    return gap, pairs[gaps.index(gap)] if pairs else None


def drop_closest(elites, n_kept):
    elites = list(elites)
    while len(elites) > n_kept:
        _, (i, j) = closest_pair(elites)
        del elites[i if elites[i]["objective"] < elites[j]["objective"] else j]
    return elites


class Plain:
    """The archive as its docstring describes it."""

    def __init__(self, target_size):
        self.target_size = target_size
        self.elites, self.threshold = [], 0.0

    def add(self, batch):
        info = [self.offer(one) for one in batch]
        if 10 * len(self.elites) > 11 * self.target_size:
            self.elites = drop_closest(self.elites, self.target_size)
            self.threshold = closest_pair(self.elites)[0] if len(self.elites) > 1 else 0.0
        return info

    def offer(self, one):
        distances = [distance(one["measures"], each["measures"]) for each in self.elites]
        if min(distances, default=math.inf) > self.threshold:
            self.elites.append(one)
            return NEW, one["objective"]
        nearest = distances.index(min(distances))
        improvement = one["objective"] - self.elites[nearest]["objective"]
        if improvement <= 0:
            return NOT_ADDED, improvement
        self.elites[nearest] = one
        return IMPROVED, improvement


def make_archive(*, target_size=10, k_neighbors=3, seed=0, **changes):
    kwargs = {"solution_dim": 1, "measure_dim": 2} | changes
    return UnstructuredArchive(
        **kwargs, target_size=target_size, k_neighbors=k_neighbors, seed=seed
    )


def as_arrays(batch, measure_dim=2):
    """A list of dictionaries as the arguments of `add`."""
    return {
        "solution": np.array([one["solution"] for one in batch]).reshape(-1, 1),
        "objective": np.array([one["objective"] for one in batch]),
        "measures": np.array([one["measures"] for one in batch]).reshape(-1, measure_dim),
    }


def make_batch(n, number=0):
    """n random offers with all of `EXTRA`, whose solution tells them apart."""
    rng = np.random.default_rng(number)
    solution = 1000 * number + np.arange(n)
    return {
        "solution": solution[:, None],
        "objective": rng.normal(size=n),
        "measures": rng.normal(size=(n, 2)),
        "seed": solution,
        "states": np.repeat(solution, 6).reshape(n, 2, 3),
    }


def make_full(*, n_batches=6, **changes):
    archive = make_archive(extra_fields=EXTRA, **changes)
    for number in range(n_batches):
        archive.add(**make_batch(12, number))
    return archive


def gaps_of(archive):
    """Distances of all pairs of elites."""
    measures = archive.data("measures").tolist()
    return [distance(a, b) for i, a in enumerate(measures) for b in measures[:i]]


def assert_fields_belong_together(archive):
    """What `make_batch` made of one solution is still with it."""
    elites = archive.data()
    np.testing.assert_array_equal(elites["seed"], elites["solution"][:, 0])
    np.testing.assert_array_equal(elites["states"].min(axis=(1, 2)), elites["seed"])
    np.testing.assert_array_equal(elites["states"].max(axis=(1, 2)), elites["seed"])


def assert_stats_fit(archive, offset=0.0):
    """The running sum and the best are those of the elites."""
    objective = archive.data("objective")
    n = len(objective)
    assert archive.stats.num_elites == len(archive) == n
    assert archive.stats.qd_score == pytest.approx((objective - offset).sum())
    assert archive.stats.obj_max == archive.best_elite["objective"] == objective.max()
    best = archive.best_elite["solution"]
    assert (archive.data("solution")[objective == objective.max()] == best).all(axis=1).any()


# Few places, on a grid: distances tie, and are exact in floating point.
PLACES = st.lists(st.integers(0, 5).map(lambda k: k / 4), min_size=2, max_size=2)
OFFERS = st.fixed_dictionaries(
    {"objective": st.integers(-2, 3).map(lambda k: k / 8), "measures": PLACES}
)


@st.composite
def streams(draw, max_batches=8):
    """Batches of offers, numbered through by their solutions."""
    batches = draw(st.lists(st.lists(OFFERS, max_size=12), min_size=1, max_size=max_batches))
    for number, one in enumerate(one for batch in batches for one in batch):
        one["solution"] = float(number)
    return batches


def compete_by_definition(batch, elites, k):
    """Novelty and local competition of each of the batch; neighbors that tie: the batch first."""
    everybody = batch + elites
    for i, one in enumerate(batch):
        others = [j for j in range(len(everybody)) if j != i]
        pairs = sorted((distance(one["measures"], everybody[j]["measures"]), j) for j in others)
        nearest = pairs[:k]
        mean = sum(gap for gap, _ in nearest) / len(nearest) if nearest else 0.0
        yield mean, sum(everybody[j]["objective"] < one["objective"] for _, j in nearest)


@pytest.mark.filterwarnings("error")
@settings(deadline=None)
@given(streams(), st.integers(1, 40), st.integers(1, 15))
def test_novelty_and_local_competition_are_brute_forces(batches, k, target_size):
    archive, plain = make_archive(target_size=target_size, k_neighbors=k), Plain(target_size)
    for batch in batches:
        info = archive.add(**as_arrays(batch))
        expected = list(compete_by_definition(batch, plain.elites, k))
        assert info["novelty"].shape == info["local_competition"].shape == (len(batch),)
        np.testing.assert_allclose(info["novelty"], [each for each, _ in expected], rtol=1e-12)
        assert info["local_competition"].tolist() == [each for _, each in expected]
        plain.add(batch)


class TestInsertion:
    @settings(deadline=None)
    @given(streams(), st.integers(1, 12), st.sampled_from([1, 3, 100]))
    def test_a_stream_enters_as_described(self, batches, target_size, n_compared):
        archive, plain = make_archive(target_size=target_size), Plain(target_size)
        for batch in batches:
            with mock.patch.object(unstructured, "N_COMPARED", n_compared):
                info = archive.add(**as_arrays(batch))
            expected = plain.add(batch)
            assert list(zip(info["status"], info["value"], strict=True)) == expected
            assert archive.threshold == plain.threshold
            for name, values in as_arrays(plain.elites).items():
                np.testing.assert_array_equal(archive.data(name), values)

    def test_of_equals_the_first_to_come_is_the_best(self):
        archive = make_archive(threshold=1.0)
        archive.add([[0.0], [1.0], [2.0]], [1.0, 5.0, 5.0], [[0.0, 0.0], [9.0, 9.0], [0.0, 0.0]])
        assert archive.best_elite["solution"] == 1.0

    @pytest.mark.parametrize("target_size", [1, 10, 19, 110])
    def test_it_grows_by_a_tenth_before_it_is_thinned_out(self, target_size):
        n = 11 * target_size // 10
        archive = make_archive(target_size=target_size, extra_fields=EXTRA)
        archive.add(**make_batch(n))
        assert (len(archive), archive.threshold) == (n, 0.0)
        archive.add(**make_batch(1, 1))
        assert len(archive) == target_size

    @pytest.mark.parametrize("threshold", [np.nan, -1.0])
    def test_a_state_has_a_threshold(self, threshold, assert_same):
        archive, twin = make_full(), make_full()
        with pytest.raises(ValueError, match=r"^`threshold` must be finite and at least 0"):
            archive.load_state_dict(make_archive().state_dict() | {"threshold": threshold})
        assert archive.threshold == twin.threshold
        assert_same(archive.data(), twin.data())

    def test_clearing_forgets_the_threshold(self):
        archive = make_full()
        assert archive.threshold > 0
        archive.clear()
        assert (len(archive), archive.threshold) == (0, 0.0)
        archive.add(**make_batch(9))
        assert len(archive) == 9

    @pytest.mark.parametrize("name", ["target_size", "k_neighbors"])
    @pytest.mark.parametrize("value", [0, 1.5])
    def test_errors_name_the_argument(self, name, value):
        with pytest.raises(ValueError, match=f"`{name}` must be a whole number of at least 1"):
            make_archive(**{name: value})


class TestThinning:
    def test_many_elites_need_no_matrix(self):
        n, rng = 2201, np.random.default_rng(0)
        archive = make_archive(target_size=2000)
        tracemalloc.start()
        archive.add(np.zeros((n, 1)), rng.normal(size=n), rng.normal(size=(n, 2)))
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert len(archive) == 2000
        assert peak < n**2  # an eighth of a matrix

    @pytest.mark.parametrize("entry", [1e150, -1e200])
    def test_what_is_too_far_away_is_refused(self, entry, assert_same):
        archive, twin = make_full(), make_full()
        with pytest.raises(ValueError, match="`measures` must be finite and below 1e"):
            archive.add(**make_batch(3) | {"measures": np.full((3, 2), entry)})
        with pytest.raises(ValueError, match="`measures` must be finite and below 1e"):
            archive.set_measures(np.full((len(archive), 2), entry))
        assert_same(archive.data(), twin.data())


@settings(max_examples=settings.default.max_examples // 2)
@given(st.integers(1, 6), st.integers(1, 30), st.integers(0, 99))
def test_the_size_stays_in_bounds_as_elites_are_measured_anew(n_batches, target_size, number):
    archive = make_full(n_batches=n_batches, target_size=target_size)
    n, before = len(archive), archive.data()
    places = np.random.default_rng(number).normal(size=(n, 2))
    archive.set_measures(places)
    assert min(n, target_size) <= len(archive) <= 1.1 * target_size
    assert_fields_belong_together(archive)
    assert_stats_fit(archive)
    assert archive.stats.obj_max == before["objective"].max()
    # Those that are left have their own new measures.
    rows = [before["seed"].tolist().index(seed) for seed in archive.data("seed")]
    np.testing.assert_array_equal(archive.data("measures"), places[rows])
    if 1 < len(archive) >= target_size:
        assert archive.threshold == pytest.approx(min(gaps_of(archive)), rel=1e-12)
    else:
        assert archive.threshold == 0.0


class TestStates:
    @pytest.mark.parametrize("n_batches", [0, 1, 2, 6])
    def test_a_stream_goes_on_in_every_bit(self, n_batches, assert_same):
        one = make_full(n_batches=n_batches, target_size=20)
        other = make_archive(target_size=20, seed=1, extra_fields=EXTRA)
        other.add(**make_batch(40, 77))
        other.load_state_dict(through_a_file(one.state_dict()))
        assert other.threshold == one.threshold
        assert_same(one.data(), other.data())
        for number in range(100, 106):
            infos = [archive.add(**make_batch(12, number)) for archive in (one, other)]
            np.testing.assert_equal(*infos)
            np.testing.assert_equal(one.sample_elites(5), other.sample_elites(5))
            assert one.stats == other.stats
        assert one.threshold > 0
        assert_same(one.state_dict(), other.state_dict())

    def test_the_threshold_is_not_computed_anew(self):
        """A replaced elite may have come nearer to another one than the threshold."""
        one = make_archive(target_size=2, measure_dim=1)
        one.add([[0], [9], [8]], [4, 3, 2], [[0], [9], [8]])
        one.add([[5]], [5], [[5]])
        assert (one.threshold, gaps_of(one)) == (9.0, [5.0])
        other = make_archive(target_size=2, measure_dim=1)
        other.load_state_dict(one.state_dict())
        assert other.threshold == 9.0
