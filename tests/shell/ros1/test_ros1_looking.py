"""`ros1 check` at a master and a server over sockets."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.cli.command_table import TOOLS
from tests.shell.ros1.small_ros1 import SmallMaster


def run(words: list[str]) -> int:
    return TOOLS[words[0]](words[1:])


async def test_the_command_sees_a_server_and_that_there_is_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_HOSTNAME", "localhost")
    master = await SmallMaster().start()
    async with Simulator(port=0, world=False, data_dir=tmp_path, ros1_master=master.uri):
        assert await asyncio.to_thread(run, ["ros1", "check", "--master", master.uri, "--json"]) == 0
        found = {one["step"]: one for one in json.loads(capsys.readouterr().out)}
        assert "services of the server" in found["what is there"]["text"]
        assert await asyncio.to_thread(run, ["ros1", "check", "--master", master.uri, "--name", "/other"]) == 1
        assert "2. server: WRONG: no node /other is on the graph\n   -> start the server" in capsys.readouterr().out
    monkeypatch.setenv("ROS_MASTER_URI", master.uri)
    master.server.stop()
    assert await asyncio.to_thread(run, ["ros1", "check"]) == 1
    assert f"1. master: WRONG: {master.uri}: getSystemState: " in capsys.readouterr().out
