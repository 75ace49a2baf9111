import math

import pytest

from curiosity_algos.experiments.report import numbers
from curiosity_algos.experiments.statistics import Interval


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"),
        (12.34, "12.3"),
        (999.4, "999"),
        (999.9, "1k"),
        (6047568, "6.05M"),
        (30_000_000, "30M"),
        (999_900, "1M"),
        (2.5e9, "2.5G"),
        (None, "\N{EN DASH}"),
        (math.nan, "\N{EN DASH}"),
    ],
)
def test_short(value, text):
    assert numbers.short(value) == text


def test_numbers_have_separators_and_units():
    assert [numbers.counted(n, "run") for n in (1, 2000)] == ["1 run", "2,000 runs"]
    assert numbers.whole(1234567.4) == "1,234,567"
    shares = {0.1234: "12.3", 1.0: "100.0", 0.0: "0.0", 0.005: "0.5", 0.000123: "0.012"}
    for share, text in shares.items():
        assert numbers.percent(share) == f"{text}\N{NO-BREAK SPACE}%"
    assert numbers.score(0.21649) == "0.216"
    assert numbers.score(12345.6) == "12,346"


def test_an_interval_of_one_run_is_its_estimate():
    assert numbers.interval(Interval(0.5, 0.25, 0.75), numbers.score) == "0.500 (0.250 to 0.750)"
    assert numbers.interval(Interval(0.5, math.nan, math.nan), numbers.score) == "0.500"
