"""Types of unknown packages: any JSON object passes."""

from __future__ import annotations

import msgspec
import pytest

from rosbridge_sim.errors import FieldError
from rosbridge_sim.schema.opaque_types import OpaqueType


def test_an_opaque_type_passes_any_object() -> None:
    t = OpaqueType("who/Knows")
    for text in (b'{"a":[1,{"b":null}],"c":"x"}', b"{}"):
        assert t.encode_json(t.decode_json(text, 0)) == text
        assert t.encode_json(t.decode_json(msgspec.Raw(text), 0)) == text
    assert t.encode_json(t.decode_json(b'{"a": NaN}', 0)) == b'{"a":null}'
    assert t.check({"a": 1}, 0) == {"a": 1}
    assert t.default() == {}


@pytest.mark.parametrize("text", [b"[]", b"1", b"", b"{", b'{"a":"\\ud800"}', b'{"a":"\xff"}'])
def test_opaque_type_refuses_other_values_than_objects(text: bytes) -> None:
    with pytest.raises(FieldError):
        OpaqueType("who/Knows").decode_json(text, 0)


@pytest.mark.parametrize("depth", [200, 253, 254, 255, 500, 2_000, 200_000])
def test_opaque_type_can_encode_every_accepted_value(depth: int) -> None:
    t = OpaqueType("who/Knows")
    text = b'{"a":' + b"[" * depth + b"]" * depth + b"}"
    try:
        value = t.decode_json(text, 0)
    except FieldError:
        assert depth >= 250
    else:
        assert t.encode_json(value) == text
