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
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.records import Record, replace
from rosbridge_sim.scenarios.catalogue import Catalogue, Model, class_of_data_id, default_model, key_of_name
from rosbridge_sim.shell.config.value_types import show_size
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

    def at(self, column: str) -> str:
        """Return the place of a column, for errors."""
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
    text = _read_text(path)
    entries = list(_toml_entries(text, path) if suffix == ".toml" else _csv_entries(text, path))
    if not entries:
        raise DocumentError(f"{path}: expected at least one model, {_EXAMPLES[suffix]}; found none")
    mistakes: list[str] = []
    models = []
    taken: dict[tuple[object, ...], str] = {}
    for entry in entries:
        reader = _Reader(entry)
        model = reader.model()
        mistakes += reader.mistakes
        if model is None:
            continue
        ids = [((model.kind, data_id), f"DataID {data_id}") for data_id in model.data_ids]
        for key, what in [*ids, ((key_of_name(model.name),), f"name {model.name!r}")]:
            first = taken.setdefault(key, entry.where)
            if first is not entry.where:
                column = what.partition(" ")[0]
                mistakes.append(f"{entry.at(column)}: {what.partition(' ')[2]} is already used at {first}")
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


def _read_text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(MAX_FILE_SIZE + 1)
    except OSError as error:
        raise DocumentError(f"{path}: cannot be read: {error.strerror}") from None
    if len(content) > MAX_FILE_SIZE:
        raise DocumentError(f"{path}: expected a catalogue; it is longer than {show_size(MAX_FILE_SIZE)}")
    try:
        # A spreadsheet program may write either line end, and a byte-order mark at the start.
        return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise DocumentError(f"{path}:{line}: expected UTF-8 text") from None


# The two forms


def _toml_entries(text: str, path: Path) -> Iterator[_Entry]:
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise DocumentError(f"{path}: not valid TOML: {error}") from None
    except (ValueError, RecursionError):  # a number of thousands of digits, or deeply nested brackets
        raise DocumentError(
            f"{path}: not valid TOML: a number is too long, or brackets are nested too deeply"
        ) from None
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
            raise DocumentError(f"{where}: expected a table, got {_shown(values)}")
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


