"""The released client libraries, each in a process of its own: they find their way about, drive, serve and call."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.support import PATIENCE, ServerProcess, read_line, require_node_modules, require_tool

pytestmark = [pytest.mark.client, pytest.mark.slow]

CLIENTS = Path(__file__).parent / "clients"

LIBRARIES = ("roslibpy-twisted", "roslibpy-asyncio", "roslib2", "roslib1")

PAIRS = (  # each library serves once and calls once, Python and JavaScript for each other
    ("roslibpy-twisted", "roslib2"),
    ("roslibpy-asyncio", "roslib1"),
    ("roslib2", "roslibpy-asyncio"),
    ("roslib1", "roslibpy-twisted"),
)


def start(library: str, port: int, *words: str) -> subprocess.Popen[str]:
    if library.startswith("roslibpy"):
        command = [sys.executable, str(CLIENTS / "roslibpy_client.py"), library.partition("-")[2]]
    else:
        require_node_modules()
        script = {"roslib2": "roslib2_client.mjs", "roslib1": "roslib1_client.cjs"}[library]
        command = [require_tool("node"), str(CLIENTS / script)]
    pipe = subprocess.PIPE
    return subprocess.Popen([*command, str(port), *words], stdin=pipe, stdout=pipe, stderr=pipe, text=True)


def finish(process: subprocess.Popen[str]) -> dict[str, Any]:
    """What the client said last, once it has ended well."""
    with process:
        out, err = process.communicate(timeout=3 * PATIENCE)
    assert process.returncode == 0, f"the client ended with {process.returncode}:\n{out}\n{err}"
    seen: dict[str, Any] = json.loads(out.splitlines()[-1]) if out.strip() else {}
    return seen


@pytest.mark.parametrize("library", LIBRARIES)
def test_a_client_finds_its_way_and_drives_the_car(server: ServerProcess, library: str) -> None:
    seen = finish(start(library, server.port, "drive"))
    assert {"/Ego_topic", "/Object_topic", "/ctrl_cmd", "/SyncModeInfo", "/clock", "/rosout"} <= set(seen["topics"])
    assert seen["topic_type"] == "morai_msgs/EgoVehicleStatus"
    assert {"/SyncModeCmd", "/SyncModeWaitForTick", "/rosapi/topics"} <= set(seen["services"])
    assert "/morai_sim" in seen["nodes"]
    assert seen["time"] > 0.0
    assert seen["param"] == {"text": "안녕", "list": [1, 2.5, None]}
    assert math.dist(seen["first"], seen["last"]) > 2.0


@pytest.mark.parametrize(("provider", "caller"), PAIRS)
def test_a_service_of_one_client_answers_another(server: ServerProcess, provider: str, caller: str) -> None:
    name = f"/{provider}_{caller}/add".replace("-", "_")
    serving = start(provider, server.port, "serve", name)
    try:
        assert json.loads(read_line(serving)) == {"ready": "example_interfaces/AddTwoInts"}
        seen = finish(start(caller, server.port, "call", name))
    finally:
        finish(serving)  # closes its stdin, which tells it to go
    assert seen == {"sum": 42, "is_refused": True}
