"""Elites of two archives."""

import numpy as np


def assert_same_elites(one, other):
    """Two archives hold the same, in the same order and types."""
    one, other = one.data(), other.data()
    assert list(one) == list(other)
    for name in one:
        assert one[name].dtype == other[name].dtype
        np.testing.assert_array_equal(one[name], other[name])
