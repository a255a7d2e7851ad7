"""`ros2 check` beside a real server in another process, on loopback."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.tool_fixture import run
from tests.shell.ros2.dds_program import domain_of
from tests.support import ServerProcess

DOMAIN = domain_of(5)

pytestmark = pytest.mark.slow


@pytest.fixture(params=["sync"])
def server(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[ServerProcess]:
    program = serve(tmp_path / "log", "--start", request.param)
    yield program
    program.stop_cleanly()


def serve(log: Path, *flags: str) -> ServerProcess:
    topics = [part for topic in ("/clock", "/tf", "/tf_static") for part in ("--ros2-topics", topic)]
    return ServerProcess(log, ["--ros2-domain", str(DOMAIN), *topics, *flags])


def test_the_check_finds_the_server_and_names_what_the_variables_lack(
    server: ServerProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert server.is_alive
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    done = run("ros2", "check", "--wait", "20")
    assert (done.code, done.err) == (0, "")
    assert done.lines[0] == f"1. domain: ok: /rosbridge_sim is in domain {DOMAIN}"
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE")
    done = run("ros2", "check", "--wait", "20", "--json")
    assert done.code == 1
    (finding,) = [one for one in json.loads(done.out) if not one["is_good"]]
    assert finding["advice"] == "export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_of(6)))
    done = run("ros2", "check", "--wait", "0.1")
    assert done.code == 1
    assert f"1. domain: WRONG: no server is in domain {domain_of(6)}" in done.lines
    assert any(str(DOMAIN) in line for line in done.lines if "->" in line)


@pytest.mark.usefixtures("server")
@pytest.mark.parametrize("server", ["run"], indirect=True)  # else no frames are published
def test_a_second_server_in_the_domain_is_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    second = serve(tmp_path / "second")
    done = run("ros2", "check", "--wait", "20", "--json")
    second.stop_cleanly()
    assert done.code == 1
    (finding,) = [one for one in json.loads(done.out) if not one["is_good"]]
    clock, frames = finding["text"].splitlines()
    assert clock.startswith("two publish /clock: /rosbridge_sim (GUID 01.10.")
    assert frames.startswith("two publish frame base_link, front_left_wheel, ")
