"""Expressions of users: what they mean, what is refused, and that none of them can cost much."""

from __future__ import annotations

import math
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.expressions import (
    FUNCTIONS,
    MAX_EXPRESSION_DEPTH,
    MAX_EXPRESSION_LENGTH,
    RUNNING,
    Following,
    Value,
    is_name,
    parse_expression,
)


def value_of(text: str, **names: Value) -> Value:
    return parse_expression(text, "f", frozenset(names))(names)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * 3", 7),
        ("-(4 - 6)", 2),
        ("7 // 2 + 7 % 4", 6),
        ("2 ** 0.5", math.sqrt(2.0)),
        ("x if x > 3 else -x", 5),
        ("3 < x <= 5", True),
        ("3 < x < 5", False),
        ("not x > 3 or word == 'rain'", True),
        ("word != 'rain' and 1 / 0 > 0", False),
        ("min(x, 2, 9) + max(1, 2) + clamp(x, 0, 4)", 8),
        ("hypot(3, 4) + sin(0)", 5.0),
        ("x < inf", True),
        ("True", True),
    ],
)
def test_expressions_mean_what_python_means(text: str, value: Value) -> None:
    found = value_of(text, x=5, word="rain")
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("x.real", "without points"),
        ("x[0]", "expected numbers"),
        ("__import__('os')", "no function"),
        ("(lambda: 1)()", "expected numbers"),
        ("[x for x in y]", "expected numbers"),
        ("f'{x}'", "expected numbers"),
        ("x := 3", "expected an expression"),
        ("x = 3", "expected an expression"),
        ("x is 3", "expected <"),
        ("min(x, *y)", "expected numbers"),
        ("round(x, ndigits=2)", "expected numbers"),
        ("sqrt()", "expected 1 arguments"),
        ("sqr(x)", "did you mean sqrt"),
        ("spede < 3", "did you mean speed"),
        ("1j", "expected numbers"),
        ("~1", "not in place of ~"),
        ("", "expected an expression"),
        ("1" + " + 1" * 150, "at most 500 characters"),
        ("x" + "+x" * 120, "at most 200 parts"),
        ("-" * 120 + "x", "deep"),
        ("(" * 240 + "x" + ")" * 240, "expected an expression"),
    ],
)
def test_all_else_is_refused_with_its_place(text: str, what: str) -> None:
    with pytest.raises(DocumentError, match=r"^file: ") as caught:
        parse_expression(text, "file", frozenset({"x", "y", "speed"}))
    assert what in str(caught.value)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("1 / x", "division by zero"),
        ("10.0 ** 400", "outside the range"),
        ("9 ** 9 ** 9 ** 9", "outside the range"),
        ("sqrt(-1)", "outside the range"),
        ("word + 1", "a text where a number"),
        ("word * 1000000000", "a text where a number"),
        ("word < 1", "a text where a number"),
    ],
)
def test_expression_without_a_value_is_an_error_of_the_user(text: str, why: str) -> None:
    with pytest.raises(DocumentError, match=why):
        value_of(text, x=0, word="rain")


def test_whole_numbers_stay_within_eight_bytes() -> None:
    squares = "x" + " * x" * 60
    found = value_of(squares, x=2**53)
    assert isinstance(found, float)
    assert isinstance(value_of("1" * 300), float)
    with pytest.raises(DocumentError, match="at most 300 digits"):
        parse_expression("1" * 400, "f")


@given(st.text(max_size=MAX_EXPRESSION_LENGTH + 2))
def test_no_text_raises_anything_else(text: str) -> None:
    with suppress(DocumentError):
        parse_expression(text, "f", frozenset({"x"}))({"x": 1.0})


@given(st.recursive(st.sampled_from(["x", "2", "0.5"]), lambda inner: st.tuples(inner, st.sampled_from("+-*"), inner)))
def test_arithmetic_equals_that_of_python(tree: object) -> None:
    def text_of(node: object) -> str:
        return node if isinstance(node, str) else f"({text_of(node[0])} {node[1]} {text_of(node[2])})"  # type: ignore[index]

    text = text_of(tree)
    try:
        found = value_of(text, x=3.25)
    except DocumentError:
        assert len(text) > MAX_EXPRESSION_LENGTH or text.count("(") > MAX_EXPRESSION_DEPTH
        return
    assert found == pytest.approx(eval(text, {"x": 3.25}))  # noqa: S307 - the test's own text


