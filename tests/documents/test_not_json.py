"""Files that are not JSON are called what they are."""

from __future__ import annotations

import pytest

from rosbridge_sim.documents.document_model import Document, DocumentType
from rosbridge_sim.documents.document_reading import read_document
from rosbridge_sim.errors import DocumentError

GOOD = '{"a": "é",\n "b": 1}'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (GOOD.encode("utf-16"), "x: expected UTF-8, got UTF-16; save the file as UTF-8"),
        (GOOD.encode("utf-16-be"), "x: expected a JSON document, got a binary file"),
        (b"\x1f\x8b\x08\x00\x00", "x: expected a JSON document, got a binary file"),
        (b"\x89PNG\r\n\x1a\n\xff\xfe", "x: expected a JSON document, got a binary file"),
        ('{\n "a": "é"}'.encode("latin-1"), "x:2:8: not UTF-8: byte 0xe9; save the file as UTF-8"),
        (b'{"a": 1, // one\n}', "x:1:10: not JSON: expected a key in double quotes; JSON has no comments"),
        (b"# mine\n{}", "x:1:1: not JSON: expected a value; JSON has no comments"),
        (b"{'a': 1}", "x:1:2: not JSON: expected a key in double quotes; JSON has double quotes"),
        (b"vehicleList:\n  - a", "x:1:1: not JSON: expected a value, got 'vehicleList:'"),
        (b'{"a": 1,\n}', "x:1:8: not JSON: trailing comma"),
        (b'["\\ud800"]', r"x: not JSON: an escape such as \ud800 is half a character"),
        (b'["\\ud83d\\ude00", 1 2]', "x:1:20: not JSON: expected ',' delimiter"),
        (b"[" * 5_000, "x: not JSON: nested too deeply"),
        (b"1" * 5_000, "x: not JSON: a number is too long"),
        (b"{", "x:1:2: not JSON: the text ends too early"),
    ],
)
def test_text_that_is_not_json_is_explained_in_one_line(text: bytes, said: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read_document(DocumentType[Document](Document), text, "x", 10_000)
    assert str(caught.value) == said
    assert "\n" not in said
