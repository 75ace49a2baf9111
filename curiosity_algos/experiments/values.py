"""Whether values that were written as text are what a constructor's signature asks for."""

from __future__ import annotations

from numbers import Integral, Real

KINDS: dict[str, tuple[type, str]] = {
    "None": (type(None), "None"),
    "bool": (bool, "True or False"),
    "dict[str, Any]": (dict, "keywords with their values"),
    "float": (Real, "a number"),
    "int": (Integral, "a whole number"),
    "str": (str, "text"),
}
"""Annotation: what it takes, and in words."""


def check_value(name: str, value: object, annotation: str) -> None:
    """Raise ValueError unless a value is of a kind that an annotation names.

    Of annotations with other kinds, such as `int | tuple[int, str]`, only text where none is asked
    for is known to be wrong; what else they take the constructor checks.
    """
    asked = annotation.split(" | ")
    known = [KINDS[kind] for kind in asked if kind in KINDS]
    if len(known) < len(asked) and not isinstance(value, str):
        return
    # Python counts True as 1.
    kinds = [kind for kind, _ in known if kind is bool or not isinstance(value, bool)]
    if not isinstance(value, tuple(kinds)):
        words = " or ".join(word for _, word in known)
        raise ValueError(f"`{name}` must be {words}, got {value!r}.")
