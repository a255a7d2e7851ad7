"""Limits of requests, for bodies as JSON text and as values from CBOR."""

from __future__ import annotations

import json

import numpy as np
import pytest

from rosbridge_sim.errors import FieldError, Reason
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.protocol.body_limits import MAX_ESCAPES, BodyLimits

LIMITS = BodyLimits(num_bytes=50_000, containers=2_000, texts=1_000, values=3_000)


@pytest.mark.parametrize(
    ("body", "why"),
    [
        ({"a": "x" * 50_001}, "50,000 bytes"),
        ({"a": [{}] * 2_000}, "2,000 objects and lists"),
        ({"a": ["xy"] * 1_000}, "1,000 texts"),
        ({"a": [1] * 3_002}, "3,000 values"),
        ([[[]] * 2_001], "2,000 objects and lists"),
    ],
)
def test_body_beyond_a_limit_is_refused_as_json_and_as_values(body: JsonValue, why: str) -> None:
    for form in (json.dumps(body).encode(), body):
        with pytest.raises(FieldError, match=f"^/s: expected a request of at most {why}") as caught:
            LIMITS.check("/s", form)
        assert caught.value.reason is Reason.TOO_MUCH


@pytest.mark.parametrize("body", [{}, {"a": "x" * 49_000}, {"a": [{}] * 998}, {"a": ["xy"] * 998}, [1] * 1_999])
def test_body_within_the_limits_is_accepted(body: JsonValue) -> None:
    for form in (json.dumps(body).encode(), body):
        LIMITS.check("/s", form)


def test_brackets_and_quotes_within_a_text_do_not_count() -> None:
    LIMITS.check("/s", json.dumps({"add": json.dumps([["x"]] * 2_000)}).encode())


def test_typed_array_counts_by_its_numbers() -> None:
    with pytest.raises(FieldError, match="3,000 values"):
        LIMITS.check("/s", {"a": np.zeros(3_001)})


def test_long_text_of_escapes_is_refused() -> None:
    with pytest.raises(FieldError, match="100,000 escapes"):
        BodyLimits(num_bytes=2**30).check("/s", json.dumps({"a": "é" * (MAX_ESCAPES + 1)}).encode())


def test_body_that_is_missing_or_no_object_is_left_to_the_decoder() -> None:
    for body in (None, 1, "x"):
        LIMITS.check("/s", body)
