"""The page `/map.json`: the map in use as one JSON text, the values of `/sim/map` as if it had one page.

The text is written by a thread, at the first request after a start or a change of the map, and kept. A program that has
it already shows its ETag, and is told so without the text.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.records import Record
from rosbridge_sim.shell.page.page_file import is_known
from rosbridge_sim.simulator.markers.map_drawing import MapDrawing
from rosbridge_sim.simulator.plain.reading import Reader
from rosbridge_sim.simulator.sim_services.road_services import RoadServices
from rosbridge_sim.version import __version__

MAX_TEXT: Final = 64 * 2**20
"""Longest text [bytes]: a million points. The socket of each program that reads it slowly holds a copy."""


class MapText(Record):
    """A map as JSON.

    Attributes:
        etag: stands for the text, with its quotes.
        body: the text; None where the asking program has it, or it is too long.
        why_not: why there is no text; empty where there is.
    """

    etag: str
    body: bytes | None = None
    why_not: str = ""


class MapPage:
    """The page of one simulator."""

    def __init__(self, loop: asyncio.AbstractEventLoop, roads: RoadServices, reader: Reader) -> None:
        """Write nothing yet.

        Args:
            loop: where requests are answered.
            roads: has the drawing of the map in use.
            reader: writes the text, in a thread.
        """
        self._loop = loop
        self._roads = roads
        self._reader = reader
        self._drawing: MapDrawing | None = None
        self._text: asyncio.Future[bytes | None] | None = None

    def ask(self, known: Sequence[str]) -> asyncio.Future[MapText] | None:
        """Return the text, once it is written; None where the settings have turned `/sim/map` off.

        Args:
            known: ETags that the asking program has, as its `If-None-Match` headers say.
        """
        if not self._roads.is_offered:
            return None
        drawing = self._roads.drawing
        etag = f'"{__version__}-{drawing.digest}"'
        answer: asyncio.Future[MapText] = self._loop.create_future()
        if is_known(etag, known):
            answer.set_result(MapText(etag))
            return answer
        if self._text is None or self._drawing is not drawing:
            self._drawing, self._text = drawing, self._write(drawing)

        def tell(text: asyncio.Future[bytes | None]) -> None:
            if answer.done() or text.cancelled():
                return
            body = text.result()
            why_not = f"The map is longer than {MAX_TEXT // 2**20} MiB; read it page by page from /sim/map\n"
            answer.set_result(MapText(etag, body, "" if body is not None else why_not))

        self._text.add_done_callback(tell)
        return answer

    def _write(self, drawing: MapDrawing) -> asyncio.Future[bytes | None]:
        """Have the text written; None is one that is too long."""
        text: asyncio.Future[bytes | None] = self._loop.create_future()

        def then(outcome: bytes | DocumentError | None, _now: float) -> None:
            if isinstance(outcome, DocumentError):  # the thread was late, or failed: the next request tries again
                self._drawing = self._text = None
                outcome = None
            text.set_result(outcome)

        self._reader.read(lambda: _join(drawing), then, self._loop.time())
        return text


def _join(drawing: MapDrawing) -> bytes | None:
    """Return the text of a map, or None if it is too long; in a thread of its own, as a rule."""
    parts: list[bytes] = []
    num_bytes = 0
    for part in drawing.write_json():
        parts.append(part)
        num_bytes += len(part)
        if num_bytes > MAX_TEXT:
            return None
    return b"".join(parts)
