import math

import numpy as np
import pytest

from curiosity_gym.validation import (
    check_at_least_one,
    check_bool,
    check_choice,
    check_keywords,
    check_not_negative,
    check_positive,
    check_seed,
    check_share,
    check_whole,
)

NO_NUMBERS = [math.nan, "1", None, True, np.ones(1)]


def refuse(check, values, message, name="size"):
    for value in values:
        with pytest.raises(ValueError, match=f"^`{name}` must be {message}"):
            check(**{name: value})


def test_counts_are_whole_numbers_of_at_least_one():
    check_at_least_one(other=1, size=np.int64(3))
    what = "a whole number of at least 1, at most 1,000,000,000, got"
    refuse(check_at_least_one, [0, -1, 1.5, math.inf, 10**18, 10**400, *NO_NUMBERS], what)


def test_whole_numbers_are_between_two():
    check_whole(0, 2, other=np.int8(0), verbose=2)
    refuse(
        lambda **values: check_whole(0, 2, **values), [-1, 3, *NO_NUMBERS], "a whole number from"
    )


def test_scales_are_finite_and_positive():
    check_positive(other=1, sigma=1e-9, size=np.float32(3.0))
    wrong = [0, -0.1, math.inf, 1e300, 10**400, *NO_NUMBERS]
    refuse(check_positive, wrong, r"finite and above 0, at most 1e\+12, got")


def test_what_is_not_negative_is_finite_and_at_least_zero():
    check_not_negative(other=0, noise=0.2)
    wrong = [-0.1, math.inf, 1e300, *NO_NUMBERS]
    refuse(check_not_negative, wrong, r"finite and at least 0, at most 1e\+12, got")


def test_shares_are_from_zero_to_one():
    check_share(other=0, gamma=1)
    refuse(check_share, [-0.1, 1.1, math.inf, *NO_NUMBERS], "from 0 to 1")


def test_switches_are_true_or_false():
    check_bool(other=np.True_, random_start=False)
    refuse(check_bool, [0, 1, "True", None], "True or False")


def test_choices_are_named():
    check_choice(("a", "b"), step="b")
    refuse(
        lambda **values: check_choice(("a", "b"), **values), ["A", "", None, 3, ["a"]], "one of a"
    )


def test_keywords_are_dictionaries_of_names():
    check_keywords(other=None, size={"a": 1})
    refuse(check_keywords, ["a", [1], {1: 2}, {"a"}], "None or a dictionary of keywords")


def test_seeds_are_whole_numbers_of_any_size():
    for seed in (None, 0, 10**40, np.uint64(2**63)):
        check_seed(seed)
    refuse(check_seed, [-1, 0.0, True, "1"], "None or a whole number", "seed")
