"""Mistakes in documents: all of them, each with its place and what was expected, however a document is wrong."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import Meta, field

from rosbridge_sim.documents.document_model import Document, DocumentType, KeptAsWritten, Number, Table, Text, Whole
from rosbridge_sim.documents.document_reading import find_mistakes, parse_json, read_document, read_values
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.scenarios import scenario_model
from rosbridge_sim.simulator.sensor_rigs import sensor_presets
from tests.support import ROOT

DEMO: Any = json.loads((ROOT / "rosbridge_sim" / "data" / "scenarios" / "demo.json").read_text())
RIG: Any = {"camera": [{"distortion": [0, 0, "0.1", 0, 0]}], "lidar3d": [{"model": "own", "elevations": [1, "2.5"]}]}
ODD: list[Any] = [None, True, 2.5, 1e13, 2**70, "", "7", "1,2", "x" * 1001, [], [1], [None] * 3, {}, {"x": 1}]
KINDS: list[tuple[DocumentType[Any], Any]] = [(scenario_model.SCENARIO, DEMO), (sensor_presets.SENSOR_FILE, RIG)]


class Inner(Table, frozen=True, kw_only=True):
    """A table with keys that must fit each other."""

    low: float
    high: Annotated[float, Meta(gt=0.0)] = 1.0
    word: Literal["red", "green"] = "red"

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise ValueError("expected low <= high")


class Outer(Document, frozen=True, kw_only=True):
    """Each kind of field."""

    idx: Text = ""
    points: Annotated[list[tuple[Number, Number]], Meta(max_length=3)] = []  # noqa: RUF012 - msgspec copies it
    tables: Annotated[dict[str, Inner | list[Whole]], Meta(max_length=2)] = field(name="set", default_factory=dict)
    exact: int | None = None
    kept: KeptAsWritten = None


OUTER = DocumentType[Outer](Outer)


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ([], ["x: expected an object, got a list of 0"]),
        ({"idx": []}, ["x: idx: expected a text, got a list of 0"]),
        ({"exact": 2.0, "other": []}, ["x: exact: expected a whole number, got 2.0"]),
        ({"exact": True}, ["x: exact: expected a whole number, got true"]),
        (
            {"points": [[1, 2], [3], ["a", 1e13]]},
            [
                "x: points[1]: expected a list of 2, got a list of 1",
            ],
        ),
        ({"points": [[1, 1e13]]}, ["x: points[0][1]: expected at most 1,000,000,000,000, got 10000000000000.0"]),
        ({"points": [[0, 0]] * 4}, ["x: points: expected at most 3 entries, got a list of 4"]),
        (
            {"set": {"a": {"low": 0}, "b": [1], "c\n": [2]}},
            ["x: set: expected at most 2 entries, got an object"],
        ),
        (
            {"set": {"a": {"hihgh": 1, "high": 0, "word": "gren"}, "b": [1, 2.5]}},
            [
                "x: set.a.hihgh: expected one of low, high, word (did you mean high?)",
                "x: set.a.low: missing",
                "x: set.a.high: expected more than 0, got 0",
                "x: set.a.word: expected one of red, green, got 'gren' (did you mean green?)",
                "x: set.b[1]: expected a whole number, got 2.5",
            ],
        ),
        ({"set": {"a": "text"}}, ["x: set.a: expected an object or a list, got 'text'"]),
        ({"set": {"a": {"low": 3}}}, ["x: set.a: expected low <= high, got an object"]),
        ({"set": {"a": {"low": float("nan")}}}, ["x: set.a.low: expected a finite number, got nan"]),
    ],
)
def test_each_mistake_has_its_place_and_what_was_expected(value: object, told: list[str]) -> None:
    text = json.dumps(value).encode()
    assert [mistake.text for mistake in find_mistakes(OUTER, text, "x", 10_000)] == told
    with pytest.raises(DocumentError) as caught:
        read_values(OUTER, value, "x")
    assert str(caught.value) == told[0]


def test_numbers_that_stand_for_texts_and_values_that_nothing_reads_are_accepted() -> None:
    text = b'{"idx": 7.0, "points": [["1", 2]], "set": {"a": [1, "2"]}, "kept": NaN, "strange": Infinity}'
    read = read_document(OUTER, text, "x", 10_000)
    assert (read.idx, read.points, read.tables) == ("7", [(1.0, 2.0)], {"a": [1, 2]})


def test_hundred_mistakes_are_told_and_the_others_counted() -> None:
    found = find_mistakes(DocumentType[Any](list[Inner]), json.dumps([{}] * 1_234).encode(), "x", 10_000)
    assert len(found) == 101
    assert found[-1].text == "x: ... and 1,134 more"


def test_key_that_is_given_twice_has_its_last_value() -> None:
    twice = b'{"mapInfo": {"mapName": "a", "mapName": "b"}}'
    read = scenario_model.read_scenario_document(twice, "x")
    assert read.mapInfo is not None
    assert read.mapInfo.mapName == "b"


def test_long_key_is_shortened_where_a_document_is_told_of() -> None:
    """A client may send sensors with a key of megabytes, which the answer must not repeat."""
    key = "k\u202e" * 3_000_000
    with pytest.raises(DocumentError, match="expected an object or a list") as error:
        read_values(OUTER, {"set": {key: "x"}}, "f.json")
    assert len(str(error.value)) < 500
    assert "\u202e" not in str(error.value)


def places_of(value: object, place: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The places of all values in a document."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [place, *(each for key, one in inner for each in places_of(one, (*place, key)))]


def replaced(value: Any, place: tuple[Any, ...], odd: object) -> object:  # noqa: ANN401 - JSON
    """The document with another value at a place."""
    if not place:
        return odd
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[place[0]] = replaced(value[place[0]], place[1:], odd)
    return copy


@given(st.data())
def test_any_document_is_read_or_has_mistakes_of_one_line_each(data: st.DataObject) -> None:
    kind, value = data.draw(st.sampled_from(KINDS))
    place = data.draw(st.sampled_from(places_of(value)))
    text = json.dumps(replaced(value, place, data.draw(st.sampled_from(ODD)))).encode()
    told = [mistake.text for mistake in find_mistakes(kind, text, "x", 1_000_000)]
    assert all(line.isprintable() for line in told)
    said = []
    try:
        read_values(kind, parse_json(text, "x", 1_000_000), "x")
    except DocumentError as error:
        said = [str(error)]
    assert said == told[:1]
