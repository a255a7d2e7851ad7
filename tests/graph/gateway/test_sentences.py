"""Sentences about nodes, and the log that has each of them once."""

from __future__ import annotations

import logging

import pytest

from rosbridge_sim.graph.gateway.sentences import MAX_LINE, MAX_LINES, OnceLog


def test_line_is_written_once_for_each_text_or_key(caplog: pytest.LogCaptureFixture) -> None:
    log = OnceLog("rosbridge_sim.ros2")
    with caplog.at_level(logging.INFO):
        for text, key in (("a", ""), ("a", ""), ("b 1", "b"), ("b 2", "b")):
            log.tell(text, logging.INFO, key)
        log.notify("warning", "c")
    assert [(one.levelname, one.message) for one in caplog.records] == [
        ("INFO", "a"),
        ("INFO", "b 1"),
        ("WARNING", "c"),
    ]


def test_lines_are_few_short_and_printable(caplog: pytest.LogCaptureFixture) -> None:
    log = OnceLog("rosbridge_sim.ros2")
    log.tell("x" * 10_000 + "\u202e")
    for number in range(2 * MAX_LINES):
        log.tell(f"line {number}")
    assert len(caplog.records) == MAX_LINES
    assert max(len(one.message) for one in caplog.records) <= MAX_LINE + 3
