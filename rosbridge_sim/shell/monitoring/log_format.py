"""The two forms of the log: lines for people, and JSON for programs that collect logs.

Both write one line for each event. A client's text cannot begin a new line: the text form escapes it, and so does JSON.
`log_limits.py` drops and shortens lines before they come here.
"""

from __future__ import annotations

import json
import logging
from datetime import UTC, datetime
from typing import Final, Literal

_MAX_SHOWN: Final = 1_000
"""Longest message on stderr [characters]; `log_limits.py` has shortened it already, but escaping may make it ten times
longer."""


def formatter_of(log_format: Literal["text", "json"]) -> logging.Formatter:
    """Return the formatter for `--log-format`."""
    return _JsonLine() if log_format == "json" else _OneLine()


class _OneLine(logging.Formatter):
    """Lines such as `12:34:56.789 WARNING server: ...`; a client's text cannot begin a new line."""

    default_msec_format = "%s.%03d"

    def __init__(self) -> None:
        super().__init__("%(asctime)s %(levelname)s %(name)s: %(message)s", "%H:%M:%S")

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's own name
        record.name = record.name.removeprefix("rosbridge_sim.")
        record.message = "".join(c if c.isprintable() else repr(c)[1:-1] for c in record.message)[:_MAX_SHOWN]
        return super().formatMessage(record)


class _JsonLine(logging.Formatter):
    r"""JSON objects such as `{"date": "2026-01-31T12:34:56.789Z", "level": "INFO", "logger": "...", "message": "..."}`.

    The date has the form of RFC 3339, in UTC. A line about a client has its address in `client`. A line about a failure
    has the traceback in `exception`, with `\n` in it. Everything is ASCII, so no terminal or collector can fail on it.
    """

    def format(self, record: logging.LogRecord) -> str:
        """Return the record as a JSON object in one line."""
        date = datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds").removesuffix("+00:00")
        line = {
            "date": f"{date}Z",
            "level": record.levelname,
            "logger": record.name,
            "message": record.getMessage()[:_MAX_SHOWN],
        }
        if client := record.__dict__.get("client"):
            line["client"] = str(client)
        if record.exc_text or record.exc_info:
            line["exception"] = record.exc_text or self.formatException(record.exc_info)  # type: ignore[arg-type]
        if record.stack_info:
            line["stack"] = record.stack_info
        return json.dumps(line)