def test_names_of_functions_and_words_of_the_language_are_no_names() -> None:
    assert is_name("gap")
    assert not any(is_name(name) for name in [*FUNCTIONS, *RUNNING, "pi", "if", "lambda", "2x", "a-b", "a.b", "é", ""])


def followed(text: str, frames: list[dict[str, Value]]) -> list[Value | None]:
    following = Following(parse_expression(text, "f", frozenset({"x", "word"}), is_followed=True))
    found = []
    for values in frames:
        following.take(values)
        found.append(following.value(values))
    return found


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("max(x)", [1, 4, 4, 4]),
        ("min(x)", [1, 1, 1, -2]),
        ("mean(x)", [1, 2.5, 2.5, 1]),
        ("first(x)", [1, 1, 1, 1]),
        ("last(x)", [1, 4, 4, -2]),
        ("count(x > 0)", [1, 2, 2, 2]),
        ("ever(x > 3)", [False, True, True, True]),
        ("always(x > 0)", [True, True, True, False]),
        ("max(x) - min(x) + max(x, 0)", [1, 7, None, 6]),
        ("max(abs(mean(x)))", [1, 2.5, 2.5, 2.5]),
        ("x", [1, 4, None, -2]),
    ],
)
def test_functions_over_time_keep_what_was_so_far(text: str, expected: list[Value | None]) -> None:
    assert followed(text, [{"x": 1}, {"x": 4}, {}, {"x": -2}]) == pytest.approx(expected)


def test_function_over_time_has_no_value_before_its_argument_has() -> None:
    assert followed("count(/a.b > 0) >= 0", [{}, {"/a.b": 1}]) == [None, True]


@pytest.mark.parametrize(
    ("text", "fields", "names"),
    [
        ("/Ego_topic.velocity.x < 20", {("/Ego_topic", ("velocity", "x"))}, set()),
        ("x / 2 / /a/b.c[3].d", {("/a/b", ("c", 3, "d"))}, {"x"}),
        ("not /a.b and (x)/x", {("/a", ("b",))}, {"x"}),
        ("word == '/a.b'", set(), {"word"}),
        ("-/a.b + /a.b", {("/a", ("b",))}, set()),
        ("x //2", set(), {"x"}),
    ],
)
def test_slash_begins_a_topic_where_a_value_is_expected(text: str, fields: set[object], names: set[str]) -> None:
    found = parse_expression(text, "f", frozenset({"x", "word"}), is_followed=True)
    assert {(each.topic, each.path) for each in found.fields} == fields
    assert found.names == names | {each.text for each in found.fields}


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("/Ego_topic < 3", "expected a field behind the topic /Ego_topic"),
        ("/a[0] < 3", "expected a field behind the topic /a"),
        ("max() < 3", "max(): expected 2 to 8 arguments"),
        ("count(x, x)", "count(): expected 1 argument"),
        ("evre(x)", "did you mean ever"),
        ("x.real", "without points"),
        ("/a.b.c(3)", "expected no parentheses behind /a.b.c"),
    ],
)
def test_what_is_followed_is_refused_with_its_place(text: str, what: str) -> None:
    with pytest.raises(DocumentError, match=r"^file: ") as caught:
        parse_expression(text, "file", frozenset({"x"}), is_followed=True)
    assert what in str(caught.value)


def test_functions_over_time_and_topics_are_for_what_is_followed() -> None:
    for text in ("max(x)", "ever(x > 1)", "/a.b > 1"):
        with pytest.raises(DocumentError):
            parse_expression(text, "f", frozenset({"x"}))


@given(st.text(alphabet="/ab.[0]x<>'\"( )max,-\\", max_size=60))
def test_no_text_that_is_followed_raises_anything_else(text: str) -> None:
    with suppress(DocumentError):
        following = Following(parse_expression(text, "f", frozenset({"x"}), is_followed=True))
        following.take({"x": 1.0})
        following.value({"x": 1.0})
