"""Values that a thread makes once."""

from __future__ import annotations

import asyncio

import pytest

from rosbridge_sim.shell.page.made_once import MadeOnce
from tests.support import PATIENCE


async def test_value_is_made_once_for_all_requests() -> None:
    values: MadeOnce[str] = MadeOnce(asyncio.get_running_loop())
    made: list[str] = []

    def make() -> str:
        made.append("x")
        return "value"

    async with asyncio.timeout(PATIENCE):
        assert await asyncio.gather(*(values.ask("a", make) for _ in range(20))) == ["value"] * 20
        assert await values.ask("a", make) == "value"
    assert len(made) == 1


async def test_failure_is_told_and_the_next_request_tries_again() -> None:
    values: MadeOnce[str] = MadeOnce(asyncio.get_running_loop())

    def fail() -> str:
        raise ValueError("no")

    async with asyncio.timeout(PATIENCE):
        with pytest.raises(ValueError, match="no"):
            await values.ask("a", fail)
        assert await values.ask("a", lambda: "value") == "value"
