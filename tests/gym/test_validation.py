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


def test_counts_are_whole_numbers_of_at_least_one():
    for value in [0, -1, 1.5, math.nan, "2", None, True, np.True_]:
        check_at_least_one(other=1, size=np.int64(3))
        with pytest.raises(ValueError, match=r"`size` must be a whole number of at least 1"):
            check_at_least_one(other=1, size=value)


def test_scales_are_finite_and_positive():
    for value in [0, -0.1, math.nan, math.inf, "1", None]:
        check_positive(other=1, sigma=1e-9)
        with pytest.raises(ValueError, match=r"`sigma` must be finite and above 0"):
            check_positive(other=1, sigma=value)


def test_what_is_not_negative_is_finite_and_at_least_zero():
    for value in [-0.1, math.nan, math.inf, "1", None]:
        check_not_negative(other=0, noise=0.2)
        with pytest.raises(ValueError, match=r"`noise` must be finite and at least 0"):
            check_not_negative(other=0, noise=value)


def test_shares_are_from_zero_to_one():
    for value in [-0.1, 1.1, math.nan, math.inf, "1", None]:
        check_share(other=0, gamma=1)
        with pytest.raises(ValueError, match=r"`gamma` must be from 0 to 1"):
            check_share(other=0, gamma=value)


def test_switches_are_true_or_false():
    for value in [0, 1, "True", None]:
        check_bool(other=np.True_, random_start=False)
        with pytest.raises(ValueError, match=r"`random_start` must be True or False, got"):
            check_bool(other=True, random_start=value)


def test_choices_are_named():
    for value in ["A", "", None, 3]:
        check_choice(("a", "b"), step="b")
        with pytest.raises(ValueError, match=r"`step` must be one of a, b, got"):
            check_choice(("a", "b"), step=value)
