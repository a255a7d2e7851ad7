"""Rules of conversion: accepted, completed and refused values, with error texts.

Each body goes in as text, so that the fast way answers wherever it can; `test_compile` holds the two ways together.
"""

from __future__ import annotations

import contextlib
import json
import math
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import FieldError
from rosbridge_sim.schema.definitions.dialect import Duration, Leniency, Time, Time2
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.store import Store
from tests.schema.strategies import every_type, shared_store
from tests.schema.type_factory import decode, make, refusal

NOW = Time(12, 340_000_000)


# What passes


def test_missing_fields_have_their_defaults() -> None:
    value = decode(
        make("int32 i\nfloat64 f\nstring s\nbool b\nint8[] a\nuint8[2] d\nfloat32[2] m\ntime t\nduration u"), {}
    )
    assert (value.i, value.f, value.s, value.b, value.a, value.d, value.m) == (
        0,
        0.0,
        "",
        False,
        [],
        b"\0\0",
        [0.0, 0.0],
    )
    assert (value.t, value.u) == (Time(), Duration())


def test_defaults_of_the_text_count() -> None:
    t = make('int32 i 7\nstring s "x"\nuint8[] d [1, 2]\nfloat64[] f [0.5]\nfloat32 g 0.30000001192092896')
    for value in (decode(t, {}), decode(t, {"i": None, "s": None, "d": None, "f": None}), t.default(), t.check({}, 0)):
        assert (value.i, value.s, value.d, value.f) == (7, "x", b"\1\2", [0.5])
    assert t.default().g == 0.3


def test_default_lists_are_not_shared() -> None:
    t = make("int32[] a\nint32[2] b\nint32[] c [1]\nU[] d\nU[2] e", U="int32 x")
    first, second = t.default(), t.default()
    for name in "abcde":
        getattr(first, name).append(3)
        assert getattr(first, name) != getattr(second, name)
    assert t.default().e[0] is not t.default().e[1]


def test_null_is_nan_for_a_float_and_else_the_default() -> None:
    t = make("float64 f\nfloat32[] g\nint32 i\nint32[] a\nstring[] s\nbool[] b\ntime[] t\nU u", U="int8 x")
    floats, nulls = {"f": None, "g": [None, 1]}, {"i": None, "s": [None], "b": [None], "t": [None], "u": None}
    value = decode(t, {**floats, **nulls, "a": [None, 2]})
    assert math.isnan(value.f)
    assert math.isnan(value.g[0])
    assert (value.i, value.a, value.s, value.b, value.t, value.u.x) == (0, [0, 2], [""], [False], [Time()], 0)


@pytest.mark.parametrize("word", ["NaN", "Infinity", "-Infinity"])
def test_bare_nan_and_infinity_are_floats_and_sent_as_null(word: str) -> None:
    t = make("float64 f\nfloat32 g\nfloat32[] h")
    value = t.decode_json(f'{{"f": {word}, "g": {word}, "h": [{word}]}}'.encode(), 0)
    assert repr(value.f) == repr(value.g) == repr(value.h[0]) == repr(float(word))
    assert t.encode_json(value) == b'{"f":null,"g":null,"h":[null]}'


def test_integral_floats_are_integers() -> None:
    t = make("uint64 frame\nint8 i\nuint8[] d")
    value = decode(t, {"frame": 2.0, "i": -3e0, "d": [1.0]})
    assert (value.frame, value.i, value.d) == (2, -3, b"\1")
    assert type(value.frame) is int
    assert "got a <class 'float'>" in refusal(t, {"frame": 2.5})


def test_bytes_are_base64_or_a_list() -> None:
    t = make("uint8[] d\nchar[3] c\nint8[] n\nbyte[] b")
    for body in ({"d": "aGk=", "c": "AAEC"}, {"d": [104, 105], "c": [0, 1, 2]}, {"d": "aG\r\nk=", "c": "AAEC"}):
        value = decode(t, body)
        assert (value.d, value.c) == (b"hi", b"\0\1\2")
        assert t.encode_json(value) == b'{"d":"aGk=","c":"AAEC","n":[],"b":[]}'
    assert t.check({"d": memoryview(b"hi")}, 0).d == b"hi"
    assert decode(t, {"n": [-1], "b": [-1]}).b == [-1]


