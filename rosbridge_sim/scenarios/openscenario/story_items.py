"""Elements -> items with values: the grammar, parameters, expressions and catalogues of a file.

An item has no XML: its values are numbers, truths and texts, and its parts are items. All mistakes of a file, and all
that is refused, are collected with their lines, before anything is made of it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

from rosbridge_sim.documents.xml_documents import Element
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.expressions import Value, parse_expression
from rosbridge_sim.printable import printable
from rosbridge_sim.scenarios.openscenario.grammar import GRAMMAR, LEFT_OUT, AttributeRow
from rosbridge_sim.scenarios.openscenario.story_records import Findings, StoryItem
from rosbridge_sim.suggestions import hint

MAX_NUMBER: Final = 1e9
"""Bound of all numbers: that of the world's coordinates."""

MAX_ITEMS: Final = 100_000
"""Most elements that are read, those of catalogues as often as they are referred to."""

MAX_CATALOGUE_DEPTH: Final = 8
"""Deepest reference from a catalogue to a catalogue."""

MAX_LINES: Final = 200
"""Most lines that are collected of one sort."""


def place_of(element: Element) -> str:
    """Return file and line of an element, as the beginning of an error text."""
    return f"{element.source}: line {element.line}"


def _tell(lines: list[str], line: str) -> None:
    if len(lines) < MAX_LINES and line not in lines:
        lines.append(line)


_SILENT: Final = frozenset(
    {"License", "CatalogLocations", "File", "ConstraintGroup", "SceneGraphFile", "UsedArea", "TrailerHitch", "Trailer"}
)
"""Elements without effect that are left out without a remark."""

_REFERENCE: Final = {key: AttributeRow("text", (), is_needed=True) for key in ("catalogName", "entryName")}
_EXPRESSION: Final = re.compile(r"\$\{(.*)\}", re.DOTALL)
_PARAMETER: Final = re.compile(r"\$([A-Za-z_][\w.-]*)")
_TRUTHS: Final = {"true": True, "1": True, "false": False, "0": False}


def _as_value(text: str) -> Value:
    """Return a parameter's text as a value of an expression."""
    if text in {"true", "false"}:
        return text == "true"
    try:
        number = float(text)
    except ValueError:
        return text
    return number if math.isfinite(number) else text


def evaluate(text: str, parameters: Mapping[str, str], where: str) -> str:
    """Return a text with its parameter or expression replaced by the value.

    Args:
        text: `$name`, `${expression}`, or any other text, which stays as it is.
        parameters: values by name.

    Raises:
        DocumentError: there is no such parameter, or the expression cannot be computed.
    """
    found = _EXPRESSION.fullmatch(text.strip())
    if found is None:
        name = _PARAMETER.fullmatch(text.strip())
        if name is None:
            return text[1:] if text.startswith("\\$") else text
        return _parameter(name[1], parameters, where)
    values: dict[str, Value] = {"true": True, "false": False}

    def use(name: re.Match[str]) -> str:
        values[f"p{len(values)}"] = _as_value(_parameter(name[1], parameters, where))
        return f" p{len(values) - 1} "

    expression = parse_expression(_PARAMETER.sub(use, found[1]), where, frozenset(values))
    value = expression(values)
    return str(value).lower() if isinstance(value, bool) else str(value)


def _parameter(name: str, parameters: Mapping[str, str], where: str) -> str:
    if name not in parameters:
        shown = printable(name, 60)
        raise DocumentError(f"{where}: no parameter ${shown}{hint(name, parameters)}")
    return parameters[name]


