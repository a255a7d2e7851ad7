"""XML documents of the user, read in pieces: elements with their lines, and values of their attributes.

OpenDRIVE and OpenSCENARIO files share this module. The children of the root come one by one, as soon as each is
complete, so that a file of 100 MB is never in memory as a whole. A DOCTYPE is refused: no road or story has one, and
its entities can make a small file large. Prefixes of names (`odr:road`) are taken off. What is within `userData`, which
is for the program that wrote the file, is not kept.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final
from xml.parsers import expat

from msgspec import Struct

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.printable import printable
from rosbridge_sim.suggestions import hint

MAX_DEPTH: Final = 64
"""Elements within one another; OpenSCENARIO has 25."""

MAX_ELEMENTS: Final = 5_000_000
"""Elements of a file: a road file of 100 MB has a million."""

TEXTS: Final = frozenset({"geoReference"})
"""Elements whose text is kept. A call for the blanks between others takes a tenth of the time of the parser."""

MAX_SHOWN: Final = 60
"""Characters of a value or an id that an error shows."""

MAX_XML_NUMBER: Final = 1e12
"""Largest number of an attribute, either way; no length, angle or factor is greater."""


class Element(Struct, eq=False, gc=False):
    """An element of a document.

    Attributes:
        tag: its name without a prefix.
        attributes: values by name.
        children: the elements in it, in order.
        text: the text directly in it, of those in `TEXTS`; empty for others.
        line: of its start tag, from 1.
        source: name of the file, for errors.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    source: str
    children: list[Element] | tuple[Element, ...] = ()  # most have none: fewer objects for Python's collector
    text: str = ""

    def all(self, tag: str) -> Iterator[Element]:
        """Return the children with this name, in order."""
        return (child for child in self.children if child.tag == tag)

    def first(self, tag: str) -> Element | None:
        """Return the first child with this name; None if there is none."""
        return next(self.all(tag), None)

    def within(self, tag: str) -> list[Element] | tuple[Element, ...]:
        """Return the children of the first child with this name; none if there is none."""
        child = self.first(tag)
        return () if child is None else child.children

    def error(self, key: str, expected: str, got: str | None = None, more: str = "") -> DocumentError:
        """Return the error for one of its attributes, or for itself where the key is empty.

        Args:
            expected: what it should be.
            got: what it is; None if that says nothing.
            more: end of the text, such as a suggestion.
        """
        known = self.attributes.get("id") or self.attributes.get("name")
        own = f"<{printable(self.tag)[:MAX_SHOWN]}>"
        if known:
            own = f"{own[:-1]} {printable(known)[:MAX_SHOWN]!r}>"
        told = "" if got is None else f", got {printable(got)[:MAX_SHOWN]!r}"
        place = f"{self.source}: line {self.line}: {own}" + (f": {key}" if key else "")
        return DocumentError(f"{place}: expected {expected}{told}{more}")

    def word(self, key: str, default: str | None = None) -> str:
        """Return an attribute as text without blanks around it.

        Raises:
            DocumentError: it is missing and there is no default.
        """
        value = self.attributes.get(key)
        if value is None:
            if default is None:
                raise self.error(key, "a value; it is missing")
            return default
        return value.strip()

    def choice(self, key: str, known: Sequence[str], default: str | None = None) -> str:
        """Return an attribute that has one of the given values.

        Raises:
            DocumentError: it is another one, or missing without a default.
        """
        value = self.word(key, default)
        if value not in known and value != default:
            raise self.error(key, f"one of {', '.join(known)}", value, hint(value, known))
        return value

    def number(
        self, key: str, default: float | None = None, low: float = -MAX_XML_NUMBER, high: float = MAX_XML_NUMBER
    ) -> float:
        """Return an attribute as a number.

        Args:
            default: used where it is missing or empty; None for a number that is needed.

        Raises:
            DocumentError: it is no number within the bounds, or missing without a default.
        """
        text = self.attributes.get(key)
        if not text and default is not None:
            return default
        try:
            value = float(text) if text else math.nan
        except ValueError:
            value = math.nan
        if low <= value <= high:
            return value
        bounds = "" if -low == high == MAX_XML_NUMBER else f" {low:,g}..{high:,g}"
        raise self.error(key, f"a number{bounds}" + ("" if text is not None else "; it is missing"), text)

    def numbers(self, keys: Sequence[str]) -> list[float]:
        """Return attributes as numbers, 0 where one is missing or empty.

        Raises:
            DocumentError: as for `number`.
        """
        try:
            found = list(map(float, map(self.attributes.__getitem__, keys)))
        except (KeyError, ValueError):
            found = [math.nan]
        if sum(map(abs, found)) <= MAX_XML_NUMBER:  # nan is not
            return found
        return [self.number(key, 0.0) for key in keys]

    def whole(self, key: str, default: int | None = None, most: int = 1_000_000) -> int:
        """Return an attribute as a whole number.

        Raises:
            DocumentError: as for `number`.
        """
        value = self.number(key, default, -most, most)
        if value != int(value):
            raise self.error(key, "a whole number", self.attributes[key])
        return int(value)


