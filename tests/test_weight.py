"""The weight of JSON texts: never too low, and exact for texts with brackets."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim import weight as weight_module
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.weight import FULL, LIGHT, Weight, weigh, weigh_exactly

texts = st.text(alphabet='a\\"{[,:é\n') | st.text()
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | texts,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(texts, inner, max_size=4),
    max_leaves=20,
)


def count(value: object) -> Weight:
    """What there is in a value, counted one by one: the slow judge."""
    if isinstance(value, str):
        return Weight(0, 1, 0)
    if isinstance(value, list):
        inner = list(map(count, value))
        return plus(Weight(1, 0, max(0, len(value) - 1)), *inner)
    if isinstance(value, dict):
        inner = list(map(count, value.values()))
        return plus(Weight(1, len(value), max(0, len(value) - 1)), *inner)
    return Weight(0, 0, 0)


def plus(*weights: Weight) -> Weight:
    return Weight(
        sum(one.containers for one in weights), sum(one.texts for one in weights), sum(one.commas for one in weights)
    )


def exactly(text: bytes) -> Weight:
    *_, last = weigh_exactly(text)
    return last


@given(json_values, st.integers(1, 30), st.booleans())
def test_exact_weight_is_the_same_for_any_slice_length(value: Any, size: int, is_ascii: bool) -> None:  # noqa: ANN401, FBT001
    text = json.dumps(value, ensure_ascii=is_ascii).encode()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(weight_module, "_SLICE", size)
        assert exactly(text) == count(value)


@given(json_values)
def test_quick_weight_is_never_below_the_exact_one(value: JsonValue) -> None:
    quick, exact = weigh(json.dumps(value).encode()), count(value)
    assert quick.containers >= exact.containers
    assert quick.texts >= exact.texts
    assert quick.commas >= exact.commas


@given(st.binary(max_size=100))
def test_any_bytes_have_a_weight(data: bytes) -> None:
    assert exactly(data).containers <= weigh(data).containers


def test_error_beyond_the_limit_names_the_limit() -> None:
    assert FULL.excess(Weight(0, 0, 0)) is None
    assert LIGHT.excess(Weight(15_001, 0, 0)) == "at most 15,000 objects and lists are accepted, and it has 15,001"
    assert LIGHT.excess(Weight(0, 60_001, 0)) == "at most 60,000 texts are accepted, and it has 60,001"
    assert FULL.excess(Weight(0, 0, 4_500_001)) == "at most 4,500,000 values are accepted, and it has 4,500,001"


@pytest.mark.parametrize(
    "number", ["1e308", "-1E+308", "2.5e-310", "1e0308", "0." + "0" * 307 + "5", "9" * 400, "1" + "0" * 90 + "e199"]
)
@pytest.mark.parametrize("size", [pytest.param(251, marks=pytest.mark.long), 2_003, 2**18])
def test_numbers_at_the_edge_of_float64_are_heavy(number: str, size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(weight_module, "_SLICE", size)
    text = ("[" + ",".join([number] * 2_100) + "]").encode()
    assert FULL.excess(weigh(text)) is not None
    assert FULL.excess(exactly(text)) is not None
    assert FULL.excess(exactly(b'"' + text + b'"')) is None


@pytest.mark.parametrize("number", ["3.4028235e+38", "1.5e-005", "0.12345678901234567", "-1e-100", "1e199", "9" * 30])
def test_numbers_that_honest_clients_write_are_light(number: str) -> None:
    assert FULL.excess(weigh(("[" + ",".join([number] * 10_000) + "]").encode())) is None
