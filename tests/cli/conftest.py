"""Fixtures of the command line: connections that get more time than the flag `--timeout` gives.

That flag is the longest wait for a handshake, for an answer and for a message alike. A test in which one of them never
comes gives it little time, in which a busy machine may not even shake hands.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from rosbridge_sim.cli.tools import sync_commands, tool_client
from rosbridge_sim.cli.tools.tool_client import Bridge, open_bridge
from tests.support import PATIENCE


@pytest.fixture
def patient_handshakes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have `--timeout` hold for answers and messages alone."""

    @asynccontextmanager
    async def open_patiently(url: str, token: str | None, patience: float) -> AsyncIterator[Bridge]:
        async with open_bridge(url, token, PATIENCE) as bridge:
            bridge.patience = patience
            yield bridge

    monkeypatch.setattr(tool_client, "open_bridge", open_patiently)


@pytest.fixture
def patient_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have `--timeout` hold for messages alone."""

    @asynccontextmanager
    async def open_patiently(url: str, token: str | None, patience: float) -> AsyncIterator[Bridge]:
        async with open_bridge(url, token, max(patience, PATIENCE)) as bridge:
            yield bridge

    monkeypatch.setattr(tool_client, "open_bridge", open_patiently)
    monkeypatch.setattr(sync_commands, "INFO_PATIENCE", PATIENCE)
