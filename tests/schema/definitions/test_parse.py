"""The grammar of definitions: every kind of line, and errors with their place."""

from __future__ import annotations

from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import DefinitionError
from rosbridge_sim.schema.definitions.parse import (
    BASE_TYPES,
    Constant,
    Field,
    parse_action,
    parse_message,
    parse_service,
)


def fields(text: str) -> tuple[Field, ...]:
    return parse_message("p/T", text).fields


def fault(text: str) -> tuple[int, int, str]:
    """Line, column and words of what is wrong with a text."""
    with pytest.raises(DefinitionError) as caught:
        parse_message("p/T", text, "T.msg")
    error = caught.value
    where = f"T.msg:{error.line}:{error.column}: "
    assert str(error).startswith(where)
    return error.line, error.column, str(error).removeprefix(where)


@pytest.mark.parametrize("kind", sorted(BASE_TYPES))
def test_base_types_are_parsed(kind: str) -> None:
    assert fields(f"{kind} x") == (Field(kind, "x"),)
    assert fields(f"{kind}[] x") == (Field(kind, "x", 0),)


@pytest.mark.parametrize(
    ("line", "field"),
    [
        ("float64[36] c", Field("float64", "c", 36)),
        ("float64[<=5] c", Field("float64", "c", 5, is_bounded=True)),
        ("string<=8 s", Field("string", "s", max_chars=8)),
        ("string<=8[<=4] s", Field("string", "s", 4, is_bounded=True, max_chars=8)),
        ("string<=8[] s", Field("string", "s", 0, max_chars=8)),
        ("Header header", Field("std_msgs/Header", "header")),
        ("std_msgs/Header h", Field("std_msgs/Header", "h")),
        ("std_msgs/msg/Header h", Field("std_msgs/Header", "h")),
        ("builtin_interfaces/Time t", Field("time", "t")),
        ("builtin_interfaces/msg/Duration[2] d", Field("duration", "d", 2)),
        ("Other[] o", Field("p/Other", "o", 0)),
        ("Time t", Field("p/Time", "t")),
        ("  \tint32\t x  # why", Field("int32", "x")),
        ("int32 x#why", Field("int32", "x")),
        ("int32 from", Field("int32", "from")),
        ("int32 _x", Field("int32", "_x")),
    ],
)
def test_field_lines_are_parsed(line: str, field: Field) -> None:
    assert fields(line) == (field,)
    assert field.full_type.startswith(field.type)


@pytest.mark.parametrize("text", ["", "\n\n", "# only a comment", "   # x=1\n\t\n"])
def test_empty_definition_is_allowed(text: str) -> None:
    definition = parse_message("p/T", text)
    assert (definition.fields, definition.constants) == ((), ())


def test_order_and_line_ends_are_handled() -> None:
    definition = parse_message("p/T", "\ufeffint32 b\r\n\r\n# c\r\nint8 a\r\nbool c")
    assert [(f.name, f.line) for f in definition.fields] == [("b", 1), ("a", 4), ("c", 5)]
    assert definition.package == "p"


@pytest.mark.parametrize(
    ("line", "constant"),
    [
        ("int32 X=5", Constant("int32", "X", 5, "5")),
        ("int32 X = -5 # five", Constant("int32", "X", -5, "-5")),
        ("uint8 X=0x10", Constant("uint8", "X", 16, "0x10")),
        ("uint8 X=010", Constant("uint8", "X", 10, "010")),
        ("byte X=255", Constant("byte", "X", 255, "255")),
        ("char X=-1", Constant("char", "X", -1, "-1")),
        ("bool X=True", Constant("bool", "X", value=True, text="True")),
        ("bool X=0", Constant("bool", "X", value=False, text="0")),
        ("float32 X=1e-3", Constant("float32", "X", 0.001, "1e-3")),
        ("string X= a = b # and more ", Constant("string", "X", "a = b # and more", "a = b # and more")),
        ('string X="q"', Constant("string", "X", '"q"', '"q"')),
        ("string X=", Constant("string", "X", "", "")),
    ],
)
def test_constants_are_parsed(line: str, constant: Constant) -> None:
    assert parse_message("p/T", line).constants == (constant,)


