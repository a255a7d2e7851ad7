"""Messages grown from their types: whoever adds a definition has it tested without another line.

`bodies` are JSON bodies as friendly clients send them, `odd_bodies` add what is tolerated, `broken_texts` are bodies
that something has happened to. `values` are the structs that bodies stand for.
"""

from __future__ import annotations

import base64
import json
from functools import cache
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from rosbridge_sim.schema.check import ROS1, Shape, Slot
from rosbridge_sim.schema.compile import MessageType
from rosbridge_sim.schema.store import Store

__all__ = [
    "SCHEMAS",
    "all_types",
    "bodies",
    "broken_texts",
    "every_type",
    "odd_bodies",
    "read_texts",
    "shared_store",
    "values",
]

SCHEMAS = Path(__file__).parents[2] / "schemas"

Texts = dict[tuple[str, str, str], str]

Body = dict[str, Any]
"""A body as Python objects."""

STAMP_NS = 12_340_000_000


def read_texts(release: str = "22.R2") -> Texts:
    """Every committed definition of a release."""
    texts: Texts = {}
    for path in sorted(SCHEMAS.glob("*/**/*")):
        package, *releases, kind, _ = path.relative_to(SCHEMAS).parts if path.is_file() else ("", "", "")
        if path.suffix == f".{kind}" and releases in ([], [release]):
            texts[package, kind, path.stem] = path.read_text()
    return texts


@cache
def shared_store() -> Store:
    """A store of all committed definitions, for tests that only read it."""
    return Store(read_texts())


MIXED = """
byte b
char c
uint64 u
int64[] i
uint64[2] us
float32[3] fs
float32[<=4] fb
float64[36] covariance
uint8[4] d
char[<=3] cs
byte[] bs
string<=5[<=2] names
string greeting "hello"
int16[] steps [1, -2]
time t
duration[] spans
std_msgs/Header[2] headers
bool import
string class
MixedPart[] parts
"""
"""Whatever a field can be and no committed message has."""


@cache
def all_types() -> tuple[MessageType, ...]:
    """Every message type, and every half of a service, that is committed; and one made of rare kinds of fields."""
    texts = {**read_texts(), ("p", "msg", "Mixed"): MIXED, ("p", "msg", "MixedPart"): "Header header\nfloat32 x 0.1\n"}
    store = Store(texts)
    types = [store.message(f"{package}/{name}") for package, kind, name in texts if kind == "msg"]
    for package, kind, name in texts:
        if kind == "srv":
            service = store.service(f"{package}/{name}")
            types += [service.request, service.response]
    return tuple(types)


def every_type() -> st.SearchStrategy[MessageType]:
    """Any of `all_types`."""
    return st.sampled_from(all_types())


# Bodies

_FLOATS = st.one_of(st.floats(allow_nan=False, allow_infinity=False), st.integers(-(2**70), 2**70), st.just(-0.0))
_FLOATS32 = st.one_of(
    st.floats(width=32, allow_nan=False, allow_infinity=False),
    st.floats(-3.4e38, 3.4e38),
    st.floats(-1e-38, 1e-38),
    st.sampled_from([0.1, 0.30000001192092896, 16777217, 3.4028235e38]),
)
_CHARS = st.characters(exclude_categories=["Cs"])


def bodies(message_type: MessageType) -> st.SearchStrategy[Body]:
    """Bodies that need no kindness but defaults: some fields are missing, the others are as the wire wants them."""
    return _body(message_type.shape, is_odd=False)


def odd_bodies(message_type: MessageType) -> st.SearchStrategy[Body]:
    """Bodies that are accepted though they are not as the wire wants them."""
    return _body(message_type.shape, is_odd=True)


def values(message_type: MessageType) -> st.SearchStrategy[Any]:
    """Checked and filled values."""
    return bodies(message_type).map(lambda body: message_type.check(body, STAMP_NS))


