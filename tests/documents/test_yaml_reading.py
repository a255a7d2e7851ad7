"""YAML of the user: values with their lines, and what a stranger's file cannot do."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML

from rosbridge_sim.documents.yaml_reading import MAX_YAML_BYTES, read_yaml
from rosbridge_sim.errors import DocumentError


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("", None),
        ("a: 1\nb: [1.5, -2e3, .5, 0x10, 0o17]", {"a": 1, "b": [1.5, -2000.0, 0.5, 16, 15]}),
        ("{a: ~, b: null, c: true, d: False, e: }", {"a": None, "b": None, "c": True, "d": False, "e": None}),
        ("a: yes\nb: on\nc: 2020-01-31\nd: 12:30:00", {"a": "yes", "b": "on", "c": "2020-01-31", "d": "12:30:00"}),
        ("a: '1'\nb: \"true\"\nc: |\n  two\n  lines\n", {"a": "1", "b": "true", "c": "two\nlines\n"}),
        ("a: &x [1, 2]\nb: *x", {"a": [1, 2], "b": [1, 2]}),
        ("1: one", {"1": "one"}),
        ('{"x": {"y": [1, "a\\u00e9"]}}', {"x": {"y": [1, "aé"]}}),
        ("--- \na: 1\n...\n", {"a": 1}),
    ],
)
def test_words_are_read_as_in_yaml_1_2(text: str, value: object) -> None:
    assert read_yaml(text, "x.yaml").value == value


def test_nan_and_infinity_are_numbers() -> None:
    nan, low = read_yaml("[.nan, -.inf]", "x.yaml").value
    assert math.isnan(nan)
    assert low == -math.inf


def test_each_place_has_the_line_of_its_key() -> None:
    document = read_yaml("a: 1\nb:\n  c:\n  - 1\n  - d: 2\n", "x.yaml")
    assert document.where(("b", "c", 1, "d")) == "x.yaml:5: b.c[1].d"
    assert document.where(("b",)) == "x.yaml:2: b"
    assert document.where(("b", "c", 1, "missing")) == "x.yaml:5: b.c[1].missing"
    assert document.where(()) == "x.yaml:1"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a: [1", "x.yaml:1:6: expected YAML: "),
        ("a: 1\na: 2", "x.yaml:2:1: expected each key once, got 'a' again"),
        ("a: !!python/object/apply:os.system [ls]", "x.yaml:1:4: expected no tags, got 'tag:yaml.org,2002:python/"),
        ("a: !!str 1", "x.yaml:1:4: expected no tags"),
        ("a: 1\n---\nb: 2", "x.yaml:2:1: expected one document"),
        ("? [1]\n: 2", "x.yaml:1:3: expected a text as a key"),
        ("a: *b", "x.yaml:1:4: no anchor &b that is complete stands above"),
        ("a: &a [*a]", "x.yaml:1:8: no anchor &a that is complete stands above"),
        ("[" * 5_000, "x.yaml:1:51: expected at most 50 levels"),
        ("a: " * 10, "x.yaml:1:5: expected YAML"),
        ("- " * 100_000, "x.yaml:1:101: expected at most 50 levels"),
        ("x" * (MAX_YAML_BYTES + 1), "x.yaml: expected at most 500,000 bytes, got 500,001"),
        ("\0", "x.yaml: expected YAML: "),
        ("a: b\n\tc: d", "x.yaml:2:"),
    ],
)
def test_text_that_is_no_yaml_or_too_much_gives_one_line(text: str, line: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read_yaml(text, "x.yaml")
    assert str(caught.value).startswith(line)
    assert "\n" not in str(caught.value)


def test_aliases_of_aliases_are_counted_before_they_are_gone_through() -> None:
    """In line 6 of 20: with all of them there are 10**20 values, which nobody goes through."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 20)]
    with pytest.raises(DocumentError, match=r"x\.yaml:6:\d+: expected at most 200,000 values with those of aliases"):
        read_yaml("\n".join(lines), "x.yaml")


@given(st.text(alphabet=st.sampled_from("ab:-[]{}&*!|>'\"#,? \n\t%@0.~<"), max_size=60))
def test_any_text_gives_a_value_or_one_line(text: str) -> None:
    try:
        document = read_yaml(text, "x.yaml")
    except DocumentError as error:
        assert "\n" not in str(error)  # noqa: PT017 - either way is right
    else:
        json.dumps(document.value)


_JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=12,
)


@given(_JSON)
def test_json_that_the_library_reads_has_the_same_value(value: object) -> None:
    text = json.dumps(value)
    assert read_yaml(text, "x.yaml").value == YAML(typ="safe", pure=True).load(text)
