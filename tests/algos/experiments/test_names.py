import pytest

import curiosity_algos
from curiosity_algos.experiments.names import ALGORITHMS, find_algorithm


def test_every_algorithm_has_a_name(any_algorithm):
    assert any_algorithm.__name__ in ALGORITHMS
    assert find_algorithm(any_algorithm.__name__) is any_algorithm


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("curiosity_es", "CuriosityES"),
        ("curiosityes", "CuriosityES"),
        ("ns-es", "NSES"),
        ("MAP_Elites", "MAPElites"),
        ("td3_icm", "TD3ICM"),
        ("curiosity-map-elites", "CuriosityMAPElites"),
    ],
)
def test_spelling_does_not_count(name, found):
    assert find_algorithm(name) is getattr(curiosity_algos, found)


@pytest.mark.parametrize(
    ("name", "suggested"), [("curiosity_e", "CuriosityES"), ("map_elite", "MAPElites")]
)
def test_a_near_miss_is_suggested(name, suggested):
    with pytest.raises(ValueError, match=f"`algo` {name} is unknown: did you mean {suggested}"):
        find_algorithm(name)


def test_others_are_told_what_there_is():
    with pytest.raises(ValueError, match=r"`algo` must be one of AURORA, .*, got xyz\."):
        find_algorithm("xyz")
