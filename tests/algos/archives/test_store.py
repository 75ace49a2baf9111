import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from curiosity_algos.archives.store import EliteStore

DESCRIPTION = {
    "number": ((), np.dtype(np.float64)),
    "pair": ((2,), np.dtype(np.float32)),
    "nothing": ((0,), np.dtype(np.int64)),
    "matrix": ((2, 3), np.dtype(np.int64)),
}


def make_rows(values):
    values = np.array(values)
    return {
        name: np.broadcast_to(
            values.reshape(-1, *[1] * len(shape)).astype(dtype), (len(values), *shape)
        )
        for name, (shape, dtype) in DESCRIPTION.items()
    }


def fill(n):
    store = EliteStore(DESCRIPTION)
    if n:
        store.put(np.arange(n), make_rows(range(n)))
    return store


def assert_holds(store, values):
    assert len(store) == len(values)
    for name, expected in make_rows(values).items():
        got = store.get(name)
        assert got.dtype == expected.dtype
        np.testing.assert_array_equal(got, expected)


@given(st.lists(st.tuples(st.integers(0, 30), st.integers(1, 40)), max_size=8))
def test_a_stream_of_rows_is_a_growing_array(batches):
    """Each batch writes to some old slots and to new ones after them."""
    store, held, count = EliteStore(DESCRIPTION), np.empty(0), 0
    for n_old, n_new in batches:
        old = np.random.default_rng(count).permutation(len(held))[:n_old]
        slots = np.concatenate([old, len(held) + np.arange(n_new)]).astype(np.int64)
        values = np.arange(count, count + len(slots))
        held = np.concatenate([held, np.zeros(n_new)])
        held[slots], count = values, count + len(slots)
        store.put(slots, make_rows(values))
    assert_holds(store, held)
    some = np.random.default_rng(0).integers(0, max(len(held), 1), 50 if len(held) else 0)
    for name, expected in make_rows(held[some]).items():
        np.testing.assert_array_equal(store.get(name, some), expected)


@pytest.mark.parametrize("n", [0, 9, 10, 11, 100])  # 10 rows of matrices in a block
def test_all_rows_come_at_the_edges_of_blocks(n):
    assert_holds(fill(n), range(n))


def test_copies_come_out():
    store = fill(40)
    for slots in (None, np.arange(40)):
        store.get("pair", slots)[...] = -1
    assert_holds(store, range(40))


def test_growing_copies_nothing():
    store = fill(20)
    before = [block["matrix"] for block in store._blocks]
    store.put(np.arange(20, 90), make_rows(range(20, 90)))
    assert all(old is block["matrix"] for old, block in zip(before, store._blocks, strict=False))
    assert_holds(store, range(90))


def test_a_field_that_there_is_not():
    with pytest.raises(ValueError, match=r"`fields` must be of number, pair, .* got 'color'"):
        fill(3).get("color")
