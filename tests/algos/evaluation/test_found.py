"""What is kept of all that succeeded."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from curiosity_algos.evaluation.found import N_FOUND, FoundPolicies, Spread


@given(st.integers(0, 3_000))
def test_what_is_kept_is_spread_over_all_that_was_seen(n):
    spread = Spread()
    for i in range(n):
        spread.see(i)
    assert spread.n_seen == n
    assert min(n, N_FOUND) <= len(spread.kept) < 2 * N_FOUND
    assert len(set(np.diff(spread.kept))) <= 1
    assert spread.kept[:1] == [0][:n]
    stride = spread.kept[1] if len(spread.kept) > 1 else 1
    assert n - stride <= spread.kept[-1] < n if n else not spread.kept


def found_policies(n):
    found = FoundPolicies(3)
    for i in range(n):
        found.see((np.full(3, i, np.float32), i + 7))
    return found


@pytest.mark.parametrize("n", [0, 1, 40])
def test_policies_go_on_from_their_state(n, assert_same):
    one, other = found_policies(n), FoundPolicies(3)
    other.load_state_dict(one.state_dict())
    for found in (one, other):
        found.see((np.zeros(3, np.float32), 0))
    assert_same(other.state_dict(), one.state_dict())
    assert [type(seed) for _, seed in other.kept] == [int] * len(one.kept)


@pytest.mark.parametrize(
    "change",
    [
        {"parameters": np.zeros((2, 4), np.float32)},
        {"parameters": np.full((2, 3), np.nan, np.float32)},
        {"seeds": np.array([1, -1])},
        {"seeds": np.array([1])},
        {"n_seen": "2"},
    ],
)
def test_states_that_do_not_fit(change):
    with pytest.raises(ValueError, match="`found"):
        FoundPolicies(3).load_state_dict(found_policies(2).state_dict() | change)
