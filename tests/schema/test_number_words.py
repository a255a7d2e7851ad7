"""JSON text with the words NaN and Infinity: wherever a number may stand, and nowhere else."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.schema.late_list import LateList
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType
from tests.schema.type_factory import make

INNER = "string name\nfloat32[] row\nfloat64 x\n"
TEXT = """
string name
uint8[] data
int32[] numbers
float32 small
float64[3] place
float64[<=4] few
p/Inner one
p/Inner[] many
"""


@pytest.fixture
def kind() -> MessageType:
    return make(TEXT, ros=2, Inner=INNER)


def words_of(kind: MessageType, value: object) -> str:
    return Message(kind, value).json_with_words.decode()


def test_words_stand_for_numbers_at_any_depth(kind: MessageType) -> None:
    inner: Any = kind.spec.fields["one"].nested
    value = kind.struct_type(
        small=-math.inf,
        place=[1.0, math.nan, 2.5],
        few=[math.inf],
        one=inner.struct_type(row=[math.inf, 0.5], x=math.nan),
        many=[inner.struct_type(), inner.struct_type(x=math.inf)],
    )
    read = json.loads(words_of(kind, value))
    assert (read["small"], read["few"]) == (-math.inf, [math.inf])
    assert repr(read["place"]) == "[1.0, nan, 2.5]"
    assert (read["one"]["row"], repr(read["one"]["x"])) == ([math.inf, 0.5], "nan")
    assert [one["x"] for one in read["many"]] == [0.0, math.inf]
    assert json.loads(kind.encode_json(value))["few"] == [None], "the value is as it was"


def test_arrays_of_numpy_keep_their_digits(kind: MessageType) -> None:
    inner: Any = kind.spec.fields["one"].nested
    row = np.array([0.1, np.nan, np.inf, -np.inf, 7.0, np.inf], np.float32)
    value = kind.struct_type(small=np.float32(np.inf), many=LateList(1, lambda: [inner.struct_type(row=row[::-1])]))
    text = words_of(kind, value)
    assert '"row":[Infinity,7.0,-Infinity,Infinity,NaN,0.1]' in text
    assert '"small":Infinity' in text
    assert text.replace("-Infinity", "null").replace("Infinity", "null").replace("NaN", "null").encode() == (
        kind.encode_json(value)
    )


def test_text_without_such_numbers_is_the_same_bytes(kind: MessageType) -> None:
    inner: Any = kind.spec.fields["one"].nested
    value = kind.struct_type(name="null", one=inner.struct_type(name="[null, null]", row=np.ones(3, np.float32)))
    message = Message(kind, value)
    assert message.json_with_words is message.json


def test_word_null_in_a_text_is_kept_beside_infinity(kind: MessageType) -> None:
    value = kind.struct_type(name='null "null"', small=math.inf)
    read = json.loads(words_of(kind, value))
    assert (read["name"], read["small"]) == ('null "null"', math.inf)


def test_text_with_words_is_made_once(kind: MessageType) -> None:
    message = Message(kind, kind.struct_type(small=math.nan))
    assert message.json_with_words is message.json_with_words
    assert b'"small":null' in message.json
