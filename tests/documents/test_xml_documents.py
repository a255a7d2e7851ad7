"""XML in pieces: elements with lines, bounded, and one sentence for what is wrong."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator

import pytest

from rosbridge_sim.documents import xml_documents
from rosbridge_sim.documents.xml_documents import Element, read_children, read_whole
from rosbridge_sim.errors import DocumentError

SMALL = b"""<?xml version="1.0"?>
<a v="1">
  <b id="x" n="2.5"
     k="3"><c>some <d/>text</c><geoReference>a <d/><![CDATA[&b]]></geoReference></b>
  <b id="y"/>
</a>"""


def pieces(content: bytes, size: int) -> Iterator[bytes]:
    return (content[at : at + size] for at in range(0, len(content), size))


@pytest.mark.parametrize("size", [1, 7, 10_000])
def test_children_come_one_by_one_with_their_lines(size: int) -> None:
    root, first, second = read_children(pieces(SMALL, size), "f", "a")
    assert (root.attributes, root.line, root.children) == ({"v": "1"}, 2, ())
    assert (first.word("id"), first.line, second.word("id"), second.line) == ("x", 3, "y", 5)
    inner, reference = first.children
    assert (inner.text, inner.line, inner.first("d") is not None, first.first("e")) == ("", 4, True, None)
    assert reference.text == "a &b"


def test_child_is_yielded_before_the_rest_is_there() -> None:
    taken = []

    def feed() -> Iterator[bytes]:
        yield b"<a><b/>"
        taken.append("asked for more")
        yield b"</a>"

    found = read_children(feed(), "f", "a")
    assert [next(found).tag, next(found).tag, len(taken)] == ["a", "b", 0]


def test_elements_without_children_are_one_object_each_for_the_collector() -> None:
    content = b"<a>" + b'<b c="d"/>' * 1_000 + b"</a>"
    gc.collect()
    before = len(gc.get_objects())
    root = read_whole(content, "f", "a")
    assert len(gc.get_objects()) - before < 1_100
    assert len(root.children) == 1_000


def test_whole_document_has_its_children_and_names_without_prefixes() -> None:
    root = read_whole(b'<o:a xmlns:o="u"><o:b/><c/></o:a>', "f", "a")
    assert [child.tag for child in root.children] == ["b", "c"]


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "f: line 1: not XML: no element found"),
        (b"licence\n<a/>", "f: line 1: not XML: syntax error"),
        (b"<a>\n<b></a>", "f: line 2: not XML: mismatched tag"),
        (b"<a>&x;</a>", "f: line 1: not XML: undefined entity"),
        (b"<b/>", "f: line 1: expected <a> as the root, got <b>"),
        (b'<!DOCTYPE a [<!ENTITY x "y">]><a>&x;</a>', "f: line 1: a DOCTYPE is refused; take it and its entities out"),
        (b'<?xml version="1.0" encoding="utf-99"?><a/>', "f: line 1: cannot be decoded: unknown encoding: utf-99"),
        (b"<a>" * 70 + b"</a>" * 70, "f: line 1: expected at most 64 elements within one another"),
    ],
)
def test_what_is_no_document_is_told_in_a_line(content: bytes, told: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read_whole(content, "f", "a")
    assert str(caught.value) == told


def test_number_of_elements_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xml_documents, "MAX_ELEMENTS", 10)
    assert len(read_whole(b"<a>" + b"<b/>" * 9 + b"</a>", "f", "a").children) == 9
    with pytest.raises(DocumentError, match="expected at most 10 elements"):
        read_whole(b"<a>" + b"<b/>" * 10 + b"</a>", "f", "a")


def element(**attributes: str) -> Element:
    return Element("b", attributes, 3, "f")


def test_values_of_attributes_are_read() -> None:
    one = element(n=" 2.5e1 ", k="3", side=" left ", empty="")
    assert (one.number("n"), one.whole("k"), one.choice("side", ("left", "right"))) == (25.0, 3, "left")
    assert (one.number("gone", 1.0), one.number("empty", 2.0), one.whole("gone", 4), one.word("gone", "")) == (
        1,
        2,
        4,
        "",
    )
    assert one.choice("gone", ("left",), "right") == "right"


@pytest.mark.parametrize(
    ("value", "read", "told"),
    [
        ("x", lambda b: b.number("v"), "f: line 3: <b '7'>: v: expected a number, got 'x'"),
        ("nan", lambda b: b.number("v"), "f: line 3: <b '7'>: v: expected a number, got 'nan'"),
        ("1e999", lambda b: b.number("v"), "f: line 3: <b '7'>: v: expected a number, got '1e999'"),
        ("-1", lambda b: b.number("v", None, 0.0, 9.0), "f: line 3: <b '7'>: v: expected a number 0..9, got '-1'"),
        ("", lambda b: b.number("v"), "f: line 3: <b '7'>: v: expected a number, got ''"),
        ("nan", lambda b: b.numbers(("w", "v")), "f: line 3: <b '7'>: v: expected a number, got 'nan'"),
        ("-2e12", lambda b: b.numbers(("v", "w")), "f: line 3: <b '7'>: v: expected a number, got '-2e12'"),
        ("1,5", lambda b: b.numbers(("v",)), "f: line 3: <b '7'>: v: expected a number, got '1,5'"),
        ("1.5", lambda b: b.whole("v"), "f: line 3: <b '7'>: v: expected a whole number, got '1.5'"),
        ("1", lambda b: b.number("w"), "f: line 3: <b '7'>: w: expected a number; it is missing"),
        ("1", lambda b: b.word("w"), "f: line 3: <b '7'>: w: expected a value; it is missing"),
        (
            "lefft",
            lambda b: b.choice("v", ("left", "right")),
            "f: line 3: <b '7'>: v: expected one of left, right, got 'lefft' (did you mean left?)",
        ),
    ],
)
def test_wrong_value_is_told_with_element_id_and_line(value: str, read: Callable[[Element], object], told: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read(element(id="7", v=value))
    assert str(caught.value) == told


def test_content_of_user_data_is_not_kept_and_the_rest_stays_in_place() -> None:
    content = b"<a><b><userData><x><userData/>text</x></userData><c/></b><userData/><d/></a>"
    root = read_whole(content, "f", "a")
    first = root.children[0]
    assert [child.tag for child in root.children] == ["b", "userData", "d"]
    assert [(child.tag, child.children, child.text) for child in first.children] == [
        ("userData", (), ""),
        ("c", (), ""),
    ]