class _Reader:
    """Conversion of one entry into one model.

    Attributes:
        mistakes: one line each.
    """

    def __init__(self, entry: _Entry) -> None:
        self._entry = entry
        self.mistakes: list[str] = []

    def model(self) -> Model | None:
        """Return the model; None if there are mistakes."""
        data_ids = self._data_ids()
        name = self._name(data_ids)
        kind = self._kind(data_ids)
        size = [self._number(column, (MIN_LENGTH, MAX_BODY_LENGTH), "m") for column in ("length", "width", "height")]
        mass = self._number("mass", (0.0, MAX_MASS), "kg", 0.0) or None
        body = self._body_on_wheels(*size) if kind is Kind.VEHICLE else self._box(*size)
        if body is not None and mass is not None and kind is Kind.VEHICLE:
            body = replace(body, mass=mass)
        return None if kind is None or body is None else Model(name, kind, body, data_ids, mass)

    def _box(self, length: float, width: float, height: float) -> Body | None:
        strange = next((column for column in _OF_VEHICLES if column in self._entry.values), None)
        if strange is not None and not self.mistakes:
            self._tell(strange, "expected no value: only vehicles have it")
        return None if self.mistakes else Body.box(length, width, height)

    def _body_on_wheels(self, length: float, width: float, height: float) -> Body | None:
        """Return a vehicle's body; missing lengths have the proportions of the standard car."""
        like = default_model(Kind.VEHICLE).body
        wheelbase = self._number(
            "wheelbase", (MIN_LENGTH, MAX_BODY_LENGTH), "m", round(like.wheelbase * length / like.length, 3)
        )
        share = like.rear_overhang / (like.front_overhang + like.rear_overhang)
        rear = self._number(
            "rear_overhang", (0.0, MAX_BODY_LENGTH), "m", round(max(0.0, length - wheelbase) * share, 3)
        )
        max_steer = self._number("max_steer", (MIN_STEER, MAX_STEER), "deg", math.degrees(like.max_steer))
        if self.mistakes:
            return None
        front = round(length - wheelbase - rear, 6)  # decimal numbers that add up must also add up as floats
        if front < 0.0:
            text = f"expected wheelbase and rear overhang to be at most the length, {length:g} m"
            column = "rear_overhang" if "rear_overhang" in self._entry.values else "wheelbase"
            self._tell(column, f"{text}; got {wheelbase:g} + {rear:g}")
            return None
        return Body(
            *(length, width, height),
            wheelbase=wheelbase,
            front_overhang=front,
            rear_overhang=rear,
            max_steer=math.radians(max_steer),
            cg_height=round(CG_SHARE * height, 3),
        )

    def _name(self, data_ids: tuple[int, ...]) -> str:
        """Return the name; if it is missing, one made from the DataID."""
        name = self._entry.values.get("name", f"Model_{data_ids[0]}" if data_ids else "")
        if isinstance(name, str) and key_of_name(name) and len(name) <= MAX_CATALOGUE_TEXT and name.isprintable():
            return name
        self._tell("name", f"expected a name of at most {MAX_CATALOGUE_TEXT} characters, got {_shown(name)}")
        return ""

    def _kind(self, data_ids: tuple[int, ...]) -> Kind | None:
        """Return the given class, or the class that belongs to the DataID."""
        text = self._entry.values.get("class")
        kind = class_of_data_id(data_ids[0]) if text is None and data_ids else None
        if text is not None:
            kind = _CLASSES.get(str(text).strip().casefold())
        if kind is None:
            came = "" if text is None else f", got {_shown(text)}"
            self._tell("class", f"expected vehicle, pedestrian or obstacle{came}")
        return kind

    def _data_ids(self) -> tuple[int, ...]:
        """Return the DataIDs of a model: none, one or several."""
        value = self._entry.values.get("DataID", [])
        parts = re.split(r"[\s|]+", value.strip()) if isinstance(value, str) else value
        ids = []
        for part in parts if isinstance(parts, list) else [parts]:
            is_number = isinstance(part, (int, str)) and not isinstance(part, bool)
            text = str(part).strip()
            if not is_number or not re.fullmatch(r"[0-9]{1,10}", text) or not 0 < int(text) <= MAX_DATA_ID:
                self._tell("DataID", f"expected a number such as 30200005, got {_shown(part)}")
            else:
                ids.append(int(text))
        return tuple(dict.fromkeys(ids))

    def _number(self, column: str, bounds: tuple[float, float], unit: str, default: float | None = None) -> float:
        """Return a number; NaN after a mistake."""
        value = self._entry.values.get(column, default)
        low, high = bounds
        if value is None:
            self._tell(column, f"missing; expected a number from {low:g} to {high:,g} [{unit}]")
            return math.nan
        if isinstance(value, float) and math.isnan(value) and column not in self._entry.values:
            return math.nan  # it is computed from another number that is wrong
        number = math.nan
        if isinstance(value, (str, int, float)) and not isinstance(value, bool):
            try:
                number = float(value)
            except (ValueError, OverflowError):
                number = math.nan
        if not low <= number <= high:
            self._tell(column, f"expected a number from {low:g} to {high:,g} [{unit}], got {_shown(value)}")
            return math.nan
        return number

    def _tell(self, column: str, text: str) -> None:
        self.mistakes.append(f"{self._entry.at(column)}: {text}")


_OF_VEHICLES: Final = ("wheelbase", "rear_overhang", "max_steer")


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= MAX_CATALOGUE_TEXT else f"{text[:MAX_CATALOGUE_TEXT]}..."