def test_char_is_unsigned_and_byte_is_signed() -> None:
    t = make("char c\nbyte b")
    value = decode(t, {"c": 255, "b": -128})
    assert (value.c, value.b) == (255, -128)
    assert "out of its range (0 to 255)" in refusal(t, {"c": -1})
    assert "out of its range (-128 to 127)" in refusal(t, {"b": 128})


@pytest.mark.parametrize(
    ("given_time", "expected"),
    [
        ({"secs": 1, "nsecs": 2}, Time(1, 2)),
        ({"sec": 1, "nanosec": 2}, Time(1, 2)),
        ({"sec": 1.0, "nsecs": 2, "zone": "x"}, Time(1, 2)),
        ({"secs": 1}, Time(1, 0)),
        ({"secs": 1, "nsecs": None}, Time(1, 0)),
        ({}, Time()),
        (None, Time()),
        ("now", NOW),
    ],
)
def test_times_come_in_either_spelling(given_time: object, expected: Time) -> None:
    assert decode(make("time t"), {"t": given_time}).t == expected


def test_durations_may_be_negative_and_do_not_accept_now() -> None:
    t = make("duration d\ntime t")
    assert decode(t, {"d": {"secs": -1, "nanosec": -5}}).d == Duration(-1, -5)
    assert refusal(t, {"d": "now"}) == "p/T message requires a duration for field d, but got a <class 'str'>"
    assert "requires a uint32 for field t.secs, but got -1" in refusal(t, {"t": {"secs": -1}})


def test_bytes_and_times_of_ros_2_have_other_ranges() -> None:
    t = make("byte b\nchar c\ntime t\nduration d", ros=2)
    value = t.check({"b": 255, "c": 255, "t": {"secs": -1}, "d": {"sec": -1, "nsecs": 2**32 - 1}}, 0)
    assert (value.b, value.c, value.t, value.d) == (255, 255, Time2(-1, 0), Time2(-1, 2**32 - 1))
    assert "out of its range (0 to 255)" in refusal(t, {"b": -1})
    assert "requires a int32 for field t.sec, but got 2147483648" in refusal(t, {"t": {"sec": 2**31}})
    assert "requires a uint32 for field d.nanosec, but got -1" in refusal(t, {"d": {"nanosec": -1}})


def test_seq_is_dropped_where_headers_have_none() -> None:
    t = make("Header header\nstd_msgs/Header[] others", ros=2)
    value = decode(t, {"header": {"seq": 3, "frame_id": "map"}, "others": [{"seq": None}]})
    assert t.encode_json(value) == (
        b'{"header":{"stamp":{"sec":12,"nanosec":340000000},"frame_id":"map"},'
        b'"others":[{"stamp":{"sec":12,"nanosec":340000000},"frame_id":""}]}'
    )
    assert refusal(make("int32 x", ros=2), {"seq": 3}) == "Message type p/T does not have a field seq; it has x"


@pytest.mark.parametrize("header", [None, {}, {"stamp": None}, {"seq": None, "stamp": None, "frame_id": ""}, ...])
def test_header_without_a_stamp_gets_the_present_time(header: object) -> None:
    t = make("Header header\nint32 x")
    assert decode(t, {} if header is ... else {"header": header}).header.stamp == NOW


@pytest.mark.parametrize("stamp", [{"secs": 0, "nsecs": 0}, {}, {"secs": 5, "nsecs": 6}, {"sec": 5, "nanosec": 6}])
def test_a_stamp_that_is_given_is_kept(stamp: dict[str, int]) -> None:
    value = decode(make("Header header"), {"header": {"stamp": stamp, "frame_id": "map"}})
    assert value.header.stamp == Time(*stamp.values())
    assert value.header.frame_id == "map"


def test_headers_at_any_depth_are_stamped() -> None:
    t = make("U u\nU[] us\nU[2] two\nstd_msgs/Header[] hs", U="Header h\nV v", V="int8 x\nHeader h")
    for body in ({"us": [{}, {"v": {"x": 1}}], "hs": [{}]}, {"us": [{}, {"v": {"x": 1.0}}], "hs": [{}]}):
        value = decode(t, body)
        headers = [h for u in [value.u, *value.us, *value.two] for h in (u.h, u.v.h)] + value.hs
        assert len(headers) == 11
        assert {h.stamp for h in headers} == {NOW}


