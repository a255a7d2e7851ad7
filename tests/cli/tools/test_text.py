"""Printed text is YAML that reads back as the value, without terminal control characters."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML

from rosbridge_sim.cli.tools.text import note, put_table, read_body, render
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.link.terminal_text import safe

KEYS = st.text(st.characters(codec="ascii", categories=["Ll", "Lu", "Nd"]), min_size=1, max_size=8)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False) | st.text(max_size=12),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4),
    max_leaves=12,
)


@given(VALUES)
def test_printed_yaml_reads_back_as_the_same_value(value: object) -> None:
    assert YAML(typ="safe", pure=True).load(render(value)) == value


@given(st.text())
def test_printed_text_has_no_control_characters(text: str) -> None:
    assert all(line.isprintable() for line in render({"data": text, text: [text]}).split("\n"))
    assert safe(text).isprintable()


def test_message_is_printed_in_the_style_of_rostopic_echo() -> None:
    msg = {
        "header": {"stamp": {"secs": 1, "nsecs": 0}, "frame_id": "map", "note": ""},
        "x": 40.0,
        "is_on": True,
        "ranges": [1.5, 2],
        "objects": [{"name": "Van 1", "y": 0}, {"name": "1", "y": None}],
        "none": [],
        "empty": {},
    }
    assert (
        render(msg)
        == """\
header:
  stamp:
    secs: 1
    nsecs: 0
  frame_id: map
  note: ""
x: 40.0
is_on: true
ranges: [1.5, 2]
objects:
  - name: Van 1
    y: 0
  - name: "1"
    y: null
none: []
empty: {}"""
    )


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("yes", '"yes"'),
        ("a: b", '"a: b"'),
        ("차량", "차량"),
        ("\x1b[31m\n\u202e\U000e0001", '"\\x1b[31m\\n\\u202e\\U000e0001"'),
        ("/Ego_topic", "/Ego_topic"),
        (math.nan, ".nan"),
        (-math.inf, "-.inf"),
    ],
)
def test_scalars_keep_their_type_in_yaml(value: object, text: str) -> None:
    assert render(value) == text


def test_table_columns_are_aligned(capsys: pytest.CaptureFixture[str]) -> None:
    put_table(("TOPIC", "TYPE"), [("/a", "p/A"), ("/longer", "p/B\n")])
    assert capsys.readouterr().out == "TOPIC    TYPE\n/a       p/A\n/longer  p/B\\n\n"


def test_note_escapes_line_breaks(capsys: pytest.CaptureFixture[str]) -> None:
    note("a\nb")
    assert capsys.readouterr() == ("", "rosbridge-sim: a\\nb\n")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ('{"x": 1, "s": "a\\u00e9"}', {"x": 1, "s": "aé"}),
        ("{x: 1, y: {z: [1.5, two]}}", {"x": 1, "y": {"z": [1.5, "two"]}}),
        ("data: hello world", {"data": "hello world"}),
        ("x: 1\ny: yes", {"x": 1, "y": "yes"}),
        ("{x: -.inf}", {"x": -math.inf}),
        ('{"x": [1, Infinity]}', {"x": [1, math.inf]}),
        ("{day: 2020-01-31, none: 2020-13-45}", {"day": "2020-01-31", "none": "2020-13-45"}),
        ("{1: 2}", {"1": 2}),
        ("[1, 2]", [1, 2]),
        ("hello", "hello"),
    ],
)
def test_body_can_be_json_or_yaml(text: str, value: object) -> None:
    assert read_body(text, "MESSAGE") == value


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("{x: 1", "MESSAGE:1:6: expected JSON, or YAML such as '{x: 1}': expected ',' or '}'"),
        ("{[1]: 2}", "MESSAGE:1:2: expected a text as a key"),
        ("{x: 1, x: 2}", "MESSAGE:1:8: expected each key once, got 'x' again"),
        ("{x: 99999999999999999999999}", "MESSAGE: expected what JSON can hold: Integer exceeds 64-bit range"),
        ("&a [*a]", "MESSAGE:1:5: no anchor &a that is complete stands above"),
        ("!!python/object:os.system x", "MESSAGE:1:1: expected no tags"),
        ("[" * 60, "MESSAGE:1:51: expected at most 50 levels, got more"),
    ],
)
def test_body_that_is_neither_gives_one_error_line(text: str, line: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read_body(text, "MESSAGE")
    assert str(caught.value).startswith(line)
    assert "\n" not in str(caught.value)
