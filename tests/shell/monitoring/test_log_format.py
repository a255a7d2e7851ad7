"""The forms of the log: one line for each event, whatever it holds, and JSON that a collector can read."""

from __future__ import annotations

import json
import logging
import re
import sys
from typing import Literal

import pytest

from rosbridge_sim.shell.monitoring.log_format import formatter_of
from tests import fork_server
from tests.conftest import Serve

NASTY = 'a "b"\n{"level": "INFO"}\r\x1b[31m 한 \ud800 \u2028'


def record_of(message: str, **fields: object) -> logging.LogRecord:
    record = logging.LogRecord("rosbridge_sim.server", logging.WARNING, __file__, 1, "%s", (message,), None)
    record.created = 1_700_000_000.5
    record.__dict__.update(fields)
    return record


def test_json_line_has_date_level_logger_and_message() -> None:
    line = formatter_of("json").format(record_of("hello"))
    assert json.loads(line) == {
        "date": "2023-11-14T22:13:20.500Z",
        "level": "WARNING",
        "logger": "rosbridge_sim.server",
        "message": "hello",
    }


def test_json_line_names_the_client_that_a_line_is_about() -> None:
    line = json.loads(formatter_of("json").format(record_of("refused", client="127.0.0.1:5")))
    assert line["client"] == "127.0.0.1:5"


@pytest.mark.parametrize("log_format", ["text", "json"])
def test_what_a_client_writes_begins_no_line_of_its_own(log_format: Literal["text", "json"]) -> None:
    line = formatter_of(log_format).format(record_of(NASTY))
    assert line.isprintable()
    assert line.encode()
    if log_format == "json":
        assert json.loads(line)["message"] == NASTY
        assert line.isascii()


def test_long_message_is_cut_in_both_forms() -> None:
    assert len(json.loads(formatter_of("json").format(record_of("x" * 5_000)))["message"]) == 1_000
    assert len(formatter_of("text").format(record_of("x" * 5_000))) < 1_100


def test_exception_is_a_field_of_the_same_line() -> None:
    try:
        int(NASTY)
    except ValueError:
        record = record_of("failed", exc_info=sys.exc_info())
    line = formatter_of("json").format(record)
    assert "\n" not in line
    exception = json.loads(line)["exception"]
    assert exception.startswith("Traceback (most recent call last):\n")
    assert "ValueError" in exception
    record.exc_text = "cut by the limits"
    assert json.loads(formatter_of("json").format(record))["exception"] == "cut by the limits"


@pytest.mark.slow
def test_every_line_of_a_server_is_json_and_the_limits_hold(serve: Serve) -> None:
    server = serve("--log-format", "json", "--log-level", "debug", "--host", "127.0.0.1")
    assert server.stop() == 0
    lines = [json.loads(line) for line in server.log.splitlines()]
    assert "SIGTERM: stopping" in [line["message"] for line in lines]
    for line in lines:
        assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", line["date"])
        assert len(line["message"]) <= 600


@pytest.mark.slow
def test_start_that_fails_is_json_too() -> None:
    words = ["--port", "0", "--log-format", "json", "--scenario", "nothing"]
    done = fork_server.run(["-m", "rosbridge_sim", *words])
    lines = [json.loads(line) for line in done.stderr.splitlines()]
    assert (done.returncode, done.stdout, len(lines)) == (2, "", 1)
    assert (lines[0]["level"], lines[0]["message"][:22]) == ("CRITICAL", "no scenario 'nothing';")