def test_message_of_type_header_is_stamped() -> None:
    assert decode(shared_store().message("std_msgs/Header"), {"seq": 3}).stamp == NOW


def test_a_default_value_has_a_stamp_of_zero() -> None:
    t = make("Header header")
    assert t.encode_json(t.default()) == b'{"header":{"seq":0,"stamp":{"secs":0,"nsecs":0},"frame_id":""}}'


def test_the_last_of_equal_keys_counts() -> None:
    t = make("int32 x\nint32 y")
    assert t.decode_json(b'{"x": 1, "x": 2}', 0).x == 2
    assert t.decode_json(b'{"x": 1, "y": 1.0, "x": 2}', 0).x == 2


def test_python_keywords_can_be_field_names() -> None:
    names = ["from", "import", "class", "None", "_x", "__init__", "__struct_fields__", "self", "from_", "f__init__"]
    t = make("".join(f"int32 {name}\n" for name in names))
    body = {name: i for i, name in enumerate(names)}
    value = decode(t, body)
    assert json.loads(t.encode_json(value)) == body
    assert value.from__ == 0
    assert json.loads(t.encode_json(t.struct_type(from__=5)))["from"] == 5
    assert decode(t, {**body, "class": 2.0}) == value


def test_an_empty_message_has_no_fields() -> None:
    t = shared_store().message("std_msgs/Empty")
    assert t.encode_json(decode(t, {})) == b"{}"


def test_bounds_of_arrays_and_texts_are_checked() -> None:
    t = make("int32[<=2] a\nstring<=3 s\nuint8[<=2] d\nU[<=1] u", U="int8 x")
    assert decode(t, {}).a == decode(t, {}).u == []
    assert decode(t, {"a": [1, 2], "s": "abc", "d": "AAE="}).d == b"\0\1"
    assert refusal(t, {"a": [1, 2, 3]}) == "p/T message requires a int32[<=2] for field a, but got 3 elements"
    assert refusal(t, {"s": "abcd"}) == "p/T message requires a string<=3 for field s, but got 4 characters"
    assert refusal(t, {"d": "AAEC"}) == "p/T message requires a uint8[<=2] for field d, but got 3 bytes"
    assert refusal(t, {"u": [{}, {}]}) == "p/T message requires a p/U[<=1] for field u, but got 2 elements"


# What is refused


OUT_OF_64 = "which is out of its range (0 to 18446744073709551615)"


@pytest.mark.parametrize(
    ("body", "text"),
    [
        ([], "Expected a JSON object for type p/T but received a <class 'list'>"),
        ("x", "Expected a JSON object for type p/T but received a <class 'str'>"),
        ({"x": 1}, "Message type p/T does not have a field x; it has i, f, b, s, u, us, m, d, t, u64, u64s"),
        ({"u": {"v": {"x": 1}}}, "Message type p/T does not have a field u.v.x; p/V has y"),
        ({"us": [{}, {"v": {"x": 1}}]}, "Message type p/T does not have a field us[1].v.x; p/V has y"),
        ({"i": "a"}, "p/T message requires a int32 for field i, but got a <class 'str'>"),
        ({"i": True}, "p/T message requires a int32 for field i, but got a <class 'bool'>"),
        ({"i": 1.5}, "p/T message requires a int32 for field i, but got a <class 'float'>"),
        ({"f": "1"}, "p/T message requires a float64 for field f, but got a <class 'str'>"),
        ({"f": False}, "p/T message requires a float64 for field f, but got a <class 'bool'>"),
        ({"b": 1}, "p/T message requires a bool for field b, but got a <class 'int'>"),
        ({"s": 1}, "p/T message requires a string for field s, but got a <class 'int'>"),
        ({"u": 1}, "p/T message requires a p/U for field u, but got a <class 'int'>"),
        ({"us": {}}, "p/T message requires a p/U[] for field us, but got a <class 'dict'>"),
        ({"us": [1]}, "p/T message requires a p/U for field us[0], but got a <class 'int'>"),
        ({"us": [{}, {"v": {"y": "a"}}]}, "p/T message requires a int8 for field us[1].v.y, but got a <class 'str'>"),
        ({"m": [1]}, "p/T message requires a float32[2] for field m, but got 1 elements"),
        ({"m": [1, "a"]}, "p/T message requires a float32 for field m[1], but got a <class 'str'>"),
        ({"d": "a"}, "p/T message requires a uint8[] for field d, but got text that is not base64"),
        ({"d": 1}, "p/T message requires a uint8[] for field d, but got a <class 'int'>"),
        ({"d": [-1]}, "p/T message requires a uint8 for field d[0], but got -1, which is out of its range (0 to 255)"),
        ({"t": 1}, "p/T message requires a time for field t, but got a <class 'int'>"),
        ({"t": {"secs": "a"}}, "p/T message requires a uint32 for field t.secs, but got a <class 'str'>"),
        ({"m": [1e39, 0]}, "p/T message requires a float32 for field m[0], but got a number that is out of its range"),
        ({"f": 10**400}, "p/T message requires a float64 for field f, but got a number that is out of its range"),
        ({"u64": 2**64}, f"p/T message requires a uint64 for field u64, but got {2**64}, {OUT_OF_64}"),
        ({"u64s": [0, 2**64]}, f"p/T message requires a uint64 for field u64s[1], but got {2**64}, {OUT_OF_64}"),
        ({"u64": 10**400}, f"p/T message requires a uint64 for field u64, but got a number of 1329 bits, {OUT_OF_64}"),
        ({"s": "\ud800"}, "p/T message requires a string for field s, but got text with half a surrogate pair"),
    ],
)  # fmt: skip
def test_value_that_does_not_fit_is_refused_with_its_path(body: object, text: str) -> None:
    t = make(
        "int32 i\nfloat64 f\nbool b\nstring s\nU u\nU[] us\nfloat32[2] m\nuint8[] d\ntime t\nuint64 u64\nuint64[] u64s",
        U="V v",
        V="int8 y",
    )
    assert refusal(t, body) == text


