"""The long runs of `scripts/soak/`, in short: the same code with small numbers."""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.soak.mixed import soak

pytestmark = pytest.mark.slow


async def test_eight_kinds_of_clients_come_and_go_and_leave_nothing_behind(tmp_path: Path) -> None:
    report = await soak(4.0, 1, tmp_path, num_lines=1, longest_life=1.5)
    assert report.faults == []
    kinds = {name.removeprefix("lives of ") for name in report.num if name.startswith("lives of ")}
    assert len(kinds) == 10, "services and actions have two sides"
    for what in ("messages heard", "messages in CBOR", "commands", "ticks", "calls answered", "goals", "load"):
        assert report.num[what], f"no {what} in the whole run"
