"""Rounding to float32."""

from __future__ import annotations

import math

import numpy as np
import orjson
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.schema.float32 import round32, round32_list
from tests.schema.type_factory import decode, make


def test_float32_is_sent_as_its_shortest_decimal() -> None:
    t = make("float32 a\nfloat32[] b\nfloat32[] c")
    body = {
        "a": 0.30000001192092896,
        "b": [0.1, 0.30000001192092896, 1 / 3, 16777217.0, -0.0, 3.4028234663852886e38],
        "c": [1 / 3],
    }
    value = decode(t, body)
    assert value.a == 0.3
    assert value.b == [0.1, 0.3, 0.33333334, 16777216.0, 0.0, 3.4028235e38]
    assert value.c == [0.33333334]
    assert t.check(body, 0) == value


@pytest.mark.parametrize(
    "value", [0.1, 0.5, 1 / 3, 1e-45, 1.23456789e-40, 1.1754944e-38, 16777217.0, 123456789.0, 3.4028235e38]
)
def test_round32_equals_the_float32_output_of_orjson(value: float) -> None:
    expected = orjson.loads(orjson.dumps(np.array([value, -value], np.float32), option=orjson.OPT_SERIALIZE_NUMPY))
    assert [round32(value), round32(-value)] == expected
    assert round32_list([value, -value] * 3) == expected * 3


@given(st.floats(width=32) | st.floats(-3.4e38, 3.4e38) | st.decimals(-1000, 1000, places=3).map(float))
def test_round32_keeps_the_float32_and_is_idempotent(value: float) -> None:
    rounded = round32(value)
    assert np.float32(rounded) == np.float32(value) or math.isnan(value)
    assert repr(round32(rounded)) == repr(rounded)
    if math.isfinite(value):
        assert round32_list([value] * 5) == [rounded] * 5 == [orjson.loads(str(rounded))] * 5


@pytest.mark.parametrize("value", [3.4028235677973366e38, 1e39, -1e300])
def test_value_beyond_float32_is_refused(value: float) -> None:
    with pytest.raises(OverflowError):
        round32(value)
    with pytest.raises(OverflowError):
        round32_list([0.0, 0.0, value])
