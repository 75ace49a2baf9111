import sys

import pytest
import sb3_contrib
import stable_baselines3

import curiosity_algos
from curiosity_algos.bonuses.make import BONUSES
from curiosity_algos.common.names import (
    ALGORITHMS,
    BONUS_NAMES,
    CONTRIB,
    STABLE_BASELINES,
    find_algorithm,
)


def test_every_algorithm_has_a_name():
    classes = {
        name for name in curiosity_algos.__all__ if hasattr(getattr(curiosity_algos, name), "learn")
    }
    assert set(ALGORITHMS) == classes
    for name in ALGORITHMS:
        assert find_algorithm(name) is getattr(curiosity_algos, name)


def test_every_bonus_has_a_name():
    assert tuple(BONUSES) == BONUS_NAMES


def test_every_one_of_stable_baselines_has_a_name():
    """Those that step a VecEnv and whose policy needs nothing but an observation."""
    for package, names, left_out in [
        (stable_baselines3, STABLE_BASELINES, {"HER", "HerReplayBuffer"}),
        (sb3_contrib, CONTRIB, {"ARS", "MaskablePPO", "RecurrentPPO"}),
    ]:
        classes = {name for name in package.__all__ if hasattr(getattr(package, name), "learn")}
        assert set(names) == classes - left_out
        assert all(find_algorithm(name.lower()) is getattr(package, name) for name in names)
    assert find_algorithm("qr-dqn") is sb3_contrib.QRDQN


def test_a_package_that_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    with pytest.raises(ImportError, match="`algo` TQC needs sb3-contrib: pip install sb3-contrib"):
        find_algorithm("tqc")


def test_a_near_miss_is_suggested_and_others_are_told_what_there_is():
    with pytest.raises(ValueError, match="`algo` curiosity_e is unknown: did you mean CuriosityES"):
        find_algorithm("curiosity_e")
    with pytest.raises(ValueError, match=r"`algo` must be one of AURORA, .*, got xyz\."):
        find_algorithm("xyz")
