"""Fixtures of this room: a mirror that is attached, and what was logged of a far side."""

from __future__ import annotations

import logging
from collections.abc import Callable

import pytest

from tests.graph.attach.mirror_harness import SimHarness


@pytest.fixture
def harness() -> SimHarness:
    harness = SimHarness()
    harness.attach()
    return harness


@pytest.fixture
def lines(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    """What was logged since the last look."""
    caplog.set_level(logging.INFO, "rosbridge_sim.attach")

    def look() -> list[str]:
        found = [record.getMessage() for record in caplog.records if record.name == "rosbridge_sim.attach"]
        caplog.clear()
        return found

    return look