def broken_texts(message_type: MessageType) -> st.SearchStrategy[bytes]:
    """Texts of bodies of which a piece was replaced, added or lost; some are still right."""
    return st.builds(
        _splice,
        st.builds(_to_text, odd_bodies(message_type), ensure_ascii=st.booleans()),
        st.floats(0, 1),
        st.integers(0, 12),
        st.sampled_from(_PIECES),
    )


_PIECES = [
    *(
        b"",
        b"null",
        b"true",
        b"0",
        b"-1",
        b"1.0",
        b"1e400",
        b"1e39",
        b"-0",
        b"NaN",
        b"-Infinity",
        b"18446744073709551616",
    ),
    *(
        b'""',
        b'"x"',
        b'"\\ud800"',
        b'"\xff"',
        b'"now"',
        b'"YQ=="',
        b'"YQ"',
        b"[",
        b"]",
        b"[]",
        b"{",
        b"}",
        b"{}",
        b"[[]]",
    ),
    *(b",", b":", b'"', b"\\", b"\x00", b" ", b"\n", b'"x":1,', b'"seq":null,', b"\xef\xbb\xbf", b"9" * 30, b"1" * 400),
]


def _to_text(body: Body, *, ensure_ascii: bool) -> bytes:
    return json.dumps(body, ensure_ascii=ensure_ascii).encode()


def _splice(text: bytes, where: float, lost: int, piece: bytes) -> bytes:
    at = int(where * len(text))
    return text[:at] + piece + text[at + lost :]


def _body(shape: Shape, *, is_odd: bool) -> st.SearchStrategy[Body]:
    fields = {name: _field(slot, is_odd=is_odd) for name, slot in shape.slots.items()}
    return st.fixed_dictionaries({}, optional=fields)


def _field(slot: Slot, *, is_odd: bool) -> st.SearchStrategy[Any]:
    element = _element(slot, is_odd=is_odd)
    field = slot.field
    if field.array is None:
        return element | st.none() if is_odd else element
    low = 0 if field.array == 0 or field.is_bounded else field.array
    high = field.array or 3
    if field.is_bytes:
        as_text = st.binary(min_size=low, max_size=high).map(lambda data: base64.b64encode(data).decode())
        as_list = st.binary(min_size=low, max_size=high).map(list)
        return st.one_of(as_text, as_list, st.none()) if is_odd else as_text
    high = min(high, low + 3)
    listed = st.lists(element | st.none() if is_odd else element, min_size=low, max_size=high)
    return listed | st.none() if is_odd else listed


def _element(slot: Slot, *, is_odd: bool) -> st.SearchStrategy[Any]:
    kind = slot.field.type
    if slot.shape is not None:
        return _body(slot.shape, is_odd=is_odd)
    if kind in ROS1.ints:
        low, high = ROS1.ints[kind]
        whole = st.integers(low, high)
        as_float = st.integers(max(low, -(2**53)), min(high, 2**53)).map(float)
        return whole | as_float if is_odd else whole
    if kind in {"time", "duration"}:
        return _time(kind, is_odd=is_odd)
    if kind == "float32":
        return _FLOATS32
    if kind in {"string", "wstring"}:
        most = slot.field.max_chars
        return st.text(_CHARS, max_size=12 if most is None else most)
    return st.booleans() if kind == "bool" else _FLOATS


def _time(kind: str, *, is_odd: bool) -> st.SearchStrategy[Any]:
    low, high = ROS1.ints["uint32" if kind == "time" else "int32"]
    number = st.integers(low, high)
    plain: st.SearchStrategy[Any] = st.fixed_dictionaries({}, optional={"secs": number, "nsecs": number})
    if not is_odd:
        return plain
    other = st.fixed_dictionaries({}, optional={"sec": number, "nanosec": number.map(float), "zone": st.none()})
    return st.one_of(plain, other, st.just("now")) if kind == "time" else plain | other
