"""Long lists of numbers are decoded in parts, to the values that one call would give."""

from __future__ import annotations

import json
import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import FrameError
from rosbridge_sim.protocol import json_decoding
from rosbridge_sim.protocol.json_decoding import decode_frame
from rosbridge_sim.protocol.long_lists import LONG_LIST, put_in_lists, take_out_lists
from rosbridge_sim.protocol.ops import Publish
from tests.mutations import examples
from tests.support import finish


def whole(text: bytes) -> tuple[object, int]:
    """The value of a text whose long lists are decoded by themselves, and the number of these."""
    short, lists = finish(take_out_lists(text))
    num = len(lists)
    return put_in_lists(msgspec.json.decode(short), lists), num


def plain(value: object) -> object:
    """The value with lists in place of arrays."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {name: plain(inner) for name, inner in value.items()}
    return [plain(inner) for inner in value] if isinstance(value, list) else value


INTS = [7, -12, 0, 2**62] * 3_000
FLOATS = [0.5, -1e-7, 3.0, 1e20] * 3_000


@pytest.mark.parametrize(
    ("value", "num"),
    [
        ({"data": INTS}, 1),
        ({"data": FLOATS}, 1),
        ([INTS, {"b": FLOATS, "c": "[1,2]"}, INTS, INTS[:50]], 3),
        ({"text": json.dumps(INTS), "data": INTS}, 1),
        ({"text": '\\"' + json.dumps(INTS) + '"\\', "data": INTS}, 1),
        ({"data": [*INTS, 2**64 - 1]}, 1),
        ({"data": [abs(i) for i in INTS] + [2**64 - 1] * 40_000}, 1),
        ({"data": [*INTS, None]}, 0),
        ({"data": [INTS[:100]] * 200}, 0),
        ("\0numbers:0", 0),
    ],
    ids=["ints", "floats", "some", "in a text", "quotes", "mixed", "unsigned", "null", "short", "mark"],
)
@pytest.mark.parametrize("space", ["", " \n"])
def test_value_is_that_of_one_call(value: object, num: int, space: str) -> None:
    text = json.dumps(value, separators=("," + space, ":")).encode()
    found, num_found = whole(text)
    assert num_found == num
    if num and value == {"data": [*INTS, 2**64 - 1]}:  # no integer of 64 bits has all of them
        found = {"data": [int(number) for number in plain(found)["data"]]}  # type: ignore[index] # a dict
        value = {"data": [int(float(number)) for number in [*INTS, 2**64 - 1]]}
    assert plain(found) == value


@examples(15)
@given(
    before=st.text(max_size=30),
    numbers=st.lists(st.integers(-(2**31), 2**31), min_size=1, max_size=5),
    text=st.text(alphabet='"\\[],1', max_size=20),
)
def test_lists_among_any_texts_are_found(before: str, numbers: list[int], text: str) -> None:
    value = [before, numbers * 12_000, text, {text: numbers * 12_000}, json.dumps(numbers * 12_000)]
    found, num = whole(json.dumps(value, ensure_ascii=False).encode())
    assert num == 2
    assert plain(found) == value


@pytest.mark.parametrize("bad", ["1,,2", "1 2", "01", "1.e", "--1", "+1", "1,", ",1"])
def test_wrong_list_is_refused(bad: str) -> None:
    numbers = "1," * LONG_LIST
    for text in (f"[{bad},{numbers}1]", f"[{numbers}{bad}]"):
        if bad not in {"1,", ",1"} or ",," in text or text.endswith(",]"):
            with pytest.raises((ValueError, msgspec.MsgspecError)):
                finish(take_out_lists(text.encode()))


def publish(numbers: bytes, more: bytes = b"") -> bytes:
    return b'{"op":"publish","topic":"/t","id":"it","msg":{"data":[' + numbers + b"]" + more + b"}}"


def test_op_with_many_numbers_is_decoded_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(json_decoding, "MANY_VALUES", 100_000)
    monkeypatch.setattr(json_decoding, "LONG_NUMBERS", 100_000)
    steps = list(decode_frame(publish(b"1," * 400_000 + b"5")))
    assert len(steps) > 800_000 // (32 * 1024), "others have their turn after each 32 KiB"
    op = steps[-1]
    assert isinstance(op, Publish)
    assert isinstance(op.msg, dict)
    data = op.msg["data"]
    assert (data.dtype, len(data), int(data.sum())) == (np.int64, 400_001, 400_005)
    assert [step for step in steps if step is not None] == [op]


@pytest.mark.parametrize(
    ("frame", "why"),
    [
        (publish(b"1," * 400_000 + b"5") + b'{"op":"zzz"}', "must be one plain op"),
        (publish(b"1," * 400_000), "must be one plain op"),
        (publish(b"1," * 150_000 + b"1", b',"more":[' + b"[1,2]," * 140_000 + b"3]"), "beside long lists of numbers"),
        (publish(b"null," * 400_000 + b"null"), "beside long lists of numbers"),
    ],
    ids=["two ops", "a comma too many", "many short lists", "null"],
)
def test_frame_of_many_values_that_is_not_light_is_refused(
    monkeypatch: pytest.MonkeyPatch, frame: bytes, why: str
) -> None:
    monkeypatch.setattr(json_decoding, "MANY_VALUES", 100_000)
    monkeypatch.setattr(json_decoding, "LONG_NUMBERS", 100_000)
    (error,) = (step for step in decode_frame(frame) if step is not None)
    assert isinstance(error, FrameError)
    assert why in str(error)
    assert error.op_id == "it"


def test_many_commas_in_a_text_are_no_many_values(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(json_decoding, "MANY_VALUES", 100_000)
    monkeypatch.setattr(json_decoding, "LONG_NUMBERS", 100_000)
    frame = b'{"op":"publish","topic":"/t","msg":{"data":"[' + b"1," * 400_000 + b'1]"}}'
    op = list(decode_frame(frame))[-1]
    assert isinstance(op, Publish)
    assert isinstance(op.msg, msgspec.Raw)


def test_words_that_json_lacks_are_read_in_a_step_of_their_own() -> None:
    frame = b'{"op":"publish","topic":"/t","msg":{"data":[' + b"NaN," * 10_000 + b"1]}}"
    *slices, op = decode_frame(frame)
    assert len(slices) >= 2, "one before reading, one before the op is done"
    assert slices == [None] * len(slices)
    assert isinstance(op, Publish)


def test_heavy_frame_is_weighed_in_slices() -> None:
    frame = publish(b"1," * 1_500_000 + b"1", b',"more":"' + b"e+" * 250_000 + b'"')
    assert len(list(decode_frame(frame))) > len(frame) // (256 * 1024)


WORDS = b"NaN,1.5,-Infinity,2,Infinity,"


def test_long_list_with_words_that_json_lacks_is_decoded_in_parts() -> None:
    frame = publish(WORDS * 20_000 + b"NaN") + publish(WORDS * 9_000 + b"7")
    steps = list(decode_frame(frame))
    first, second = (step for step in steps if step is not None)
    assert len(steps) > len(frame) // (32 * 1024), "others have their turn after each 32 KiB"
    for op, num in ((first, 20_000), (second, 9_000)):
        assert isinstance(op, Publish)
        assert isinstance(op.msg, dict)
        expected = [math.nan, 1.5, -math.inf, 2.0, math.inf] * num + [math.nan if op is first else 7.0]
        np.testing.assert_array_equal(op.msg["data"], expected)


@pytest.mark.parametrize("bad", ["NaN NaN", "NaNN", "Infinite", "--Infinity", "NaN,"])
def test_mistake_in_a_long_list_with_words_is_told(bad: str) -> None:
    *_, error = decode_frame(publish(WORDS * 10_000 + bad.encode()))
    assert isinstance(error, FrameError)
    assert "is not valid JSON" in str(error)
    assert error.op_id == "it"


def test_deep_nesting_beside_a_long_list_with_words_is_told() -> None:
    *_, error = decode_frame(publish(WORDS * 10_000 + b"1", b',"deep":' + b"[" * 3_000 + b"]" * 3_000))
    assert isinstance(error, FrameError)
    assert "nested too deeply" in str(error)