def read_children(pieces: Iterable[bytes], source: str, root: str) -> Iterator[Element]:
    """Yield the root of a document, which is still empty, and then each of its children when it is complete.

    Args:
        pieces: the file's bytes, in pieces of any length.
        source: name of the file, for errors.
        root: name of the root; another one is refused.

    Raises:
        DocumentError: it is not XML, has a DOCTYPE or another root, or exceeds a limit.
    """
    builder = _Builder(source, root)
    for piece in pieces:
        builder.feed(piece)
        yield from builder.take()
    builder.feed(b"", is_last=True)
    yield from builder.take()


def read_whole(content: bytes, source: str, root: str) -> Element:
    """Return the root of a document with all that is in it; see `read_children`."""
    found = read_children((content,), source, root)
    whole = next(found)
    whole.children = list(found)
    return whole


class _Builder:
    """The elements of a document under construction; children of the root leave it when they are complete."""

    def __init__(self, source: str, root: str) -> None:
        self._source, self._root = source, root
        self._open: list[Element] = []
        self._done: list[Element] = []
        self._num = 0
        self._skipped = 0  # depth within elements of other programs
        self._parser = parser = expat.ParserCreate()
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.StartDoctypeDeclHandler = self._refuse_doctype

    def feed(self, piece: bytes, *, is_last: bool = False) -> None:
        try:
            self._parser.Parse(piece, is_last)
        except expat.ExpatError as error:
            raise self._error(f"not XML: {expat.ErrorString(error.code)}", error.lineno) from None
        except (LookupError, ValueError) as error:  # an encoding that Python does not know, or of several bytes
            raise self._error(f"cannot be decoded: {printable(str(error))[:MAX_SHOWN]}") from None

    def take(self) -> list[Element]:
        done, self._done = self._done, []
        return done

    def _error(self, text: str, line: int | None = None) -> DocumentError:
        return DocumentError(f"{self._source}: line {line or self._parser.CurrentLineNumber}: {text}")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._num += 1
        if self._open and (self._skipped or self._open[-1].tag == "userData"):
            self._skipped += 1
            return
        tag = name.rpartition(":")[2] if ":" in name else name
        element = Element(tag, attributes, self._parser.CurrentLineNumber, self._source)
        if not self._open:
            if tag != self._root:
                raise self._error(f"expected <{self._root}> as the root, got <{printable(tag)[:MAX_SHOWN]}>")
            self._done.append(element)
        if len(self._open) >= MAX_DEPTH:
            raise self._error(f"expected at most {MAX_DEPTH} elements within one another")
        if self._num > MAX_ELEMENTS:
            raise self._error(f"expected at most {MAX_ELEMENTS:,} elements")
        if tag in TEXTS:
            self._parser.CharacterDataHandler = self._add_text
        self._open.append(element)

    def _end(self, _: str) -> None:
        if self._skipped:
            self._skipped -= 1
            return
        element = self._open.pop()
        if element.tag in TEXTS:
            self._parser.CharacterDataHandler = None
        if len(self._open) > 1:
            parent = self._open[-1]
            if isinstance(parent.children, list):
                parent.children.append(element)
            else:
                parent.children = [element]
        elif self._open:
            self._done.append(element)

    def _add_text(self, text: str) -> None:
        self._open[-1].text += text

    def _refuse_doctype(self, *_: object) -> None:
        raise self._error("a DOCTYPE is refused; take it and its entities out")
