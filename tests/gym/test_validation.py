import math

import numpy as np
import pytest

from curiosity_gym.validation import (
    check_at_least_one,
    check_bool,
    check_choice,
    check_not_negative,
    check_positive,
    check_share,
)


@pytest.mark.parametrize("value", [0, -1, 1.5, math.nan, "2", None, True, np.True_])
def test_counts_are_whole_numbers_of_at_least_one(value):
    check_at_least_one(other=1, size=np.int64(3))
    with pytest.raises(ValueError, match=r"`size` must be a whole number of at least 1"):
        check_at_least_one(other=1, size=value)


@pytest.mark.parametrize("value", [0, -0.1, math.nan, math.inf, "1", None])
def test_scales_are_finite_and_positive(value):
    check_positive(other=1, sigma=1e-9)
    with pytest.raises(ValueError, match=r"`sigma` must be finite and above 0"):
        check_positive(other=1, sigma=value)


@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf, "1", None])
def test_what_is_not_negative_is_finite_and_at_least_zero(value):
    check_not_negative(other=0, noise=0.2)
    with pytest.raises(ValueError, match=r"`noise` must be finite and at least 0"):
        check_not_negative(other=0, noise=value)


@pytest.mark.parametrize("value", [-0.1, 1.1, math.nan, math.inf, "1", None])
def test_shares_are_from_zero_to_one(value):
    check_share(other=0, gamma=1)
    with pytest.raises(ValueError, match=r"`gamma` must be from 0 to 1"):
        check_share(other=0, gamma=value)


@pytest.mark.parametrize("value", [0, 1, "True", None])
def test_switches_are_true_or_false(value):
    check_bool(other=np.True_, random_start=False)
    with pytest.raises(ValueError, match=r"`random_start` must be True or False, got"):
        check_bool(other=True, random_start=value)


@pytest.mark.parametrize("value", ["A", "", None, 3])
def test_choices_are_named(value):
    check_choice(("a", "b"), step="b")
    with pytest.raises(ValueError, match=r"`step` must be one of a, b, got"):
        check_choice(("a", "b"), step=value)