def test_root_name_of_error_paths_can_be_chosen() -> None:
    with pytest.raises(FieldError, match=r"^Message type other/Name does not have a field x; it has i$"):
        make("int32 i").check({"x": 1}, 0, root="other/Name")


@pytest.mark.parametrize(
    "text", [b"", b"{", b"nul", b'{"i":01}', b'{"i":1}x', b"\xef\xbb\xbf{}", b'{"s":"\xff"}', b'{"f":1e400}']
)
def test_text_that_is_not_json_is_refused(text: bytes) -> None:
    assert refusal(make("int32 i\nfloat64 f\nstring s"), text).startswith("p/T: the body is no JSON: ")


def test_utf_16_is_refused() -> None:
    assert "no JSON" in refusal(make("int32 i"), '{"i":1}'.encode("utf-16"))


@pytest.mark.parametrize("opening", [b"[", b'{"u":', b'{"u":[', b'{"i":['])
@pytest.mark.parametrize("depth", [300, 2_000, 200_000])
def test_deep_nesting_is_refused_without_a_crash(opening: bytes, depth: int) -> None:
    t = make("int32 i\nU u", U="int32 i")
    refusal(t, opening * depth)
    closing = {b"[": b"]", b'{"u":': b"}", b'{"u":[': b"]}", b'{"i":[': b"]}"}[opening]
    refusal(t, opening * depth + b"0" + closing * depth)


def test_numbers_with_thousands_of_digits_are_refused() -> None:
    refusal(make("int32 i\nuint64 u"), b'{"u":' + b"1" * 10_000 + b"}")


def test_names_from_clients_cannot_break_the_error_text() -> None:
    text = refusal(make("int32 i"), {"\ud800" + "x" * 10_000: 1})
    assert len(text) < 300
    assert text.encode()
    with pytest.raises(FieldError, match="does not have a field 5"):
        make("int32 i").check({5: 1}, 0)


# Leniency


LENIENT = Leniency(
    fields={"p/T": {"longCmdType": "type", "gone": "nowhere"}},
    scalars={"p/T": frozenset({"poses", "ids"})},
    numerals={"p/T": frozenset({"index"})},
)


def lenient(text: str) -> MessageType:
    return Store({("p", "msg", "T"): text}, leniency=LENIENT).message("p/T")


