import pytest

import curiosity_algos
from curiosity_algos.experiments.names import ALGORITHMS, find_algorithm


def test_every_algorithm_has_a_name():
    classes = {
        name for name in curiosity_algos.__all__ if hasattr(getattr(curiosity_algos, name), "learn")
    }
    assert set(ALGORITHMS) == classes
    for name in ALGORITHMS:
        assert find_algorithm(name) is getattr(curiosity_algos, name)


def test_spelling_does_not_count():
    for name, found in {
        "curiosity_es": "CuriosityES",
        "ns-es": "NSES",
        "MAP_Elites": "MAPElites",
        "td3_icm": "TD3ICM",
        "curiosity-map-elites": "CuriosityMAPElites",
    }.items():
        assert find_algorithm(name) is getattr(curiosity_algos, found)


def test_a_near_miss_is_suggested():
    with pytest.raises(ValueError, match="`algo` curiosity_e is unknown: did you mean CuriosityES"):
        find_algorithm("curiosity_e")


def test_others_are_told_what_there_is():
    with pytest.raises(ValueError, match=r"`algo` must be one of AURORA, .*, got xyz\."):
        find_algorithm("xyz")
