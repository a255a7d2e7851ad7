"""JSON, JSON with words, CBOR, ROS 1 bytes and CDR agree for every value of every type."""

from __future__ import annotations

import json
from functools import cache

import cbor2
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import FieldError
from rosbridge_sim.schema.cbor import encode_plain
from rosbridge_sim.schema.definitions.message_spec import MessageSpec
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.ros_reading import RosReaders
from tests.schema.reference_readers import Rosbags, alike, as_json, plain, read_cbor
from tests.schema.strategies import STAMP_NS, all_types, every_type, wild_values


@cache
def rosbags(ros: Generation) -> Rosbags:
    return Rosbags(ros)


READERS = RosReaders()


def has_wide(spec: MessageSpec) -> bool:
    """Whether there is a wstring in a type: the one thing without agreed bytes."""
    inner = any(field_spec.nested is not None and has_wide(field_spec.nested) for field_spec in spec.fields.values())
    return inner or any(field_spec.definition.type == "wstring" for field_spec in spec.fields.values())


def check_encodings(message_type: MessageType, value: object) -> None:
    spec = message_type.spec
    expected = plain(spec, value)
    text = message_type.encode_json(value)
    assert json.loads(text) == as_json(expected)
    words = message_type.encode_with_words(value, text)
    assert alike(json.loads(words), as_json(expected, has_words=True))
    assert alike(read_cbor(message_type.encode_cbor(value)), expected)
    if spec.dialect.ros != 1 and has_wide(spec):
        with pytest.raises(FieldError, match="wstring"):
            message_type.encode_raw(value)
    else:
        raw = message_type.encode_raw(value)
        assert alike(rosbags(spec.dialect.ros).read(spec, raw), expected)
        if spec.dialect.ros == 1:
            assert alike(plain(spec, READERS.read(spec, raw)), expected)


@pytest.mark.slow
@given(st.data())
def test_all_encodings_of_a_value_agree(data: st.DataObject) -> None:
    message_type = data.draw(every_type())
    check_encodings(message_type, data.draw(wild_values(message_type)))


@pytest.mark.slow
@pytest.mark.parametrize("ros", [1, 2])
def test_default_values_pass_all_encodings(ros: Generation) -> None:
    # rosbags takes 10 ms to learn a type: those of the world, and a few of each kind of all others
    types = [t for i, t in enumerate(all_types(ros)) if i % 12 == 0 or t.name.startswith(("morai_msgs/Ego", "p/"))]
    assert len(types) > 50
    for message_type in types:
        check_encodings(message_type, message_type.default())


@pytest.mark.parametrize("ros", [1, 2])
def test_every_type_can_be_encoded(ros: Generation) -> None:
    for message_type in all_types(ros):
        value = message_type.default()
        assert message_type.encode_cbor(value)[:1] >= b"\xa0"
        if ros == 1 or not has_wide(message_type.spec):
            assert message_type.encode_raw(value).startswith(b"" if ros == 1 else b"\0\1\0\0")


@pytest.mark.slow
@given(st.data())
def test_cbor_output_is_accepted_as_input(data: st.DataObject) -> None:
    message_type = data.draw(every_type())
    value = data.draw(wild_values(message_type))
    again = message_type.check(read_cbor(message_type.encode_cbor(value)), STAMP_NS)
    assert repr(again) == repr(value)


@given(
    st.lists(st.integers(-(2**63), 2**63 - 1), min_size=64, max_size=80)
    | st.lists(st.integers(-300, 300), min_size=64, max_size=80)
    | st.lists(st.integers(0, 2**64 - 1), min_size=64, max_size=80)
    | st.lists(st.floats(allow_nan=False), min_size=64, max_size=80)
    | st.lists(st.floats(allow_nan=False) | st.integers(-5, 5) | st.booleans(), min_size=64, max_size=80)
)
def test_long_number_lists_of_unknown_types_are_equal_in_cbor(values: list[float]) -> None:
    decoded = cbor2.loads(encode_plain({"data": values}))["data"]
    assert decoded == values
    assert list(map(type, decoded)) == list(map(type, values))
