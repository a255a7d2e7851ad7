"""`service ...` with our own server, as a user calls it."""

from __future__ import annotations

import asyncio
import json
import signal

import pytest

from rosbridge_sim.cli.tools import tool_client
from tests.cli.tool_fixture import in_the_background, run, start
from tests.conftest import Connect
from tests.support import PATIENCE, ServerProcess

# list, info


def test_list_prints_one_name_per_line(server: ServerProcess) -> None:
    done = run("service", "list", url=server.url)
    assert (done.code, done.err) == (0, "")
    assert {"/SyncModeCmd", "/rosapi/topics"} <= set(done.lines)
    assert run("service", "list", "--json", url=server.url).json == done.lines == sorted(done.lines)


def test_list_shows_types_and_providers(server: ServerProcess) -> None:
    rows = [line.split() for line in run("service", "list", "-v", url=server.url).lines]
    assert rows[0] == ["SERVICE", "TYPE", "PROVIDER"]
    assert ["/SyncModeCmd", "morai_msgs/MoraiSyncModeCmdSrv", "/morai_sim"] in rows
    entries = run("service", "list", "-v", "--json", url=server.url).json
    assert [list(entry.values()) for entry in entries] == rows[1:]


@pytest.mark.parametrize("name", ["/SyncModeSetGear", "SyncModeSetGear"])
def test_info_shows_request_and_response_fields(server: ServerProcess, name: str) -> None:
    assert (
        run("service", "info", name, url=server.url).out
        == """\
Type: morai_msgs/MoraiSyncModeSetGearSrv
Provider: /morai_sim

Request:
  morai_msgs/SyncModeSetGear request
    int32 gear
    uint64 frame

Response:
  morai_msgs/SyncModeResultResponse response
    bool result
"""
    )


def test_info_of_a_service_without_arguments_says_so(server: ServerProcess) -> None:
    done = run("service", "info", "/rosapi/nodes", url=server.url)
    assert done.out.endswith("Request: (empty)\n\nResponse:\n  string[] nodes\n")
    account = run("service", "info", "/rosapi/nodes", "--json", url=server.url).json
    assert (account["request"], account["response"]) == ("", "string[] nodes")


def test_info_of_a_misspelt_service_suggests_the_right_name(server: ServerProcess) -> None:
    done = run("service", "info", "/SyncModCmd", url=server.url)
    assert (done.code, done.complaint) == (1, "no service /SyncModCmd here (did you mean /SyncModeCmd?)")


# call


def test_call_shows_the_answer(server: ServerProcess) -> None:
    done = run("service", "call", "/Service_MoraiVehicleSpec", "{request: {unique_id: 0}}", url=server.url)
    assert (done.code, done.err) == (0, "")
    assert done.out.startswith("response:\n")


def test_call_shows_the_reason_of_a_refusal(server: ServerProcess) -> None:
    request = "{request: {file_name: nowhere, delete_all: true}}"
    done = run("service", "call", "/Service_MoraiSL", request, url=server.url)
    assert (done.code, done.out) == (0, "response:\n  result: false\n")
    assert "rosbridge-sim: the server says: /Service_MoraiSL: no scenario 'nowhere'" in done.err
    done = run("service", "call", "/SyncModeWaitForTick", "{request: {user_id: nobody}}", url=server.url)
    assert "the server says: /SyncModeWaitForTick: " in done.err


@pytest.mark.parametrize("request_text", ['{"topic": "/clock"}', "{topic: /clock}", "topic: /clock", "[/clock]"])
def test_request_can_be_json_or_yaml_by_name_or_position(server: ServerProcess, request_text: str) -> None:
    done = run("service", "call", "rosapi/topic_type", request_text, "--json", url=server.url)
    assert done.json == {"type": "rosgraph_msgs/Clock"}


def test_request_is_optional(server: ServerProcess) -> None:
    assert "secs: " in run("service", "call", "/rosapi/get_time", url=server.url).out


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("/SyncModCmd",), "Service /SyncModCmd does not exist (did you mean /SyncModeCmd?)"),
        (("/nothing/like/it",), "Service /nothing/like/it does not exist"),
        (("/rosapi/nodes", "{x: 1}"), "Message type rosapi/NodesRequest does not have a field x; it has no fields"),
        (("/rosapi/set_param", "{name: /x, value: '{'}"), "JSON-formatted string."),
    ],
)
def test_refused_call_is_one_line_on_stderr_and_exit_code_1(
    server: ServerProcess, words: tuple[str, ...], line: str
) -> None:
    done = run("service", "call", *words, url=server.url)
    assert (done.code, done.out) == (1, "")
    assert done.complaint.endswith(line)


async def test_service_of_another_client_can_be_called_and_can_refuse(server: ServerProcess, connect: Connect) -> None:
    client = await connect(server.url)
    await client.send("advertise_service", service="/tools/switch", type="std_srvs/SetBool")
    await client.settle()
    for values, is_ok in (({"success": True, "message": "it goes"}, True), ("it is stuck", False)):
        tool = asyncio.create_task(in_the_background("service", "call", "tools/switch", "{data: true}", url=server.url))
        call = await client.take("call_service")
        assert call["args"] == {"data": True}
        response = {"service": "/tools/switch", "id": call["id"], "values": values, "result": is_ok}
        await client.send("service_response", **response)
        done = await tool
        if is_ok:
            assert (done.code, done.out) == (0, "success: true\nmessage: it goes\n")
        else:
            assert (done.code, done.complaint) == (1, "it is stuck")


async def test_time_out_shows_the_text_of_the_server(
    server: ServerProcess, connect: Connect, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tool_client, "_LAST_WORD", PATIENCE)  # a busy server may need more than the user's patience
    client = await connect(server.url)
    await client.send("advertise_service", service="/tools/slow", type="std_srvs/Trigger")
    await client.settle()
    done = await in_the_background("service", "call", "/tools/slow", "--timeout", "0.05", url=server.url)
    assert (done.code, done.complaint) == (1, "Timeout exceeded while waiting for service response")


@pytest.mark.slow
async def test_ctrl_c_ends_a_pending_call_with_exit_code_130(server: ServerProcess, connect: Connect) -> None:
    client = await connect(server.url)
    await client.send("advertise_service", service="/tools/never", type="std_srvs/Trigger")
    await client.settle()
    with start("service", "call", "/tools/never", "--timeout", "0", url=server.url) as process:
        await client.take("call_service")
        process.send_signal(signal.SIGINT)
        out, err = await asyncio.to_thread(process.communicate, timeout=PATIENCE)
    assert (process.returncode, out, err) == (130, "", "")


def test_malformed_request_is_refused_without_a_connection() -> None:
    done = run("service", "call", "/s", "{data: ", url="ws://127.0.0.1:1")
    assert done.code == 2
    assert done.complaint.startswith("REQUEST:1:8: expected JSON, or YAML such as '{x: 1}': ")


def test_json_output_equals_the_response(server: ServerProcess) -> None:
    out = run("service", "call", "/rosapi/topics", "--json", url=server.url).out
    assert out.count("\n") == 1
    assert json.loads(out).keys() == {"topics", "types"}
