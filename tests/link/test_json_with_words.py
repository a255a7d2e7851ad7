"""JSON text with the words for NaN and infinity."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.link.json_with_words import to_json


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ({"x": math.inf, "y": None}, '{"x":Infinity,"y":null}'),
        ([-math.inf, 1.5, (math.nan, "null")], '[-Infinity,1.5,[NaN,"null"]]'),
        ({"x": np.array([[0.1, np.inf], [1, 2]], np.float32)}, '{"x":[[0.1,Infinity],[1.0,2.0]]}'),
        (np.float32(-math.inf), "-Infinity"),
        ({"x": np.array([1, 2]), "y": None}, '{"x":[1,2],"y":null}'),
    ],
)
def test_numbers_that_are_not_finite_are_sent_as_words(value: object, text: str) -> None:
    assert to_json(value).decode() == text
