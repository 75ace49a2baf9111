import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from curiosity_algos.motivations import novelty as module
from curiosity_algos.motivations.novelty import NoveltyArchive

N_DIMENSIONS = 4


def make_archive(*batches, n_dimensions=N_DIMENSIONS):
    archive = NoveltyArchive(n_dimensions)
    for batch in batches:
        archive.add(batch)
    return archive


def random_batches(n_batches, size=20, n_dimensions=N_DIMENSIONS, seed=0):
    return np.random.default_rng(seed).normal(0.0, 3.0, (n_batches, size, n_dimensions))


def brute_force(behaviors, queries, k):
    """Distances by sorting all of them."""
    distances = np.sqrt(((queries[:, None] - behaviors) ** 2).sum(axis=2))
    return np.sort(distances, axis=1)[:, :k]


def assert_answers(archive, behaviors, queries, k):
    """The archive's answer is that of brute force."""
    distances = archive.nearest(queries, k)
    assert distances.shape == (len(queries), min(k, len(behaviors)))
    assert distances.dtype == np.float64
    np.testing.assert_allclose(
        distances, brute_force(behaviors, queries, k), rtol=1e-12, atol=1e-100
    )
    assert (np.diff(distances, axis=1) >= 0.0).all()


def assert_same_answers(one, other, queries, k=7):
    assert one.nearest(queries, k).tobytes() == other.nearest(queries, k).tobytes()


@st.composite
def streams(draw):
    """Batches of a random number of dimensions; small whole numbers make many of them equal."""
    n_dimensions = draw(st.integers(1, 6))
    numbers = st.one_of(st.integers(-2, 2).map(float), st.floats(-1e3, 1e3))
    shapes = st.tuples(st.integers(0, 12), st.just(n_dimensions))
    batches = st.lists(hnp.arrays(np.float64, shapes, elements=numbers), min_size=1, max_size=12)
    return draw(batches)


@settings(deadline=None)
@given(streams(), st.integers(1, 30))
def test_a_stream_is_answered_as_brute_force_does(batches, k):
    archive, seen = NoveltyArchive(batches[0].shape[1]), batches[0][:0]
    for batch in batches:
        assert_answers(archive, seen, batch, k)
        archive.add(batch)
        seen = np.concatenate([seen, batch])
        assert_answers(archive, seen, batch, k)
        assert len(archive) == len(seen)


@settings(max_examples=settings.default.max_examples // 5)
@given(st.integers(1, 6), st.integers(1, 25), st.integers(0, 1000))
def test_a_long_stream_crosses_rebuilds(n_dimensions, k, seed):
    rng = np.random.default_rng(seed)
    archive, seen, covered = NoveltyArchive(n_dimensions), np.empty((0, n_dimensions)), set()
    while len(seen) < 2000:
        batch = rng.normal(0.0, 10.0, (rng.integers(1, 40), n_dimensions))
        batch[rng.random(len(batch)) < 0.3] = 5.0
        archive.add(batch)
        seen = np.concatenate([seen, batch])
        covered.add(archive.state_dict()["n_indexed"])
        queries = np.concatenate([batch[:3], rng.normal(0.0, 10.0, (3, n_dimensions))])
        assert_answers(archive, seen, queries, k)
    assert len(covered) >= 10
    # A tail that no tree covers yet is answered from, too.
    n_distinct = len(np.unique(seen, axis=0))
    assert max(covered) <= n_distinct
    assert max(covered) > n_distinct / (1.0 + module.REBUILD_SHARE) - 1


def test_thousands_of_copies_are_held_once_in_the_trees():
    archive = make_archive(np.ones((5000, 2)), -np.zeros((5000, 2)), n_dimensions=2)
    archive.add(np.zeros((5000, 2)))
    assert len(archive) == 15_000
    assert archive.state_dict()["n_indexed"] == 2
    distances = archive.nearest([[0.0, 0.0], [2.0, 1.0]], 10_001)
    np.testing.assert_array_equal(distances[0], [0.0] * 10_000 + [np.sqrt(2.0)])
    np.testing.assert_array_equal(distances[1, 4999:5001], [1.0, np.sqrt(5.0)])


def test_a_tree_is_rebuilt_once_enough_is_new():
    archive = make_archive(random_batches(1, 1000)[0])
    covered = []
    for row in random_batches(1, 40, seed=1)[0]:
        archive.add([row])
        covered.append(archive.state_dict()["n_indexed"])
    assert covered == [1000] * 30 + [1031] * 10


@pytest.mark.parametrize("n_more", [1, 300])
@pytest.mark.parametrize("n_tail", [0, 20])
def test_a_state_resumes_in_every_bit(n_tail, n_more):
    batches, queries = random_batches(1 + n_more, 3, seed=2), random_batches(1, 40, seed=3)[0]
    first = np.round(random_batches(1, 1000)[0])
    archive = make_archive(first, np.round(random_batches(1, 20, seed=1)[0])[:n_tail])
    loaded = make_archive(*random_batches(3, seed=4))
    loaded.load_state_dict(archive.state_dict())
    assert len(loaded) == len(archive)
    assert_same_answers(loaded, archive, np.round(queries))
    for batch in batches:
        for each in (loaded, archive):
            each.add(np.round(batch))
    assert_same_answers(loaded, archive, np.round(queries))
    assert loaded.state_dict()["n_indexed"] == archive.state_dict()["n_indexed"]


@pytest.mark.parametrize("copies", [[1], [1, 0], [1.0, 2.0]])
def test_a_state_of_other_copies_is_refused(copies):
    archive = make_archive(np.eye(4)[:2])
    state = {**archive.state_dict(), "copies": np.array(copies)}
    with pytest.raises(ValueError, match="copies` must be "):
        archive.load_state_dict(state)
    assert len(archive) == 2


SHAPE, FAR = r"have the shape \(n, 4\)", "be finite and below 1e"


@pytest.mark.parametrize(
    ("behaviors", "message"),
    [
        *((wrong, SHAPE) for wrong in ([0.0] * 4, [[0.0] * 3], [[[0.0] * 4]])),
        *(([[0.0, 0.0, entry, 0.0]], FAR) for entry in (np.nan, np.inf, -1e150)),
    ],
)
def test_other_behaviors_are_refused(behaviors, message):
    archive = make_archive(*random_batches(1))
    for call in (archive.add, lambda rows: archive.nearest(rows, 1)):
        with pytest.raises(ValueError, match=f"`behaviors` must {message}"):
            call(behaviors)
    assert len(archive) == 20


@pytest.mark.parametrize("k", [0, -1, 1.5])
def test_fewer_than_one_neighbor_is_refused(k):
    with pytest.raises(ValueError, match="`k` must be a whole number of at least 1"):
        make_archive(*random_batches(1)).nearest(np.zeros((1, 4)), k)
