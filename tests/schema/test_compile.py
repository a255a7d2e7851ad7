"""Compiled types: encoding, and the fast decoder against the slow rules."""

from __future__ import annotations

import base64
import json
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import FieldError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.json_text import parse_json
from rosbridge_sim.schema.message_type import REFUSALS, MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType
from tests.schema.strategies import STAMP_NS, bodies, broken_texts, every_type, odd_bodies, values
from tests.schema.type_factory import make
from tests.support import ROOT

# Encoding


def test_numpy_values_are_encoded() -> None:
    t = make("float64 f\nint32 i\nfloat32[] a\nuint8[] d\nfloat64[] m\nint32[] n")
    value = t.struct_type(
        f=np.float64(0.5),
        i=np.int32(3),
        a=np.array([0.1, np.nan], np.float32),
        d=np.array([104, 105], np.uint8),
        m=np.eye(2)[:, 0],
        n=np.arange(3, dtype=np.int32)[::-1],
    )
    expected = b'{"f":0.5,"i":3,"a":[0.1,null],"d":"aGk=","m":[1.0,0.0],"n":[2,1,0]}'
    assert t.encode_json(value) == expected
    with pytest.raises(TypeError, match="no value of a field"):
        t.encode_json(t.struct_type(f=object()))


@pytest.mark.parametrize("size", [0, 1, 2047, 2048, 2049, 2050, 100_000])
def test_bytes_of_any_length_are_written_as_base64(size: int) -> None:
    t = make("uint8[] a\nstring s\nuint8[] b")
    content = bytes(i * 7 % 256 for i in range(size))
    value = t.struct_type(a=content, s="x", b=b"b")
    text = t.encode_json(value)
    assert json.loads(text) == {"a": base64.b64encode(content).decode(), "s": "x", "b": "Yg=="}
    assert b"".join(t.encode_json_parts(value)) == text
    assert value == t.struct_type(a=content, s="x", b=b"b"), "it stays as it was"


# Fast against slow


def read_fast(message_type: MessageType, text: bytes) -> Struct:
    """What the fast way makes of a text by itself; None where it leaves it to the slow one."""
    try:
        value = message_type._decode(text)
        if message_type.spec.finalize is not None:
            message_type.spec.finalize(value, STAMP_NS)
    except REFUSALS:
        return None
    return value


def read_slowly(message_type: MessageType, text: bytes) -> Struct:
    return message_type.check(parse_json(message_type.name, text, ValueError()), STAMP_NS)


def same(message_type: MessageType, a: object, b: object) -> bool:
    """Whether two values are alike to the last bit, types included; their text shows -0.0 and 1.0 against 1."""
    return message_type.encode_json(a) == message_type.encode_json(b) and repr(a) == repr(b)


@pytest.mark.slow
@given(st.data())
def test_plain_bodies_take_the_fast_path_with_equal_results(data: st.DataObject) -> None:
    message_type = data.draw(every_type())
    text = json.dumps(data.draw(bodies(message_type))).encode()
    value = read_fast(message_type, text)
    assert value is not None
    assert same(message_type, value, read_slowly(message_type, text))


@pytest.mark.slow
@given(st.data())
def test_odd_bodies_give_equal_results_on_both_paths(data: st.DataObject) -> None:
    message_type = data.draw(every_type())
    text = json.dumps(data.draw(odd_bodies(message_type))).encode()
    slow = read_slowly(message_type, text)
    fast = read_fast(message_type, text)
    assert fast is None or same(message_type, fast, slow)
    assert same(message_type, message_type.decode_json(text, STAMP_NS), slow)


@pytest.mark.slow
@given(st.data())
def test_fast_path_accepts_nothing_that_the_slow_path_refuses(data: st.DataObject) -> None:
    message_type = data.draw(every_type())
    text = data.draw(broken_texts(message_type))
    fast = read_fast(message_type, text)
    try:
        slow = read_slowly(message_type, text)
    except FieldError:
        assert fast is None
        with pytest.raises(FieldError):
            message_type.decode_json(text, STAMP_NS)
    else:
        assert fast is None or same(message_type, fast, slow)
        assert message_type.encode_json(slow)


@pytest.mark.slow
@given(st.data())
def test_decoding_after_encoding_gives_the_value_back(data: st.DataObject) -> None:
    message_type = data.draw(every_type())
    value = data.draw(values(message_type))
    assert same(message_type, message_type.decode_json(message_type.encode_json(value), 0), value)


_KEYS = st.text() | st.sampled_from(["header", "stamp", "npc_list", "request", "frame"])
_LEAVES = st.none() | st.booleans() | st.integers() | st.floats() | st.text()
_OBJECTS = st.recursive(_LEAVES, lambda inner: st.lists(inner) | st.dictionaries(_KEYS, inner))


@pytest.mark.slow
@given(_OBJECTS, every_type())
def test_any_objects_give_a_value_or_a_field_error(body: object, message_type: MessageType) -> None:
    try:
        value = message_type.check(body, 0)
    except FieldError as error:
        text = str(error).encode()
    else:
        text = message_type.encode_json(value)
    assert text


@given(st.binary(), every_type())
def test_any_bytes_give_a_value_or_a_field_error(body: bytes, message_type: MessageType) -> None:
    for t in (message_type, OpaqueType("p/T")):
        try:
            text = t.encode_json(t.decode_json(body, 0))
        except FieldError as error:
            text = str(error).encode()
        assert text


# Names


def test_types_show_their_names() -> None:
    assert repr(OpaqueType("who/Knows")) == "OpaqueType(who/Knows)"
    assert repr(make("int32 i")) == "MessageType(p/T)"


# A text without the memory for it


STARVED = """
import resource
from pathlib import Path
from rosbridge_sim.errors import FieldError
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.schema.store import Store

string = Store(read_definitions("22.R2")).message("std_msgs/String")
body = b'{"data":"%s"}' % (b"x" * 15_000_000)
size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
for left in range(0, 40, 2):
    resource.setrlimit(resource.RLIMIT_AS, (size + left * 2**20, -1))
    try:
        print(len(string.decode_json(body, 0).data))
    except MemoryError:
        print("no memory")
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits the address space of a process")
def test_text_beyond_the_memory_is_a_memory_error() -> None:
    done = subprocess.run([sys.executable, "-c", STARVED], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    seen = done.stdout.split("\n")
    assert seen[0] == "no memory"
    assert seen[19] == "15000000"
