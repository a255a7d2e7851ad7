from __future__ import annotations

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.documents.document_model import Document, DocumentType, LenientBool, Number, Text, Whole
from rosbridge_sim.documents.document_reading import read_document
from rosbridge_sim.errors import DocumentError


class Sample(Document, frozen=True, kw_only=True):
    number: Number = 0.0
    whole: Whole = 0
    flag: LenientBool = False
    text: Text = ""


SAMPLE = DocumentType[Sample](Sample)


def read(**values: object) -> Sample:
    return read_document(SAMPLE, json.dumps(values).encode(), "sample.json", 1_000_000)


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        (1, 1.0),
        (-0.5, -0.5),
        ("7", 7.0),
        (" -1,234.50 ", -1234.5),
        ("+1,234,567", 1234567.0),
        ("1e-05", 1e-5),
        ("2.E3", 2000.0),
        (".5", 0.5),
    ],
)
def test_numbers_may_be_texts(written: object, meant: float) -> None:
    assert read(number=written).number == meant


@pytest.mark.parametrize(
    "written",
    ["", " ", "-", ".", ",5", "1,2", "12,34,567", "1,2345", "0x10", "nan", "inf", "1_0", "1 2", "²", "1" * 50],
)
def test_texts_that_are_not_numbers_are_refused(written: str) -> None:
    with pytest.raises(DocumentError, match=r"^sample\.json: number: expected a number, got '"):
        read(number=written)


@pytest.mark.parametrize(("written", "meant"), [(True, True), (0, False), (1, True), ("False", False), ("true ", True)])
def test_flags_are_read_in_every_spelling(written: object, meant: bool) -> None:  # noqa: FBT001  # a column
    assert read(flag=written).flag is meant


@pytest.mark.parametrize("written", [2, 0.0, "", "on", None, []])
def test_other_values_are_not_flags(written: object) -> None:
    with pytest.raises(DocumentError, match=r"^sample\.json: flag: expected true or false, got "):
        read(flag=written)


@pytest.mark.parametrize(("written", "meant"), [(2.0, 2), ("20200012", 20200012), ("-1", -1), ("1,000", 1000)])
def test_whole_numbers_are_read(written: object, meant: int) -> None:
    assert read(whole=written).whole == meant


def test_numbers_are_accepted_as_text_and_unknown_keys_ignored() -> None:
    assert read(text=12, other=[]).text == "12"


@given(st.binary(max_size=60) | st.text(max_size=60).map(str.encode))
def test_any_bytes_are_read_or_give_one_error_line(text: bytes) -> None:
    told = ""
    try:
        read_document(SAMPLE, text, "sample.json", 50)
    except DocumentError as error:
        told = str(error)
    assert len(told.splitlines()) <= 1


@given(st.floats(-1e12, 1e12))
def test_any_number_can_be_given_as_text(value: float) -> None:
    assert read(number=repr(value)).number == value
    assert math.isclose(read(number=f"{value:,.3f}").number, value, abs_tol=1e-3)
