"""Hypothesis strategies made from message types: a new definition is tested without another line.

`bodies` are JSON bodies as friendly clients send them, `odd_bodies` add what is tolerated, `broken_texts` are bodies
that something has happened to. `values` are the structs that bodies stand for; in `wild_values` some numbers are none.
"""

from __future__ import annotations

import base64
import json
import math
from functools import cache
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from rosbridge_sim.schema.definitions.dialect import Dialect
from rosbridge_sim.schema.definitions.message_spec import FieldSpec, MessageSpec
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.definitions.parse import INT_RANGES
from rosbridge_sim.schema.message_type import MessageType
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
    "wild_values",
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
def shared_store(ros: Generation = 1) -> Store:
    """A store of all committed definitions, for tests that only read it: the older release with ROS 1."""
    return Store(read_texts("22.R2" if ros == 1 else "26.R1"), ros=ros)


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

MIXED_TEXTS = {("p", "msg", "Mixed"): MIXED, ("p", "msg", "MixedPart"): "Header header\nfloat32 x 0.1\n"}


@cache
def all_types(ros: Generation) -> tuple[MessageType, ...]:
    """Every message type, and every part of a service or an action, that a store knows; and one of rare fields."""
    store = Store({**read_texts("22.R2" if ros == 1 else "26.R1"), **MIXED_TEXTS}, ros=ros)
    types = [store.message(name) for name in store.names("msg")]
    for service in map(store.service, store.names("srv")):
        types += [service.request, service.response]
    for action in map(store.action, store.names("action")):
        types += [action.goal, action.result, action.feedback]
    return tuple(types)


def every_type() -> st.SearchStrategy[MessageType]:
    """Any of `all_types` of either generation."""
    return st.sampled_from((*all_types(1), *all_types(2)))


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
    return _body(message_type.spec, _PLAIN)


def odd_bodies(message_type: MessageType) -> st.SearchStrategy[Body]:
    """Bodies that are accepted though they are not as the wire wants them."""
    return _body(message_type.spec, _ODD)


def values(message_type: MessageType) -> st.SearchStrategy[Any]:
    """Checked and filled values."""
    return bodies(message_type).map(lambda body: message_type.check(body, STAMP_NS))


def wild_values(message_type: MessageType) -> st.SearchStrategy[Any]:
    """The same, NaN and infinities among them."""
    return _body(message_type.spec, _WILD).map(lambda body: message_type.check(body, STAMP_NS))


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


_PLAIN, _ODD, _WILD = range(3)
"""As the wire wants it; as it is tolerated; as the wire wants it, with floats that are no numbers."""


def _body(spec: MessageSpec, how: int) -> st.SearchStrategy[Body]:
    fields = {name: _field(field_spec, spec.dialect, how) for name, field_spec in spec.fields.items()}
    return st.fixed_dictionaries({}, optional=fields)


def _field(field_spec: FieldSpec, dialect: Dialect, how: int) -> st.SearchStrategy[Any]:
    element = _element(field_spec, dialect, how)
    field = field_spec.definition
    if field.array is None:
        return element | st.none() if how == _ODD else element
    low = 0 if field.array == 0 or field.is_bounded else field.array
    high = field.array or 3
    if field.is_bytes:
        high = max(low, min(high, 20))
        as_text = st.binary(min_size=low, max_size=high).map(lambda data: base64.b64encode(data).decode())
        as_list = st.binary(min_size=low, max_size=high).map(list)
        return st.one_of(as_text, as_list, st.none()) if how == _ODD else as_text
    high = min(high, low + 3)
    listed = st.lists(element | st.none() if how == _ODD else element, min_size=low, max_size=high)
    return listed | st.none() if how == _ODD else listed


def _element(field_spec: FieldSpec, dialect: Dialect, how: int) -> st.SearchStrategy[Any]:
    kind = field_spec.definition.type
    if field_spec.nested is not None:
        return _body(field_spec.nested, how)
    if kind in dialect.ints:
        low, high = dialect.ints[kind]
        whole = st.integers(low, high)
        as_float = st.integers(max(low, -(2**53)), min(high, 2**53)).map(float)
        return whole | as_float if how == _ODD else whole
    if kind in dialect.times:
        return _time(kind, dialect, how)
    if kind in {"float32", "float64"}:
        floats = _FLOATS32 if kind == "float32" else _FLOATS
        return floats | st.sampled_from([math.nan, math.inf, -math.inf]) if how == _WILD else floats
    if kind in {"string", "wstring"}:
        most = field_spec.definition.max_chars
        return st.text(_CHARS, max_size=12 if most is None else most)
    return st.booleans()


def _time(kind: str, dialect: Dialect, how: int) -> st.SearchStrategy[Any]:
    names = dialect.times[kind].__struct_fields__
    first, second = (st.integers(*INT_RANGES[part]) for part in dialect.time_parts[kind])
    plain: st.SearchStrategy[Any] = st.fixed_dictionaries({}, optional=dict(zip(names, (first, second), strict=True)))
    if how != _ODD:
        return plain
    others = {1: ("sec", "nanosec"), 2: ("secs", "nsecs")}[dialect.ros]
    given = {others[0]: first, others[1]: second.map(float), "zone": st.none()}
    other = st.fixed_dictionaries({}, optional=given)
    return st.one_of(plain, other, st.just("now")) if kind == "time" else plain | other
