"""Programs of "Copy as code", run against a server: each kind of request, in each of the three languages.

A program is run in a world in which the request does something, and the world is asked whether it did.
"""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from rosbridge_sim.client import Client
from tests import fork_server
from tests.conftest import Serve
from tests.cpu_time import run as run_to_end
from tests.support import PATIENCE, ROOT, ServerProcess, require_node_modules, require_tool

pytestmark = [pytest.mark.client, pytest.mark.slow]

LANGUAGES = ("python", "javascript", "shell")

USER = "page-test"


@cache
def programs(url: str, *words: str) -> dict[str, dict[str, Any]]:
    """Programs by the name of the page's function."""
    command = (require_tool("node"), "--disable-warning=ExperimentalWarning", "tests/page/print_code.mjs", url, *words)
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return {row["name"]: row for row in json.loads(done.stdout)}


def run(language: str, program: str, folder: Path, **env: str) -> str:
    """Run a program as a user would, and return what it printed."""
    if language == "shell":
        bin_folder = folder / "bin"
        bin_folder.mkdir(exist_ok=True)
        tool = bin_folder / "rosbridge-sim"
        tool.write_text(f'#!/bin/sh\nexec {sys.executable} -m rosbridge_sim "$@"\n')
        tool.chmod(0o755)
        words = ["sh", "-e", "-c", program]
        env["PATH"] = f"{bin_folder}{os.pathsep}{os.environ['PATH']}"
    elif language == "python":
        return output_of(program, fork_server.run(["-c", program], env={**os.environ, **env}))
    else:
        link = folder / "node_modules"
        if not link.exists():
            link.symlink_to(require_node_modules())
        (folder / "program.mjs").write_text(program)
        words = [require_tool("node"), str(folder / "program.mjs")]
    done = run_to_end(words, cwd=ROOT, env={**os.environ, **env})
    return output_of(program, done)


def output_of(program: str, done: subprocess.CompletedProcess[str]) -> str:
    assert done.returncode == 0, f"{program}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def drivers(client: Client) -> dict[str, Any]:
    message: dict[str, Any] = client.wait_for("/sim/drivers")
    return message


Check = Callable[[Client, str], bool]

EFFECTS: dict[str, Check] = {
    "pauseRequest": lambda client, _: drivers(client)["is_paused"],
    "startSyncRequest": lambda _, printed: USER in printed or "steps 1" in printed,
    "stopSyncRequest": lambda client, _: not client.wait_for("/SyncModeInfo")["status"],
    "stepRequest": lambda client, _: client.wait_for("/SyncModeInfo")["frame"] == 3,
    "snapshotRequest": lambda client, _: 'it\'s a "test"' in [one.name for one in client.snapshots()],
    "restoreRequest": lambda client, _: client.wait_for("/SyncModeInfo")["frame"] == 0,
    "snapshotsRequest": lambda client, _: [one.name for one in client.snapshots()] == ["start"],
    "resetRequest": lambda client, _: client.wait_for("/SyncModeInfo")["frame"] == 0,
    "factorRequest": lambda client, _: client.real_time_factor().factor == 2.0,
    "loadScenarioRequest": lambda client, _: client.wait_for("/sim/scene/state")["scenario"] == "town",
    "replayRequest": lambda client, _: drivers(client)["is_paused"],  # without a replay it is the simulation's pause
    "controlMessage": lambda client, _: client.wait_for("/Ego_topic")["accel"] == 0.5,
    "syncControlRequest": lambda _, printed: "true" in printed.lower(),
    "leaseRequest": lambda _, printed: "127.0.0.1:" in printed,
    "setRequest": lambda client, _: client.wait_for("/Ego_topic")["velocity"]["x"] > 1.0,
    "gearRequest": lambda client, _: drivers(client)["egos"][0]["gear"] == 2,
    "controlModeRequest": lambda client, _: drivers(client)["egos"][0]["ctrl_mode"] == 6,
    "lampsRequest": lambda client, _: base64.b64decode(client.wait_for("/sim/scene/state")["lamps"])[0] & 1 == 1,
    "moveRequest": lambda client, _: client.wait_for("/sim/scene/state")["x"][0] == -20.0,
    "spawnRequest": lambda _, printed: "unique_ids" in printed,
    "removeRequest": lambda client, _: not client.call("/sim/describe", {"id": 1})["result"],
    "lightMessage": lambda client, _: client.ask("/Morai_TLSrv", idx="TL10E")["status"] == 16,
    "scoreRequest": lambda client, _: client.score()[0]["since_frame"] == 0,
}
"""Return True if the world is as the request wants it; gets the output of the program."""

IN_REAL_TIME = {"pauseRequest", "factorRequest", "replayRequest", "controlMessage", "setRequest", "startSyncRequest"}
"""Requests that are made while real time moves the world; the others find it in synchronous mode, at frame 0."""


def test_each_request_of_the_page_has_an_effect_here() -> None:
    assert set(programs("ws://127.0.0.1:1")) == set(EFFECTS)


@pytest.fixture(scope="module")
def towns(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[bool], ServerProcess]]:
    """Gives the server in real time or the one in synchronous mode, each with the snapshot "start"."""
    servers: dict[bool, ServerProcess] = {}

    def get(is_free: bool) -> ServerProcess:  # noqa: FBT001 - the one thing that tells them apart
        if is_free not in servers:
            flags = ["--scenario", "town", *([] if is_free else ["--start", "sync"])]
            servers[is_free] = ServerProcess(tmp_path_factory.mktemp("town") / "log.txt", flags)
            with Client(servers[is_free].url, timeout=PATIENCE) as client:
                if not is_free:
                    client.start_sync(user_id=USER)
                client.snapshot("start")
        return servers[is_free]

    yield get
    for server in servers.values():
        server.stop_cleanly()


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_program_does_what_the_page_does(towns: Callable[[bool], ServerProcess], tmp_path: Path, name: str) -> None:
    is_free = name in IN_REAL_TIME
    server = towns(is_free)
    with Client(server.url, timeout=PATIENCE) as client:
        for language in LANGUAGES:
            begin_anew(client, is_free=is_free)
            printed = run(language, programs(server.url)[name][language], tmp_path)
            assert EFFECTS[name](client, printed), f"{language}\n{printed}"
        if is_free:
            pause(client, is_paused=True)  # until another test wants it


def pause(client: Client, *, is_paused: bool) -> None:
    """Stop or continue the simulation."""
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=is_paused)


def begin_anew(client: Client, *, is_free: bool) -> None:
    """Undo what a program before has done."""
    if is_free:
        pause(client, is_paused=False)
        client.real_time_factor(1.0)
    else:
        client.start_sync(user_id=USER)
    client.restore("start")
    client.snapshots(remove=[one.name for one in client.snapshots() if one.name != "start"])
    client.snapshot("kept")


@pytest.mark.parametrize("language", LANGUAGES)
def test_program_shows_the_token_of_the_environment(serve: Serve, tmp_path: Path, language: str) -> None:
    env = {"ROSBRIDGE_SIM_TOKEN": "sesame"}
    server = serve("--scenario", "town", "--start", "sync", env=env)
    program = programs(server.url, "token")["scoreRequest"][language]
    assert "sesame" not in program
    assert "since_frame" in run(language, program, tmp_path, **env)
