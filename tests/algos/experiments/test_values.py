import inspect

import pytest

import curiosity_algos
from curiosity_algos.experiments.names import ALGORITHMS
from curiosity_algos.experiments.values import check_value


def test_what_fits_passes():
    for value, annotation in [
        (0.5, "float"),
        (1, "float"),
        (3, "int | None"),
        (None, "int | None"),
        (True, "bool"),
        ("icm", "str | Bonus"),
        ("cpu", "th.device | str"),
        ({}, "dict[str, Any] | None"),
        ([1, 2], "int | Sequence[int]"),
        ((1, "episode"), "int | tuple[int, str]"),
    ]:
        check_value("name", value, annotation)


@pytest.mark.parametrize(
    ("value", "annotation", "words"),
    [
        (True, "float", "a number, got True"),
        (1.5, "int", "a whole number, got 1.5"),
        (1, "bool", "True or False, got 1"),
        ("x", "int | None", "a whole number or None, got 'x'"),
        ([1], "dict[str, Any] | None", "keywords with their values or None"),
        ("all", "int | Sequence[int]", "a whole number, got 'all'"),
        (3, "str", "text, got 3"),
    ],
)
def test_what_does_not_is_one_sentence(value, annotation, words):
    with pytest.raises(ValueError, match=f"^`name` must be {words}"):
        check_value("name", value, annotation)


def test_every_default_fits():
    for algorithm in ALGORITHMS:
        parameters = inspect.signature(getattr(curiosity_algos, algorithm)).parameters
        for name, parameter in parameters.items():
            if parameter.default is not inspect.Parameter.empty:
                check_value(name, parameter.default, str(parameter.annotation))