def test_documented_field_names_are_accepted_and_the_wire_name_goes_out() -> None:
    t = lenient("int32 type")
    assert t.encode_json(decode(t, {"longCmdType": 2})) == b'{"type":2}'
    assert decode(t, {"longCmdType": 2, "type": 1}).type == decode(t, {"type": 1, "longCmdType": 2}).type == 1
    assert refusal(t, {"gone": 1}) == "Message type p/T does not have a field gone; it has type"


def test_a_single_element_may_stand_for_an_array() -> None:
    t = lenient("float32[] poses\nint16[] ids\nfloat32[] others")
    assert decode(t, {"poses": 0.5, "ids": 3}).poses == [0.5]
    assert decode(t, {"poses": [0.5], "ids": 3}).ids == [3]
    assert decode(t, {"poses": None}).poses == []
    assert "requires a float32[]" in refusal(t, {"others": 0.5})
    assert "requires a int16 for field ids[0]" in refusal(t, {"ids": "x"})


@pytest.mark.parametrize(
    ("text", "number"), [("13", 13), (" -1 ", -1), ("IntTL13", 13), ("C119BS010012", 10012), (13.0, 13)]
)
def test_text_may_stand_for_an_integer(text: object, number: int) -> None:
    assert decode(lenient("int32 index"), {"index": text}).index == number


@pytest.mark.parametrize("text", ["", "IntTL", "13a", "1.5", "1 5", "Int TL-1.5", "٣", "9" * 30])
def test_text_without_a_number_at_its_end_is_refused(text: str) -> None:
    refusal(lenient("int32 index"), {"index": text})


def test_text_for_an_integer_is_refused_in_other_fields() -> None:
    assert "<class 'str'>" in refusal(lenient("int32 index\nint32 other"), {"other": "13"})


# Typed arrays


@given(
    message_type=every_type(),
    kind=st.sampled_from(["<f8", "<f4", "<f2", "u1", "i1", "<i8", "<u8"]),
    num=st.sampled_from([0, 1, 2, 5_000]),
    number=st.sampled_from([0.0, 1.0, 255.0, math.nan, math.inf, 6e4]),
)
def test_typed_array_in_any_place_is_accepted_or_refused(
    message_type: MessageType, kind: str, num: int, number: float
) -> None:
    with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"):
        array = np.full(num, number).astype(kind)
    for name in message_type.spec.fields:
        for given_value in (array, [array], {"secs": array}):
            try:
                value = message_type.check({name: given_value}, 0)
            except FieldError:
                continue
            message_type.encode_json(value)
            message_type.encode_cbor(value)
            with contextlib.suppress(FieldError):  # a wide string has no bytes in ROS 2
                message_type.encode_raw(value)


@pytest.mark.parametrize(
    ("text", "body", "advice"),
    [
        ("Req request", {"user_id": "me"}, 'user_id; wrap it in `request`: {"request": {...}}'),
        ("Req request", {"x": 1, "frame": 3}, 'x; wrap it in `request`: {"request": {...}}'),
        ("Req request", {"request": {}, "user_id": "me"}, "user_id; it has request"),
        ("Req request", {"x": 1}, "x; it has request"),
        ("Req request", {"requst": {"user_id": "me"}}, "requst (did you mean request?); it has request"),
        ("Req[] requests", {"user_id": "me"}, "user_id; it has requests"),
        ("Req request\nHead h", {"user_id": "me"}, "user_id; it has request, h"),
        ("int32 idx\nint32 status", {"trafficLightIndex": 1}, "trafficLightIndex; it has idx, status"),
        ("Req request", {"request": {"userid": 1}}, "request.userid (did you mean user_id?); p/Req has user_id, frame"),
        ("", {"x" * 10**6: 1}, "; it has no fields"),
    ],
)  # fmt: skip
def test_unknown_field_error_suggests_the_nearest_name(text: str, body: object, advice: str) -> None:
    said = refusal(make(text, Req="string user_id\nuint64 frame", Head="string a"), body)
    assert said.startswith("Message type p/T does not have a field ")
    assert said.endswith(advice)
    assert len(said) < 1_000


def test_advice_names_the_field_itself_and_not_its_alias() -> None:
    message_type = make("int32 longlCmdType")
    assert set(message_type.spec.aliases) == {"longl_cmd_type"}
    for name in ("longl_cmd_typ", "longlCmdTyp", "LonglCmdType"):
        assert " (did you mean longlCmdType?)" in refusal(message_type, {name: 2})
