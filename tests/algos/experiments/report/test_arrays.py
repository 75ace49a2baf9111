import base64

import numpy as np
import pytest

from curiosity_algos.experiments.report.arrays import NO_VALUE, evenly, pack, quantize


def unpack(packed):
    return np.frombuffer(base64.b64decode(packed["data"]), dtype=f"<{packed['kind']}")


@pytest.mark.parametrize("kind", ["u2", "u4", "f4"])
def test_what_is_packed_is_there(kind):
    values = [0, 1, 65535]
    assert unpack(pack(values, kind)).tolist() == values


def test_quantized_numbers_are_near():
    packed = quantize([-3.0, 0.1, 7.0, np.nan, 99.0], -3.0, 7.0)
    steps = unpack(packed)
    assert steps[[0, 2, 3, 4]].tolist() == [0, NO_VALUE - 1, NO_VALUE, NO_VALUE - 1]
    back = packed["low"] + steps[1] * packed["width"] / (NO_VALUE - 1)
    assert back == pytest.approx(0.1, abs=10.0 / NO_VALUE)


def test_equal_numbers_can_be_quantized():
    assert unpack(quantize([2.0, 2.0], 2.0, 2.0)).tolist() == [0, 0]


def test_evenly():
    assert evenly(3, 5).tolist() == [0, 1, 2]
    assert evenly(101, 3).tolist() == [0, 50, 100]
    assert evenly(0, 5).tolist() == []