class StoryItemReader:
    """Reads the elements of one file, and of the catalogues that it refers to."""

    def __init__(self, catalogues: Mapping[str, Mapping[str, Element]], *, is_lenient: bool) -> None:
        """Begin without findings.

        Args:
            catalogues: name -> name of an entry -> the entry.
            is_lenient: leave out what is refused, where the rest means something without it.
        """
        self.findings = Findings()
        self.entities: frozenset[str] | None = None
        self._catalogues, self._is_lenient = catalogues, is_lenient
        self._num, self._depth = 0, 0

    def read(
        self, element: Element, parameters: Mapping[str, str], given: Mapping[str, str] | None = None
    ) -> StoryItem | None:
        """Return an element as an item; None if something in it is wrong or refused, which the findings tell.

        Args:
            parameters: values by name.
            given: values that count in place of those that the element itself declares.
        """
        row = GRAMMAR.get(element.tag)
        self._num += 1
        if row is None or row.is_refused:
            self._refuse(element, "")
            return None
        if row.is_idle or self._num > MAX_ITEMS:
            if self._num > MAX_ITEMS:
                _tell(self.findings.mistakes, f"{element.source}: expected at most {MAX_ITEMS:,} elements")
            if element.tag not in _SILENT:
                _tell(self.findings.idle, f"{place_of(element)}: {element.tag} has no effect")
            return StoryItem(element.tag, {}, (), place_of(element))
        parameters = self.declare(element, parameters, given or {})
        values = self._values(element, row.attributes, parameters)
        parts = self._parts(element, parameters)
        if values is None or parts is None:
            return None
        return StoryItem(element.tag, values, parts, place_of(element))

    def declare(self, element: Element, parameters: Mapping[str, str], given: Mapping[str, str]) -> dict[str, str]:
        """Return the parameters that hold within an element: those around it, those that it declares, and the given."""
        own = {**parameters, **given}
        for each in element.within("ParameterDeclarations"):
            name, text = each.attributes.get("name"), each.attributes.get("value")
            if name and text is not None and name not in given:
                own[name] = self._evaluated(text, own, f"{place_of(each)}: {name}") or ""
        return own

    def _evaluated(self, text: str, parameters: Mapping[str, str], where: str) -> str | None:
        try:
            return evaluate(text, parameters, where)
        except DocumentError as error:
            _tell(self.findings.mistakes, str(error))
            return None

    def _values(
        self, element: Element, rows: Mapping[str, AttributeRow], parameters: Mapping[str, str]
    ) -> dict[str, Any] | None:
        """Return the values of an element's attributes; None if one is missing or wrong."""
        values: dict[str, Any] = {}
        is_good = True
        for name, row in rows.items():
            text = element.attributes.get(name)
            where = f"{place_of(element)}: {element.tag}.{name}"
            if text is None:
                if row.is_needed:
                    _tell(self.findings.mistakes, f"{where}: expected this attribute, there is none")
                    is_good = False
                continue
            try:
                values[name] = self._value(text, row, parameters, where)
            except DocumentError as error:
                _tell(self.findings.mistakes, str(error))
                is_good = False
        for name in element.attributes:
            if name not in rows and ":" not in name and name != "xmlns":
                shown = printable(name, 60)
                _tell(
                    self.findings.notes,
                    f"{place_of(element)}: {element.tag} has no attribute {shown!r}{hint(name, rows)}; it is not read",
                )
        return values if is_good else None

    def _value(self, text: str, row: AttributeRow, parameters: Mapping[str, str], where: str) -> object:
        """Return a value of an attribute.

        Raises:
            DocumentError: it is none.
        """
        if row.kind == "label":  # esmini's files have anything there
            try:
                return evaluate(text, parameters, where)
            except DocumentError:
                return text
        text = evaluate(text, parameters, where)
        shown = printable(text, 60)
        if row.words:
            if text not in row.words:
                raise DocumentError(f"{where}: expected {' or '.join(row.words)}, got {shown!r}{hint(text, row.words)}")
            return text
        if row.kind == "bool":
            if text not in _TRUTHS:
                raise DocumentError(f"{where}: expected true or false, got {shown!r}")
            return _TRUTHS[text]
        if row.kind in {"number", "count", "whole"}:
            return self._number(text, row.kind, where, shown)
        if row.kind == "entity" and self.entities is not None and text not in self.entities:
            raise DocumentError(f"{where}: no entity {shown!r}{hint(text, self.entities)}")
        return text

    def _number(self, text: str, kind: str, where: str, shown: str) -> float | int:
        try:
            number = float(text)
        except ValueError:
            raise DocumentError(f"{where}: expected a number, got {shown!r}") from None
        if not abs(number) <= MAX_NUMBER:
            raise DocumentError(f"{where}: expected a number within +-{MAX_NUMBER:g}, got {shown!r}")
        if kind == "number":
            return number
        if not number.is_integer() or (kind == "count" and number < 0):
            what = "a whole number, 0 or more" if kind == "count" else "a whole number"
            raise DocumentError(f"{where}: expected {what}, got {shown!r}")
        return int(number)

    def _parts(self, element: Element, parameters: Mapping[str, str]) -> tuple[StoryItem, ...] | None:
        """Return the parts of an element; None if one is missing, wrong, or refused and cannot be left out."""
        row = GRAMMAR[element.tag]
        items: list[StoryItem] = []
        is_good = True
        found = [0] * len(row.parts)
        for child in element.children:
            entry, given = child, dict[str, str]()
            if child.tag == "CatalogReference":
                referred = self._refer(child, parameters)
                if referred is None:
                    is_good = False
                    continue
                entry, given = referred
            place = row.part_of(entry.tag)
            if place is None:
                self._refuse(entry, f" in {element.tag}", [tag for part in row.parts for tag in part.tags])
                is_good = False
                continue
            found[row.parts.index(place)] += 1
            self._depth += entry is not child
            item = self.read(entry, parameters, given)
            self._depth -= entry is not child
            if item is not None:
                items.append(item)
            elif not (self._is_lenient and place.is_many and child.tag in LEFT_OUT):
                is_good = False
        for part, num in zip(row.parts, found, strict=True) if is_good else ():
            what = " or ".join(part.tags)
            if (num == 0 and part.is_needed) or (num > 1 and not part.is_many):
                text = f"{element.tag}: expected one {what} in it, got {num or 'none'}"
                _tell(self.findings.mistakes, f"{place_of(element)}: {text}")
                is_good = False
        is_left_out = element.tag == "StartTrigger" and element.children and not items  # else it would start at once
        return tuple(items) if is_good and not is_left_out else None

    def _refuse(self, element: Element, place: str, known: Sequence[str] = ()) -> None:
        tag = printable(element.tag, 60)
        if element.tag in GRAMMAR and not known:
            _tell(self.findings.refused, f"{place_of(element)}: {tag} is not supported")
            return
        near = hint(element.tag, known) or (f"; expected {', '.join(known[:12])}" if known else "")
        _tell(self.findings.refused, f"{place_of(element)}: no element {tag!r} is known{place}{near}")

    def _refer(self, element: Element, parameters: Mapping[str, str]) -> tuple[Element, dict[str, str]] | None:
        """Return the entry of a catalogue, and the parameters that the reference assigns; None if there is no entry."""
        values = self._values(element, _REFERENCE, parameters)
        if values is None:
            return None
        catalogue, name = values["catalogName"], values["entryName"]
        known = self._catalogues.get(catalogue)
        wrong = ""
        if known is None:
            there = ", ".join(sorted(self._catalogues)[:12]) or "none"
            shown = f"no catalogue {printable(catalogue, 60)!r}{hint(catalogue, self._catalogues)}; found are {there}"
            wrong = f".catalogName: {shown}"
        elif name not in known:
            wrong = f".entryName: {printable(catalogue, 60)} has no entry {printable(name, 60)!r}{hint(name, known)}"
        elif self._depth >= MAX_CATALOGUE_DEPTH:
            wrong = ": catalogues refer to each other without end"
        if known is None or wrong:
            _tell(self.findings.mistakes, f"{place_of(element)}: CatalogReference{wrong}")
            return None
        given: dict[str, str] = {}
        for each in element.within("ParameterAssignments"):
            parameter = each.attributes.get("parameterRef", "").removeprefix("$")
            text = each.attributes.get("value", "")
            given[parameter] = self._evaluated(text, parameters, f"{place_of(each)}: {parameter}") or ""
        return known[name], given
