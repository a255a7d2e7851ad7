"""`rosbridge-sim doctor` with this server, with a server without rosapi, and with servers that are wrong."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from contextlib import suppress
from http import HTTPStatus
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree as ET

import pytest
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from rosbridge_sim import Simulator, SimulatorOptions
from rosbridge_sim.cli.doctor.doctor_run import all_checks
from rosbridge_sim.link import plain_client
from tests.cli.doctor.wrong_server import FAULTS, Fault, wrong_server
from tests.cli.tool_fixture import Result, other_server, run, talking_server
from tests.shell.websocket.test_access import Certificate
from tests.support import PATIENCE

LISTS = ("rosapi/topics", "rosapi/services", "rosapi/nodes")

NOT_PRESCRIBED = ("binary frames are lost",)

SHORT = "0.2"
"""Wait for frames that do not come [s]."""

LONGER = "2"
"""The same where a server without any of such frames is no wrong one: those that come must not be missed."""

LONG = ("--timeout", str(PATIENCE))
"""Wait for frames that all come, on however busy a machine."""


async def doctor(url: str, *words: str) -> Result:
    async with asyncio.timeout(PATIENCE):
        return await asyncio.to_thread(run, "doctor", url, *words)


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    """A good server, which the doctor leaves as it was."""
    with Simulator(port=0, world=False) as simulator:
        yield simulator.url


@pytest.mark.slow
@pytest.mark.parametrize(("ros", "world"), [(1, True), (2, True), (1, False)])
async def test_this_server_conforms_in_every_check(ros: Literal[1, 2], *, world: bool) -> None:
    async with Simulator(port=0, ros=ros, world=world) as simulator:
        done = await doctor(simulator.url, "--hostile", "--json", *LONG)
        names = await doctor(simulator.url, "--only", "rosapi", "--json", *LONG)
    verdicts = {one["id"]: (one["verdict"], one["reason"]) for one in done.json["checks"]}
    assert {id_: one for id_, one in verdicts.items() if one[0] not in {"conforms", "not applicable"}} == {}
    why = {reason for verdict, reason in verdicts.values() if verdict == "not applicable"}
    assert why == {"no --token is given", f"only for ROS {3 - ros}"}
    assert len(verdicts) > 280
    listed = json.dumps(
        [one["came"] for one in names.json["checks"] if one["id"] in {"rosapi/services", "rosapi/nodes"}]
    )
    assert "doctor_" not in listed  # it leaves nothing behind


@pytest.mark.parametrize("what", FAULTS)
async def test_every_fault_is_found_and_named(what: str, url: str) -> None:
    fault = FAULTS[what]
    async with wrong_server(url, fault) as wrong:
        patience = LONGER if fault.check.startswith("actions/") else SHORT
        found = await doctor(wrong, "--only", fault.check, "--timeout", patience)
    assert f"{fault.check}: " in found.out
    assert found.code == (0 if what in NOT_PRESCRIBED else 1), found.out


async def test_no_fault_is_found_in_a_good_server(url: str) -> None:
    checks = {fault.check for fault in FAULTS.values()}
    good = await doctor(url, *LONG, *(word for check in checks for word in ("--only", check)))
    assert (good.code, [check for check in checks if check in good.out]) == (0, []), good.out
    assert f"{len(checks)} checks: {len(checks)} conform" in good.out


async def test_server_without_rosapi_is_examined() -> None:
    async with other_server(lambda _frame: []) as silent:
        done = await doctor(silent, "--only", "topics/message-keys", "--timeout", "0.05", "--json")
    (check,) = json.loads(done.out)["checks"]
    assert done.code == 1
    assert check["verdict"] == "missing"
    assert check["came"] == []


@pytest.mark.parametrize(
    "rubbish", ["{", "[1]", '{"op": 5}', "9" * 5000, "[" * 5000, b"\xc1\xfb" + b"\x7f" * 8, b"\xff"]
)
async def test_server_that_answers_rubbish_is_examined(rubbish: str | bytes) -> None:
    async with other_server(lambda _frame: [rubbish, rubbish]) as wrong:
        done = await doctor(wrong, "--only", "topics/message-keys", "--timeout", "0.05")
    assert done.code == 1
    assert "topics/message-keys" in done.out
    assert done.err == ""


async def test_server_that_never_stops_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plain_client, "MAX_FRAMES", 50)

    async def flood(connection: ServerConnection) -> None:
        with suppress(ConnectionClosed):
            while True:
                await connection.send('{"op": "publish", "topic": "/flood", "msg": {}}')

    async with talking_server(flood) as wrong:
        done = await doctor(wrong, "--only", "topics/message-keys", "--timeout", "0.05")
    assert done.code == 2
    assert done.complaint == f"{wrong}: the connection has ended (1006): it sends more than 50 frames or 134 MB"


async def test_server_that_takes_no_more_connections_is_examined_to_the_end() -> None:
    seen: list[ServerConnection] = []

    def look(connection: ServerConnection, _request: Request) -> Response | None:
        seen.append(connection)
        return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "full") if len(seen) > 3 else None

    async with other_server(lambda _frame: [], look) as full:
        done = await doctor(full, "--only", "topics/message-keys", "--only", "connection/ping", "--timeout", "0.05")
    assert done.code == 1
    assert "deviates: topics/message-keys" in done.out
    assert "it accepts no more clients now (HTTP 503 Service Unavailable)" in done.out
    assert done.err == ""


async def test_server_that_denies_names_is_examined() -> None:
    async with Simulator(port=0, world=False, deny_publish=["/doctor_*"]) as simulator:
        done = await doctor(simulator.url, "--only", "topics/message-keys", "--only", "services/unknown")
    assert done.code == 1
    assert "also got" in done.out or "got nothing" in done.out
    assert "services     1 conforms" in done.out


async def test_token_is_needed_and_given() -> None:
    async with Simulator(port=0, world=False, token="secret") as simulator:  # noqa: S106 - of this test alone
        refused = await doctor(simulator.url, "--only", "connection")
        done = await doctor(simulator.url, "--only", "connection", "--token", "secret", "--json", *LONG)
    assert (refused.code, "it needs a token (--token)" in refused.complaint) == (2, True)
    assert {one["id"]: one["verdict"] for one in done.json["checks"]}["connection/token"] == "conforms"


async def test_nothing_listens() -> None:
    done = await doctor("ws://127.0.0.1:1")
    assert (done.code, done.complaint) == (2, "ws://127.0.0.1:1: nothing listens there; is the server running?")


async def test_known_differences_are_no_faults(url: str, tmp_path: Path) -> None:
    fault = FAULTS["failures are successes"]
    words = ("--only", "services/unknown", "--only", "topics/burst")
    async with wrong_server(url, fault) as wrong:
        first = await doctor(wrong, *words, "--json")
        (tmp_path / "known.json").write_text(first.out)
        again = await doctor(wrong, *words, "--baseline", str(tmp_path / "known.json"))
    both = Fault("", down=lambda op: [step for one in fault.down(op) or [] for step in [one, one]])
    async with wrong_server(url, both) as worse:
        third = await doctor(worse, *words, "--baseline", str(tmp_path / "known.json"))
    assert (first.code, again.code, third.code) == (1, 0, 1)
    assert "deviates (known): services/unknown" in again.out


async def test_reports_for_machines_and_issues(url: str, tmp_path: Path) -> None:
    words = ("--only", "services/unknown", "--only", "topics/burst", "--only", "connection/token")
    async with wrong_server(url, FAULTS["failures are successes"]) as wrong:
        done = await doctor(wrong, *words, "--markdown", "--junit", str(tmp_path / "junit.xml"))
    suite = ET.fromstring((tmp_path / "junit.xml").read_text())  # noqa: S314 - our own
    assert (suite.get("tests"), suite.get("failures"), suite.get("skipped")) == ("3", "1", "1")
    assert "| services | 1 deviates |" in done.out
    assert '"op": "call_service"' in done.out


async def test_report_is_printed_although_a_file_cannot_be_written(url: str, tmp_path: Path) -> None:
    done = await doctor(url, "--only", "topics/latch", "--junit", str(tmp_path / "no" / "x.xml"))
    assert (done.code, "1 check: 1 conforms" in done.out) == (2, True)
    assert done.complaint.endswith("x.xml: cannot be written: No such file or directory")


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--only", "topics/lach"], "--only: no check is called 'topics/lach' (did you mean topics/latch"),
        (["--baseline", "/nothing/x.json"], "--baseline: /nothing/x.json: cannot be read: No such file or directory"),
        (["--baseline", __file__], f"--baseline: {__file__}: expected the output of `rosbridge-sim doctor --json`"),
    ],
)
async def test_mistake_in_the_command_line_is_one_line(words: list[str], complaint: str) -> None:
    done = await doctor("ws://127.0.0.1:1", *words)
    assert done.code == 2
    assert done.complaint.startswith(complaint)


def test_list_has_every_check_with_its_source() -> None:
    listed = run("doctor", "--list", "--json").json
    assert [one["id"] for one in listed] == [one.id for one in all_checks(is_hostile=True, is_load=True)]
    assert all(one["says"] and one["source"] for one in listed)


def test_checks_of_what_no_honest_client_sends_are_made_only_when_wanted() -> None:
    usual = {one.section for one in all_checks(is_hostile=False, is_load=False)}
    assert not usual & {"hostile", "load", "large"}


async def test_server_behind_tls_is_examined(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    certificate = Certificate(tmp_path)
    options: SimulatorOptions = {"certfile": certificate.certfile, "keyfile": certificate.keyfile, "token": "secret"}
    options |= {"port": 0, "world": False}
    async with Simulator(**options) as simulator:
        untrusted = await doctor(simulator.url, "--only", "connection", "--token", "secret")
        plain = await doctor(simulator.url.replace("wss:", "ws:"), "--only", "connection", "--token", "secret")
        monkeypatch.setenv("SSL_CERT_FILE", certificate.certfile)
        wrong = await doctor(simulator.url, "--only", "connection", "--token", "wrong")
        done = await doctor(simulator.url, "--only", "connection", "--token", "secret", "--json", *LONG)
    assert (untrusted.code, "SSL_CERT_FILE may name certificates to trust" in untrusted.complaint) == (2, True)
    assert (plain.code, "use wss://" in plain.complaint) == (2, True)
    assert (wrong.code, "--token" in wrong.complaint) == (2, True)
    assert done.code == 0
    assert {one["verdict"] for one in done.json["checks"]} == {"conforms"}
