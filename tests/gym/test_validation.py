import math
from functools import partial

import numpy as np
import pytest

from curiosity_gym import validation

NO_NUMBERS = [math.nan, "1", None, True, np.ones(1)]
COUNT = "a whole number of at least 1, at most 1,000,000,000, got"


@pytest.mark.parametrize(
    ("check", "right", "wrong", "message"),
    [
        ("at_least_one", [1, np.int64(3)], [0, -1, 1.5, math.inf, 10**18, 10**400], COUNT),
        (
            "positive",
            [1, 1e-9, np.float32(3.0)],
            [0, -0.1, math.inf, 1e300, 10**400],
            r"finite and above 0, at most 1e\+12, got",
        ),
        (
            "not_negative",
            [0, 0.2],
            [-0.1, math.inf, 1e300],
            r"finite and at least 0, at most 1e\+12, got",
        ),
        ("share", [0, 1], [-0.1, 1.1, math.inf], "from 0 to 1"),
        (partial(validation.check_whole, 0, 2), [np.int8(0), 2], [-1, 3], "a whole number from"),
        (partial(validation.check_choice, ("a", "b")), ["b"], ["A", "", 3, ["a"]], "one of a"),
    ],
)
def test_checks_name_the_argument_and_what_it_may_be(check, right, wrong, message):
    check = getattr(validation, f"check_{check}") if isinstance(check, str) else check
    check(**{f"other{i}": value for i, value in enumerate(right)})
    refuse(check, [*wrong, *NO_NUMBERS], message)


def refuse(check, values, message, name="size"):
    for value in values:
        with pytest.raises(ValueError, match=f"^`{name}` must be {message}"):
            check(**{name: value})


def test_checks_of_what_is_no_number():
    validation.check_bool(other=np.True_, random_start=False)
    refuse(validation.check_bool, [0, 1, "True", None], "True or False")
    validation.check_keywords(other=None, size={"a": 1})
    wrong = ["a", [1], {1: 2}, {"a"}]
    refuse(validation.check_keywords, wrong, "None or a dictionary of keywords")
    for seed in (None, 0, 10**40, np.uint64(2**63)):
        validation.check_seed(seed)
    refuse(validation.check_seed, [-1, 0.0, True, "1"], "None or a whole number", "seed")