@pytest.mark.parametrize(
    ("line", "default"),
    [
        ("int32 x 5", 5),
        ("int32 x -5 # five", -5),
        ("float64 x 1", 1.0),
        ("bool x true", True),
        ('string x "a # b"  # c', "a # b"),
        ("string x 'a'", "a"),
        ("string x plain", "plain"),
        ("int32[] x [1, 2]  # two", (1, 2)),
        ("int32[] x []", ()),
        ("int32[2] x [1, 2]", (1, 2)),
        ("int32[<=3] x [1, 2]", (1, 2)),
        ("string[] x [\"a, b\", 'c']", ("a, b", "c")),
    ],
)
def test_default_values_are_parsed(line: str, default: object) -> None:
    (field,) = fields(line)
    assert field.default == default
    assert type(field.default) is type(default)


@pytest.mark.parametrize(
    ("text", "line", "column", "words"),
    [
        ("int32", 1, 1, "expected a type and a name, found 'int32'"),
        ("int8 a\n  int32 #x", 2, 9, "expected the name of a field, found '#x'"),
        ("int32 ", 1, 7, "expected the name of a field, found 'the end of the line'"),
        ("int32[ x", 1, 1, "expected a type and a name, found 'int32[ x'"),
        ("int32[-1] x", 1, 1, "expected a type and a name, found 'int32[-1] x'"),
        ("int32[0] x", 1, 6, "an array's length is from 1 to 16777216, found [0]"),
        ("int32[99999999] x", 1, 6, "an array's length is from 1 to 16777216, found [99999999]"),
        ("int32[<=] x", 1, 6, "an array's length is from 1 to 16777216, found [<=]"),
        ("int32<=5 x", 1, 8, "only a string can be bounded, not int32"),
        ("a/b/c x", 1, 1, "a/b/c is not a valid type string"),
        ("int32 1x", 1, 7, "expected the name of a field, found '1x'"),
        ("int32 x.y", 1, 8, "'x.y' is no name of a field"),
        ("int32 x\nint8 y\nbool x", 3, 6, "x is defined twice"),
        ("int32 X=1\nint8 X", 2, 6, "X is defined twice"),
        ("int8 X=128", 1, 8, "128 is out of the range of int8, -128 to 127"),
        ("uint8 X=-1", 1, 9, "-1 is out of the range of uint8, 0 to 255"),
        ("uint64 X=18446744073709551616", 1, 10, f"{2**64} is out of the range of uint64, 0 to {2**64 - 1}"),
        ("float32 X=1e39", 1, 11, "1e39 is out of the range of float32"),
        ("float32 X=a", 1, 11, "expected a float32 value, found 'a'"),
        ("int32 X=1.0", 1, 9, "expected a int32 value, found '1.0'"),
        ("int32 X=", 1, 9, "expected a int32 value, found ''"),
        ("bool X=yes", 1, 8, "expected true or false, found 'yes'"),
        ("time X=1", 1, 1, "a constant cannot be of type time"),
        ("int32[] X=1", 1, 1, "a constant cannot be of type int32[]"),
        ("Other X=1", 1, 1, "a constant cannot be of type Other"),
        ("int32 x y", 1, 9, "expected a int32 value, found 'y'"),
        ("Other x 1", 1, 9, "a field of type p/Other cannot have a default value"),
        ("time x 1", 1, 8, "a field of type time cannot have a default value"),
        ("int32[] x 1", 1, 11, "expected a list of values for int32[], found '1'"),
        ("int32[2] x [1]", 1, 12, "1 values do not fit int32[2]"),
        ("int32[<=1] x [1, 2]", 1, 14, "2 values do not fit int32[<=1]"),
        ("string[] x [a]", 1, 12, "expected text in quotes, found 'a'"),
        ("string x 'a', 'b'", 1, 10, "expected one text, found \"'a', 'b'\""),
        ("string x 'a", 1, 10, "expected text in quotes, found \"'a\""),
        ("string<=2 x 'abc'", 1, 13, "'abc' is longer than string<=2 allows"),
        ("string<=2[] x ['abc']", 1, 15, "'abc' is longer than string<=2[] allows"),
    ],
)  # fmt: skip
def test_errors_name_their_line(text: str, line: int, column: int, words: str) -> None:
    assert fault(text) == (line, column, words)


