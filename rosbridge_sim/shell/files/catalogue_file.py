"""The user's own models: a table in a TOML or CSV file, searched before the built-in catalogue.

MORAI publishes neither sizes nor names of most of its models. A user who has them can write them into a file:
    [[model]]                      DataID,name,class,length,width,height,wheelbase,rear overhang,max steer,mass
    DataID = 30200005              30200005,Sonata,vehicle,4.9,1.86,1.445,2.84,1.1,35,1500
    name = "Sonata"
    class = "vehicle"
    length = 4.9

Lengths are in metres, `max_steer` in degrees, `mass` in kilograms. Every mistake is reported with its line and field.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Final

from msgspec import Meta, field

from rosbridge_sim.documents.document_model import Document, DocumentType, Place, about, show_json
from rosbridge_sim.documents.document_reading import check_values
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.records import Record, replace
from rosbridge_sim.scenarios.catalogue import Catalogue, Model, class_of_data_id, default_model, key_of_name
from rosbridge_sim.shell.config.toml_text import parse_toml, read_text
from rosbridge_sim.suggestions import hint
from rosbridge_sim.world.state.entity_types import CG_SHARE
from rosbridge_sim.world.state.world import Body, Kind

COLUMNS: Final = (
    *("DataID", "name", "class", "length", "width", "height"),
    *("wheelbase", "rear_overhang", "max_steer", "mass"),
)
"""Fields of a model. Upper or lower case, blanks, `-` and `_` make no difference."""

MAX_FILE_SIZE: Final = 2**20
"""Longest file [bytes]: about 10,000 models."""

MAX_CATALOGUE_TEXT: Final = 100
"""Longest name [characters]."""

MAX_CATALOGUE_MISTAKES: Final = 20
"""Largest number of mistakes in one error."""

MAX_BODY_LENGTH: Final = 100.0
"""Largest length of a model [m]: three road trains."""

MIN_LENGTH: Final = 0.01

MIN_STEER: Final = 1.0
MAX_STEER: Final = 80.0
"""Largest steering angle [deg]; beyond this the turning radius goes to zero."""

MAX_MASS: Final = 1e6

MAX_DATA_ID: Final = 2**31 - 1

_BY_KEY: Final = {re.sub(r"[\W_]", "", column).casefold(): column for column in COLUMNS}

_CLASSES: Final = {
    "vehicle": Kind.VEHICLE,
    "car": Kind.VEHICLE,
    "ego": Kind.VEHICLE,
    "pedestrian": Kind.PEDESTRIAN,
    "obstacle": Kind.OBSTACLE,
    "object": Kind.OBSTACLE,
}


class _Entry(Record):
    """One model as the file has it.

    Attributes:
        where: file and line.
        values: values by column, without empty ones.
        lines: file and line of single columns, if they are known.
    """

    where: str
    values: Mapping[str, object]
    lines: Mapping[str, str]

    def at(self, place: Place) -> str:
        """Return the place of a column, for errors."""
        column = str(place[0])
        return f"{self.lines.get(column, self.where)}: {column}"


def read_catalogue(path: Path) -> Catalogue:
    """Read a file of models.

    Args:
        path: `.toml` or `.csv`.

    Raises:
        DocumentError: all mistakes of the file, on one line.
    """
    suffix = path.suffix.lower()
    if suffix not in {".toml", ".csv"}:
        raise DocumentError(f"{path}: expected a catalogue in a file named *.toml or *.csv")
    # A spreadsheet program may write either line end, and a byte-order mark at the start.
    text = read_text(path, MAX_FILE_SIZE, "a catalogue").replace("\r", "\n")
    entries = list(_toml_entries(text, path) if suffix == ".toml" else _csv_entries(text, path))
    if not entries:
        raise DocumentError(f"{path}: expected at least one model, {_EXAMPLES[suffix]}; found none")
    mistakes: list[str] = []
    models = []
    taken: dict[tuple[object, ...], str] = {}
    for entry in entries:
        checked = check_values(_ROW, entry.values, entry.at)
        row, told = checked
        mistakes += [mistake.text for mistake in told]
        if row is None:
            continue
        try:
            model = _model_of(row)
        except _MisfitError as error:
            mistakes.append(f"{entry.at((error.column,))}: {error}")
            continue
        ids = [((model.kind, data_id), f"DataID {data_id}") for data_id in model.data_ids]
        for key, what in [*ids, ((key_of_name(model.name),), f"name {model.name!r}")]:
            first = taken.setdefault(key, entry.where)
            if first is not entry.where:
                column = what.partition(" ")[0]
                mistakes.append(f"{entry.at((column,))}: {what.partition(' ')[2]} is already used at {first}")
        models.append(model)
    if mistakes:
        more = (
            f"; ... and {len(mistakes) - MAX_CATALOGUE_MISTAKES:,} more"
            if len(mistakes) > MAX_CATALOGUE_MISTAKES
            else ""
        )
        raise DocumentError("; ".join(mistakes[:MAX_CATALOGUE_MISTAKES]) + more)
    return Catalogue(models)


_EXAMPLES: Final = {
    ".toml": 'such as [[model]] with DataID = 30200005, name = "Sonata", length = 4.9, width = 1.86, height = 1.45',
    ".csv": f"below a first line {','.join(COLUMNS[:6])},...",
}


def _toml_entries(text: str, path: Path) -> Iterator[_Entry]:
    document = parse_toml(text, path)
    strange = next((key for key in document if key != "model"), None)
    if strange is not None:
        raise DocumentError(f"{path}: {strange}: expected [[model]] tables and nothing else")
    models = document.get("model", [])
    if not isinstance(models, list):
        raise DocumentError(f"{path}: model: expected [[model]], with two brackets, for each model")
    lines = text.split("\n")
    heads = [number for number, line in enumerate(lines, 1) if re.match(r"\s*\[\[\s*[\"']?model[\"']?\s*\]\]", line)]
    for i, values in enumerate(models):
        # If the tables are written inline, their lines are not known.
        head = heads[i] if len(heads) == len(models) else None
        where = f"{path}: model {i + 1}" if head is None else f"{path}:{head}"
        if not isinstance(values, dict):
            raise DocumentError(f"{where}: expected a table, got {show_json(values)}")
        end = len(lines) if head is None or i + 1 == len(models) else heads[i + 1] - 1
        own_lines = {} if head is None else dict(_lines_of(lines, head, end, path))
        columns = {key: _column(key, own_lines.get(key, where)) for key in values}
        yield _Entry(
            where,
            {columns[key]: value for key, value in values.items()},
            {columns[key]: at for key, at in own_lines.items() if key in columns},
        )


def _lines_of(lines: list[str], head: int, end: int, path: Path) -> Iterator[tuple[str, str]]:
    """Yield the keys of a table, with file and line of each."""
    for number in range(head + 1, end + 1):
        match = re.match(r"\s*[\"']?([^\"'=]+?)[\"']?\s*=", lines[number - 1])
        if match:
            yield match[1], f"{path}:{number}"


def _csv_entries(text: str, path: Path) -> Iterator[_Entry]:
    lines = text.split("\n")
    head = next((line for line in lines if line.strip() and not line.lstrip().startswith("#")), "")
    delimiter = max(",;\t", key=head.count)
    rows = csv.reader(lines, delimiter=delimiter, strict=True)
    columns: list[str] | None = None
    try:
        for row in rows:
            cells = [cell.strip() for cell in row]
            if not any(cells) or cells[0].startswith("#"):
                continue
            where = f"{path}:{rows.line_num}"
            if columns is None:
                columns = [_column(cell, where) if cell else "" for cell in cells]
                double = next((one for one in columns if one and columns.count(one) > 1), None)
                if double is not None:
                    raise DocumentError(f"{where}: {double}: given twice")
                continue
            if any(cells[len(columns) :]):
                raise DocumentError(f"{where}: expected {len(columns)} columns, got {len(cells)}")
            pairs = zip(columns, cells, strict=False)
            yield _Entry(where, {column: cell for column, cell in pairs if column and cell}, {})
    except csv.Error as error:
        raise DocumentError(f"{path}:{rows.line_num}: not valid CSV: {error}") from None


def _column(text: str, where: str) -> str:
    column = _BY_KEY.get(re.sub(r"[\W_]", "", text).casefold())
    if column is None:
        near = hint(text, COLUMNS)
        raise DocumentError(f"{where}: {text[:MAX_CATALOGUE_TEXT]!r}: expected one of {', '.join(COLUMNS)}{near}")
    return column


# One model


def _within(low: float, high: float, unit: str) -> Meta:
    """Return the mark of a number within bounds, also as text."""
    expected = f"expected a number from {low:g} to {high:,g} [{unit}]"

    def read(value: object) -> object:
        try:
            found = float(value) if isinstance(value, str) else value
        except ValueError:
            found = None
        if not isinstance(found, int | float) or isinstance(found, bool) or not low <= found <= high:
            raise ValueError(expected)
        return found

    return about(expected, extra={"read": read})


def _read_data_id(value: object) -> int:
    text = str(value).strip() if isinstance(value, (int, str)) and not isinstance(value, bool) else ""
    if not re.fullmatch(r"[0-9]{1,10}", text) or not 0 < int(text) <= MAX_DATA_ID:
        raise ValueError("expected a number such as 30200005")
    return int(text)


def _read_name(value: object) -> object:
    if isinstance(value, str) and key_of_name(value) and len(value) <= MAX_CATALOGUE_TEXT and value.isprintable():
        return value
    raise ValueError(_A_NAME)


def _read_class(value: object) -> object:
    kind = _CLASSES.get(str(value).strip().casefold())
    if kind is None:
        raise ValueError(_A_CLASS)
    return kind


_A_NAME: Final = f"expected a name of at most {MAX_CATALOGUE_TEXT} characters"
_A_CLASS: Final = "expected vehicle, pedestrian or obstacle"
_Length = Annotated[float, _within(MIN_LENGTH, MAX_BODY_LENGTH, "m")]


class _Row(Document, frozen=True, kw_only=True):
    """A model as the file has it, by its columns."""

    data_ids: tuple[Annotated[int, Meta(extra={"read": _read_data_id})], ...] = field(name="DataID", default=())
    name: Annotated[str, about(_A_NAME, extra={"read": _read_name})]
    kind: Annotated[Kind, about(_A_CLASS, extra={"read": _read_class})] = field(name="class")
    length: _Length
    width: _Length
    height: _Length
    wheelbase: _Length | None = None
    rear_overhang: Annotated[float, _within(0.0, MAX_BODY_LENGTH, "m")] | None = None
    max_steer: Annotated[float, _within(MIN_STEER, MAX_STEER, "deg")] | None = None
    mass: Annotated[float, _within(0.0, MAX_MASS, "kg")] = 0.0

    @classmethod
    def prepare(cls, value: JsonValue) -> JsonValue:
        """Split the DataIDs, of which there may be none; the first one gives a name and a class that are missing."""
        if not isinstance(value, dict):
            return value
        ids = value.get("DataID", [])
        ids = re.split(r"[\s|]+", ids.strip()) if isinstance(ids, str) else ids if isinstance(ids, list) else [ids]
        try:
            first = _read_data_id(ids[0])
        except (ValueError, IndexError):
            return {**value, "DataID": ids}
        kind = class_of_data_id(first)
        return {"name": f"Model_{first}", **({} if kind is None else {"class": kind.name}), **value, "DataID": ids}


_ROW: Final = DocumentType[_Row](_Row)


class _MisfitError(Exception):
    """A value that does not fit the others of its row."""

    def __init__(self, column: str, text: str) -> None:
        super().__init__(text)
        self.column = column


def _model_of(row: _Row) -> Model:
    """Return a model; missing lengths of a vehicle have the proportions of the standard car.

    Raises:
        _MisfitError: a value does not fit the others.
    """
    mass, ids = row.mass or None, tuple(dict.fromkeys(row.data_ids))
    if row.kind is not Kind.VEHICLE:
        strange = next((column for column in _OF_VEHICLES if getattr(row, column) is not None), None)
        if strange is not None:
            raise _MisfitError(strange, "expected no value: only vehicles have it")
        return Model(row.name, row.kind, Body.box(row.length, row.width, row.height), ids, mass)
    like = default_model(Kind.VEHICLE).body
    wheelbase, rear = row.wheelbase, row.rear_overhang
    if wheelbase is None:
        wheelbase = round(like.wheelbase * row.length / like.length, 3)
    if rear is None:
        share = like.rear_overhang / (like.front_overhang + like.rear_overhang)
        rear = round(max(0.0, row.length - wheelbase) * share, 3)
    front = round(row.length - wheelbase - rear, 6)  # decimal numbers that add up must also add up as floats
    if front < 0.0:
        text = f"expected wheelbase and rear overhang to be at most the length, {row.length:g} m"
        column = "wheelbase" if row.rear_overhang is None else "rear_overhang"
        raise _MisfitError(column, f"{text}; got {wheelbase:g} + {rear:g}")
    body = Body(
        *(row.length, row.width, row.height),
        wheelbase=wheelbase,
        front_overhang=front,
        rear_overhang=rear,
        max_steer=like.max_steer if row.max_steer is None else math.radians(row.max_steer),
        cg_height=round(CG_SHARE * row.height, 3),
    )
    return Model(row.name, row.kind, body if mass is None else replace(body, mass=mass), ids, mass)


_OF_VEHICLES: Final = ("wheelbase", "rear_overhang", "max_steer")
