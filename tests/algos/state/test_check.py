"""A state is loaded if it is built as the own one is; else the first difference is named."""

import numpy as np
import pytest
import torch as th

from curiosity_algos.state.check import check_like

OWN = {
    "center": np.zeros(3),
    "elites": {"solution": np.empty((0, 2), np.float32)},
    "weights": {0: th.zeros(2, 2)},
    "n": 0,
    "sigma": 0.3,
    "best": -np.inf,
    "rows": np.full((0, 1), np.nan),
    "noise": np.array([np.inf]),
    "groups": [{"lr": 0.1}],
    "betas": (0.9, 0.99),
    "name": "x",
    "none": None,
}


def test_a_state_like_the_own_one_is_taken():
    check_like(OWN, OWN)
    grown = {"elites": {"solution": np.ones((7, 2), np.float32)}, "best": 3.0, "n": 4}
    check_like(OWN | grown | {"noise": np.array([np.nan])}, OWN)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"center": np.zeros(4)}, r"`state\.center` must be of float64 and shape \(3,\)"),
        ({"center": np.zeros(3, np.float32)}, r"`state\.center` must be of float64"),
        ({"center": th.zeros(3, dtype=th.float64)}, r"`state\.center` must be of"),
        ({"center": np.array([0.0, np.nan, 0.0])}, r"`state\.center` must be finite"),
        ({"elites": 3}, r"`state\.elites` must be a dictionary, got 3"),
        ({"elites": {}}, r"`state\.elites` must have `solution`, which is missing"),
        ({"elites": {**OWN["elites"], "x": 1}}, r"`state\.elites` must not have `x`"),
        ({"elites": {"solution": np.ones((7, 3), np.float32)}}, r"of float32 and shape \('n', 2\)"),
        ({"weights": {0: np.zeros((2, 2), np.float32)}}, r"`state\.weights\.0` must be of"),
        ({"weights": {"0": th.zeros(2, 2)}}, r"`state\.weights` must have `0`"),
        ({"n": 1.0}, r"`state\.n` must be of type int, got 1\.0"),
        ({"sigma": np.nan}, r"`state\.sigma` must be finite, got nan"),
        ({"groups": []}, r"`state\.groups` must be a list of 1 entries"),
        ({"betas": [0.9, 0.99]}, r"`state\.betas` must be a tuple of 2"),
        ({"none": 1}, r"`state\.none` must be of type NoneType"),
    ],
)
def test_the_first_difference_is_named(change, message):
    with pytest.raises(ValueError, match=message):
        check_like(OWN | change, OWN)
