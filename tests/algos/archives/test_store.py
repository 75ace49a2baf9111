import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from curiosity_algos.archives.store import EliteStore

DESCRIPTION = {
    "objective": ((), np.dtype(np.float64)),
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


@given(st.lists(st.tuples(st.integers(0, 30), st.integers(1, 90)), max_size=8))
def test_a_stream_of_rows_is_a_growing_array(batches):
    """Each batch writes to some old slots and to new ones after them."""
    store, held, count = EliteStore(DESCRIPTION), np.empty(0), 0
    for n_old, n_new in batches:
        old = np.random.default_rng(count).permutation(len(held))[:n_old]
        slots = np.concatenate([old, len(held) + np.arange(n_new)]).astype(np.int64)
        values = np.arange(count, count + len(slots))
        held = np.concatenate([held, np.zeros(n_new)])
        held[slots], count = values, count + len(slots)
        store.write(slots, make_rows(values))
        assert store.objective_sum == held.sum()
        assert store.best_objective == held.max()
    assert len(store) == len(held)
    for name, expected in make_rows(held).items():
        got = store.get(name, np.arange(len(held)))
        assert got.dtype == expected.dtype
        np.testing.assert_array_equal(got, expected)
