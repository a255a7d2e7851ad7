"""`rosbridge-sim mock fault` lists the faults of a running mock, switches them, and adds new ones."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

from rosbridge_sim import Simulator
from tests.cli.tool_fixture import Result, run


async def test_faults_are_listed_switched_and_added(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text("faults: {lost: {kind: drop, topics: [/a, /b], on: false}}")
    async with Simulator(port=0, mock=str(path)) as simulator:

        async def fault(*words: str) -> Result:
            return await asyncio.to_thread(run, "mock", "fault", *words, "--url", simulator.url)

        listed = await fault()
        assert [line.split() for line in listed.lines] == [
            ["FAULT", "KIND", "DIRECTION", "NOW", "COUNT", "NAMES", "CLIENTS"],
            ["lost", "drop", "to_clients", "off", "0", "/a", "/b", "all"],
        ]
        added = await fault("no", "{kind: fail, direction: from_clients, clients: [2, '10.0.0.*']}")
        assert added.lines[-1].split() == ["no", "fail", "from_clients", "on", "0", "all", "2", "10.0.0.*"]
        switched = json.loads((await fault("lost", "--json")).out)
        assert [(one["name"], one["active"]) for one in switched] == [("lost", True), ("no", True)]
        refused = await fault("lots", "off")
        assert refused.code == 1
        assert "did you mean lost?" in refused.complaint
        wrong = await fault("x", "{kind: nan, direction: from_clients}")
        assert "expected kind delay, drop, duplicate, freeze, fail with direction from_clients" in wrong.complaint
