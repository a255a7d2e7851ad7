"""Errors of clients: bounded log lines, and a list on `/sim/refusals`."""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.shell.monitoring.refusal_log import (
    MAX_CLIENTS,
    MAX_KEPT,
    MAX_KINDS,
    MAX_REFUSAL_TEXT,
    REFUSALS_PERIOD,
    RefusalLog,
    escape,
)
from tests.support import Client

WRONG = RefusedRequest("1.2.3.4:5", Reason.WRONG_TYPE, "publish", "/ctrl_cmd", "no number")


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest_asyncio.fixture
async def account(clock: Clock) -> AsyncIterator[RefusalLog]:
    account = RefusalLog(asyncio.get_running_loop(), lambda: 7, clock=clock)
    yield account
    account.stop()


def lines(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]


async def test_first_refusal_is_logged_and_the_rest_of_a_period_summarised(
    account: RefusalLog, clock: Clock, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(1_000):
        account.note(WRONG)
    assert lines(caplog) == ["1.2.3.4:5: refused: publish /ctrl_cmd: no number (wrong_type)"]
    clock.now = REFUSALS_PERIOD
    account.flush(clock.now)
    account.flush(clock.now)
    assert lines(caplog)[1:] == ["1.2.3.4:5: 999 more refused (wrong_type), the last one: publish /ctrl_cmd: no number"]
    assert all(record.__dict__["client"] == "1.2.3.4:5" for record in caplog.records)


async def test_request_that_was_carried_out_with_a_warning_is_not_called_refused(
    account: RefusalLog, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(3):
        account.note(WRONG._replace(reason=Reason.WARNING, text="nothing to load"))
    account.flush(REFUSALS_PERIOD)
    first, rest = lines(caplog)
    assert first == "1.2.3.4:5: warned: publish /ctrl_cmd: nothing to load (warning)"
    assert rest.startswith("1.2.3.4:5: 2 more warned (warning)")


async def test_refusal_after_a_quiet_period_is_logged_again(
    account: RefusalLog, clock: Clock, caplog: pytest.LogCaptureFixture
) -> None:
    account.note(WRONG)
    clock.now = REFUSALS_PERIOD
    account.note(WRONG)
    assert len(lines(caplog)) == 2


async def test_each_client_and_reason_has_its_own_log_line(
    account: RefusalLog, caplog: pytest.LogCaptureFixture
) -> None:
    for client in ("a:1", "b:2"):
        for reason in (Reason.WRONG_TYPE, Reason.NOT_MASTER):
            for text in ("one", "another"):
                account.note(WRONG._replace(client=client, reason=reason, text=text))
    assert len(lines(caplog)) == 4


async def test_pending_summaries_are_logged_at_the_end(account: RefusalLog, caplog: pytest.LogCaptureFixture) -> None:
    account.note(WRONG)
    account.note(WRONG._replace(text="other"))
    account.stop()
    assert lines(caplog)[-1].endswith("1 more refused (wrong_type), the last one: publish /ctrl_cmd: other")


async def test_text_of_a_client_is_cut_and_cannot_start_a_log_line(
    account: RefusalLog, caplog: pytest.LogCaptureFixture
) -> None:
    account.note(WRONG._replace(text="a\nERROR: b\x1b[31m\ud800" + "x" * 10**6, subject="/t\n" * 10_000))
    (line,) = lines(caplog)
    assert line.isprintable()
    assert "a\\nERROR: b\\x1b[31m\\ud800" in line
    assert len(line) < MAX_REFUSAL_TEXT + 400
    assert escape("plain") == "plain"


async def test_quiet_refusal_log_writes_nothing_and_keeps_all_entries(
    clock: Clock, caplog: pytest.LogCaptureFixture
) -> None:
    account = RefusalLog(asyncio.get_running_loop(), clock=clock, is_quiet=True)
    account.note(WRONG)
    account.note(WRONG)
    account.stop()
    assert lines(caplog) == []
    (noted,) = account.kept()
    assert (noted.count, noted.frame, account.total) == (2, -1, 2)


async def test_equal_refusal_with_a_long_text_is_kept_once(account: RefusalLog) -> None:
    for _ in range(MAX_KEPT + 1):
        account.note(WRONG._replace(text="x" * 2 * MAX_REFUSAL_TEXT, subject="/t" * 2 * MAX_REFUSAL_TEXT))
    (noted,) = account.kept()
    assert (noted.count, len(noted.request.text)) == (MAX_KEPT + 1, MAX_REFUSAL_TEXT)


async def test_kept_refusals_are_bounded_per_client(account: RefusalLog) -> None:
    account.note(WRONG)
    for i in range(3 * MAX_KINDS):
        account.note(WRONG._replace(client="flood:1", text=str(i)))
    assert [noted.request.client for noted in account.kept()] == ["1.2.3.4:5"] + ["flood:1"] * MAX_KEPT
    for i in range(2 * MAX_KINDS):
        account.note(WRONG._replace(client=f"many:{i}"))
    assert len(account.kept()) == MAX_CLIENTS
    assert len(account._kinds) == MAX_KINDS


@pytest.fixture
def ears(caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    caplog.set_level(logging.INFO, logger="rosbridge_sim")
    return caplog


async def test_refused_ticks_starts_and_commands_are_logged_and_published(
    ears: pytest.LogCaptureFixture,
) -> None:
    async with Simulator(port=0) as sim, await Client.open(sim.url) as master, await Client.open(sim.url) as other:
        await master.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        await master.ask("/SyncModeWaitForTick", user_id="me", frame=1)
        await other.send("subscribe", topic="/sim/refusals")
        assert (await other.message("/sim/refusals"))["refusals"] == []
        await other.ask("/SyncModeCmd", user_id="you", start_sync_mode=True, time_step=20)
        await other.ask("/SyncModeWaitForTick", user_id="you", frame=2)
        await other.send("publish", topic="/ctrl_cmd", msg={"acel": 1.0})
        await other.call("/SyncModCmd", {})
        refusals = await other.message_where("/sim/refusals", lambda message: len(message["refusals"]) == 4)
        port = other.socket.local_address[1]
        frame = (await master.ask("/SyncModeWaitForTick", user_id="me", frame=2))["frame"]
    rows = [(each["reason"], each["op"], each["subject"]) for each in refusals["refusals"]]
    assert rows == [
        ("not_master", "call_service", "/SyncModeCmd"),
        ("not_master", "call_service", "/SyncModeWaitForTick"),
        ("unknown_field", "publish", "/ctrl_cmd"),
        ("no_such_service", "call_service", "/SyncModCmd"),
    ]
    assert {(each["client"], each["frame"]) for each in refusals["refusals"]} == {(f"127.0.0.1:{port}", frame - 1)}
    assert [each["text"].rpartition(": ")[2] for each in refusals["refusals"][:2]] == ["'me'", "'me'"], "it is named"
    assert refusals["refusals"][3]["text"] == "Service /SyncModCmd does not exist (did you mean /SyncModeCmd?)"
    said = [line for line in lines(ears) if line.startswith(f"127.0.0.1:{port}: refused: ")]
    assert [line.rpartition("(")[2] for line in said] == ["not_master)", "unknown_field)", "no_such_service)"]
    assert "the last one: call_service /SyncModeWaitForTick: another" in "".join(lines(ears)), "written at the end"


async def test_late_refusal_is_recorded_with_its_op() -> None:
    async with Simulator(port=0, start="sync") as sim, await Client.open(sim.url) as client:
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        await client.send("publish", topic="/SyncModeRemoveObj", msg={"unique_id": 4_711, "frame": 1}, id="removal")
        await client.ask("/SyncModeWaitForTick", user_id="me", frame=1)
        await client.ask("/Service_MoraiSL", file_name="no such file", load_ego_vehicle_data=True)
        await client.ask("/Service_MoraiVehicleSpec", unique_id=4_711)
        await client.send("subscribe", topic="/sim/refusals")
        message = await client.message_where("/sim/refusals", lambda message: len(message["refusals"]) == 3)
        status = await client.take("status")
    rows = [(each["reason"], each["op"], each["subject"]) for each in message["refusals"]]
    assert rows == [
        ("refused", "publish", "/SyncModeRemoveObj"),
        ("refused", "call_service", "/Service_MoraiSL"),
        ("wrong_value", "call_service", "/Service_MoraiVehicleSpec"),
    ]
    assert (status["id"], status["level"]) == ("removal", "error")


async def test_quiet_clients_setting_logs_no_refusals(ears: pytest.LogCaptureFixture) -> None:
    async with Simulator(port=0, world=False, quiet_clients=True) as sim, await Client.open(sim.url) as client:
        await client.send("subscribe", topic="/nothing")
        await client.settle()
        await client.send("subscribe", topic="/sim/refusals")
        message = await client.message_where("/sim/refusals", lambda message: message["total"] == 1)
        assert [(each["frame"], each["reason"]) for each in message["refusals"]] == [(-1, "unknown_topic")]
    assert lines(ears) == []


async def test_flood_of_errors_gives_two_log_lines_and_two_messages(ears: pytest.LogCaptureFixture) -> None:
    async with Simulator(port=0, world=False) as sim, await Client.open(sim.url) as client:
        for i in range(1_000):
            await client.send("publish", topic=f"/nothing{i}", msg={})
        await client.settle()
    first, *others = [line for line in lines(ears) if "unknown_topic" in line]
    assert "more refused" not in first
    told = [re.search(r"([\d,]+) more refused", line) for line in others]
    assert sum(int(found[1].replace(",", "")) for found in told if found) == 999
    assert 1 <= len(others) < 10  # a line each 10 s, and a busy machine takes that long


async def test_advice_at_the_end_of_a_long_text_is_kept(ears: pytest.LogCaptureFixture) -> None:
    async with Simulator(port=0, world=False) as sim, await Client.open(sim.url) as client:
        await client.send("publsh", topic="/x")
        await client.settle()
    (line,) = [line for line in lines(ears) if "unknown_op" in line]
    assert line.endswith("(did you mean publish?) (unknown_op)")
    assert len(line) < 500, "which is what the log cuts at"