def test_service_has_two_messages() -> None:
    request, response = parse_service("p/S", "int32 a\nint32 K=1\n---\nHeader h\n")
    assert (request.name, response.name) == ("p/SRequest", "p/SResponse")
    assert [f.name for f in request.fields + response.fields] == ["a", "h"]


def test_both_halves_of_a_service_may_be_empty() -> None:
    assert [d.fields for d in parse_service("p/S", "---")] == [(), ()]
    assert [d.fields for d in parse_service("p/S", "# a\r\n --- \r\n")] == [(), ()]


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("int32 a", 1, "a service needs exactly one line '---', found 0"),
        ("---\n\n---", 3, "a service needs exactly one line '---', found 2"),
        ("int32 a\n---\nint8 b\nint32 1", 4, "expected the name of a field, found '1'"),
    ],
)
def test_error_lines_of_a_service_count_from_its_file_start(text: str, line: int, words: str) -> None:
    with pytest.raises(DefinitionError) as caught:
        parse_service("p/S", text, "S.srv")
    assert caught.value.line == line
    assert str(caught.value).endswith(words)


def test_action_has_three_messages() -> None:
    parts = parse_action("p/A", "int32 goal\n---\n# nothing\n---\nHeader h\nint8 LAST=1\n")
    assert [d.name for d in parts] == ["p/AGoal", "p/AResult", "p/AFeedback"]
    assert [[f.name for f in d.fields] for d in parts] == [["goal"], [], ["h"]]
    assert [d.fields for d in parse_action("p/A", "---\n---")] == [(), (), ()]


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("int32 a\n---", 2, "an action needs exactly 2 lines '---', found 1"),
        ("---\n---\n\n---", 4, "an action needs exactly 2 lines '---', found 3"),
        ("int32 a\n---\nint8 b\n---\nint32 1", 5, "expected the name of a field, found '1'"),
    ],
)
def test_error_lines_of_an_action_count_from_its_file_start(text: str, line: int, words: str) -> None:
    with pytest.raises(DefinitionError) as caught:
        parse_action("p/A", text, "A.action")
    assert caught.value.line == line
    assert str(caught.value).endswith(words)


@pytest.mark.parametrize(
    ("text", "in_ros_1", "in_ros_2"),
    [
        ("a", "a", "a"),
        ("'a'", "'a'", "a"),
        ('"it\'s" # x', '"it\'s" # x', "it's"),
        ("a b # c", "a b # c", "a b"),
        ("'a\\'b'", "'a\\'b'", "a'b"),
        ("'a", "'a", "'a"),
        ("'a' 'b", "'a' 'b", "'a' 'b"),
        ("", "", ""),
    ],
)
def test_quotes_of_a_ros_1_text_constant_belong_to_its_value(text: str, in_ros_1: str, in_ros_2: str) -> None:
    for kind in ("string", "wstring"):
        line = f"int8 x\n{kind} K={text}"
        assert [c.value for c in parse_message("p/T", line).constants] == [in_ros_1]
        (constant,) = parse_message("p/T", line, ros=2).constants
        assert (constant.value, constant.text, constant.line) == (in_ros_2, text, 2)


def test_bounds_of_every_kind_are_parsed() -> None:
    text = "string<=10[<=5] a\nwstring<=3 b\nstring<=4[] c\np/U[<=2] d\nuint8[<=9] e\nstring<=1[2] f"
    found = [(f.type, f.array, f.is_bounded, f.max_chars, f.full_type) for f in fields(text)]
    assert found == [
        ("string", 5, True, 10, "string<=10[<=5]"),
        ("wstring", None, False, 3, "wstring<=3"),
        ("string", 0, False, 4, "string<=4[]"),
        ("p/U", 2, True, None, "p/U[<=2]"),
        ("uint8", 9, True, None, "uint8[<=9]"),
        ("string", 2, False, 1, "string<=1[2]"),
    ]


@given(
    st.text()
    | st.lists(st.sampled_from(["int32", " ", "x", "=", "[", "]", "<=", "3", "#", "'", "---", "\n"])).map("".join)
)
def test_any_text_gives_a_definition_or_an_error(text: str) -> None:
    for parse in (parse_message, parse_service, parse_action, partial(parse_message, ros=2)):
        try:
            assert parse("p/T", text)
        except DefinitionError as error:
            assert error.line >= 1  # noqa: PT017 - a text that is right raises nothing
            assert error.column >= 1  # noqa: PT017 - the same
