"""Messages: each encoding is made once."""

from __future__ import annotations

import pytest

from rosbridge_sim.errors import EncodingError
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.opaque_types import OpaqueType
from tests.schema.strategies import shared_store


def test_a_message_is_encoded_once() -> None:
    message_type = shared_store().message("std_msgs/String")
    message = Message(message_type, message_type.struct_type(data="x"))
    assert message.json == b'{"data":"x"}'
    assert message.json is message.json
    assert message.framed(b'{"msg":') == b'{"msg":{"data":"x"}}'
    assert message.framed(b'{"msg":') is message.framed(b'{"msg":')
    assert message.framed(b'{"m":') == b'{"m":{"data":"x"}}'
    assert Message(OpaqueType("who/Knows"), {"a": 1}).json == b'{"a":1}'


def test_unencodable_message_is_not_encoded_again() -> None:
    message_type = shared_store().message("std_msgs/String")
    message = Message(message_type, message_type.struct_type(data=object()))
    for _ in range(2):
        with pytest.raises(EncodingError, match="std_msgs/String: cannot be written as JSON: TypeError") as caught:
            _ = message.json
        assert isinstance(caught.value.__cause__, TypeError)
        message.value.data = "whole"
    assert message.cbor.endswith(b"whole")
    with pytest.raises(EncodingError, match="std_msgs/String: cannot be written: ZeroDivisionError"):
        message.shared("a form", lambda: 1 // 0)
