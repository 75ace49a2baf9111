import json

import pytest

from curiosity_algos.common.origin import is_foreign, message_of
from curiosity_gym.validation import check_positive


class TheirError(ValueError):
    """Of a class that this package does not know."""


def caught(call):
    with pytest.raises(Exception) as raised:  # noqa: PT011
        call()
    error = raised.value
    return error.with_traceback(error.__traceback__.tb_next.tb_next)  # without the frames of here


def test_it_goes_by_calls_classes_and_causes():
    def ask():
        check_positive(interval=0)

    assert not is_foreign(caught(lambda: check_positive(interval=0)))
    assert not is_foreign(caught(lambda: json.loads("{")))
    assert is_foreign(caught(lambda: ask()))
    assert is_foreign(TheirError("in another process"))
    wrapped = ValueError("`run` must be")
    wrapped.__cause__ = caught(lambda: ask())
    assert is_foreign(wrapped)


def test_notes_are_part_of_what_is_said():
    error = OSError("disk full")
    assert message_of(error) == "disk full"
    error.add_note("traceback in a.txt")
    assert message_of(error) == "disk full (traceback in a.txt)"
