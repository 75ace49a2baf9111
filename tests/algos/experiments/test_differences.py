import pytest

from curiosity_algos.experiments.differences import differences

THERE = {"algorithm": "NSES", "env": "A-v0", "seed": 0, "settings": {"sigma": 0.5, "k": None}}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, []),
        ({"settings": {"sigma": 0.5, "k": None, "device": "cuda", "verbose": 2}}, []),
        ({"versions": {"numpy": "9"}, "vec_env": None}, []),
        ({"seed": 1}, ["seed is 0, not 1"]),
        ({"seed": 1, "env": "B-v0"}, ['env is "A-v0", not "B-v0"']),
        ({"wrappers": {"Flatten": {}}}, ["wrappers.Flatten is left out, not {}"]),
        ({"vec_env": {"n_envs": 2}}, ["vec_env.n_envs is left out, not 2"]),
    ],
)
def test_the_first_field_that_differs_is_named(changes, expected):
    there = THERE | {"wrappers": {}}
    assert differences(there, there | changes) == expected


def test_all_of_its_values_are_named_by_their_paths():
    here = {"sigma": 1, "n": {"arch": [4]}, "k": None}
    assert differences(THERE, THERE | {"settings": here}) == [
        "settings.n.arch is left out, not [4]",
        "settings.sigma is 0.5, not 1",
    ]
    assert (
        differences(THERE | {"settings": here}, THERE | {"settings": here | {"sigma": 1.0}}) == []
    )
    nothing = {"settings": here | {"n": {}}}
    assert differences(THERE | nothing, THERE | {"settings": {"sigma": 1, "k": None}}) == [
        "settings.n is {}, not left out"
    ]
