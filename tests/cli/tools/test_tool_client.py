"""The tools with foreign servers: other rosbridges, servers of other protocols, and silent ones."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import Iterable
from http import HTTPStatus

import pytest
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from rosbridge_sim.cli.tools.tool_client import open_bridge
from rosbridge_sim.cli.tools.topic import Echo, echo
from tests.cli.tool_fixture import (
    Frame,
    Reply,
    answering,
    in_the_background,
    other_server,
    raw_server,
    talking_server,
)
from tests.support import PATIENCE

NAMES = {"topics": ["/b", "/a"], "types": ["p/B", "p/A"]}

SHORT = "0.05"
"""A patience for those who never answer [s]."""


# No rosbridge


async def test_proxy_variables_of_the_environment_are_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("http_proxy", "https_proxy", "all_proxy"):
        monkeypatch.setenv(name, "http://127.0.0.1:1")
    monkeypatch.delenv("no_proxy", raising=False)
    async with other_server(answering(topics=NAMES)) as url:
        assert (await in_the_background("topic", "list", url=url)).code == 0


async def test_unused_port_gives_an_error() -> None:
    with socket.create_server(("127.0.0.1", 0)) as gone:
        url = f"ws://127.0.0.1:{gone.getsockname()[1]}"
    done = await in_the_background("topic", "list", url=url)
    assert (done.code, done.complaint) == (2, f"{url}: nothing listens there; is the server running?")


@pytest.mark.parametrize(
    ("said", "line"),
    [
        (b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\nhello", "not a rosbridge (HTTP 200 OK): hello"),
        (b"HTTP/1.1 404 Not Found\r\nContent-Length: 6\r\n\r\n<html>", "not a rosbridge (HTTP 404 Not Found)"),
        (b"SSH-2.0-OpenSSH_9.2\r\n", "not a rosbridge: "),
        (b"", "not a rosbridge: "),
    ],
)
async def test_server_of_another_protocol_gives_an_error(said: bytes, line: str) -> None:
    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(said)
        await writer.drain()

    async with raw_server(talk) as url:
        done = await in_the_background("topic", "list", url=url)
    assert done.code == 2
    assert done.complaint.startswith(f"{url}: {line}")


async def test_server_without_a_handshake_gives_an_error_in_time() -> None:
    async def talk(reader: asyncio.StreamReader, _: asyncio.StreamWriter) -> None:
        await reader.read()

    async with raw_server(talk) as url:
        done = await in_the_background("service", "list", "--timeout", SHORT, url=url)
    assert (done.code, done.out) == (2, "")
    assert done.complaint == f"{url}: no answer within {SHORT} s; not a rosbridge, or one that is stuck"


@pytest.mark.usefixtures("patient_handshakes")
@pytest.mark.parametrize("words", [("topic", "list"), ("topic", "info", "/a"), ("service", "list", "-v")])
async def test_silent_websocket_gives_an_error_in_time(words: tuple[str, ...]) -> None:
    async with other_server(lambda _: ()) as url:
        done = await in_the_background(*words, "--timeout", SHORT, url=url)
    assert (done.code, done.out) == (2, "")
    assert done.complaint == f"{url}: no answer within {SHORT} s; is rosapi running there?"


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("ftp://x", "--url: expected a URL such as ws://127.0.0.1:9090; got 'ftp://x'"),
        ("ws://x:99999", "--url: expected a URL"),
        ("", "--url: expected a URL"),
        ("ws://no-such-host.invalid", "there is no such host"),
        ("no such host", "there is no such host"),
    ],
)
async def test_impossible_url_gives_an_error(url: str, said: str) -> None:
    done = await in_the_background("topic", "list", url=url)
    assert done.code == 2
    assert said in done.complaint


async def test_wss_url_of_a_plain_server_gives_an_error() -> None:
    async with other_server(answering(topics=NAMES)) as url:
        done = await in_the_background("topic", "list", url=url.replace("ws:", "wss:"))
    assert done.code == 2
    assert "the server seems to have no TLS" in done.complaint


# A token


def guard(_: ServerConnection, request: Request) -> Response | None:
    if request.headers.get("Authorization") == "Bearer s3cret":
        return None
    return Response(HTTPStatus.UNAUTHORIZED, "Unauthorized", request.headers.__class__(), b"no token, no entry\n")


async def test_token_gives_access_to_a_server_that_wants_one() -> None:
    async with other_server(answering(topics=NAMES), guard) as url:
        done = await in_the_background("topic", "list", "--token", "s3cret", url=url)
        refused = await in_the_background("topic", "list", "--token", "other", url=url)
    assert done.lines == ["/a", "/b"]
    assert refused.code == 2
    assert refused.complaint == f"{url}: it needs a token (--token) (HTTP 401 Unauthorized): no token, no entry"


@pytest.mark.parametrize("token", ["two words", "line\r\nX: y", "토큰"])
async def test_token_that_does_not_fit_into_a_header_is_refused(token: str) -> None:
    done = await in_the_background("topic", "list", "--token", token, url="ws://127.0.0.1:1")
    assert (done.code, done.complaint) == (2, "--token: expected printable ASCII without blanks")


# Other habits


async def test_url_without_a_scheme_or_with_http_is_accepted() -> None:
    async with other_server(answering(topics=NAMES)) as url:
        for other in (url.removeprefix("ws://"), url.replace("ws:", "http:")):
            assert (await in_the_background("topic", "list", url=other)).lines == ["/a", "/b"]


async def test_missing_rosapi_gives_an_error() -> None:
    async with other_server(answering(topics="Service /rosapi/topics does not exist")) as url:
        done = await in_the_background("topic", "list", url=url)
    assert done.code == 1
    assert done.complaint == ("/rosapi/topics says: Service /rosapi/topics does not exist; is rosapi running there?")


async def test_answer_is_found_in_unrequested_fragments_and_binary_frames_among_rubbish() -> None:
    def reply(frame: Frame) -> Iterable[str | bytes]:
        (whole,) = answering(topics=NAMES)(frame)
        text = str(whole)
        pieces = [
            json.dumps(
                {"op": "fragment", "id": 0, "num": i, "total": 2.7, "data": text[i * 40 : 40 if i == 0 else None]}
            )
            for i in range(2)
        ]
        yield "[1, 2]"
        yield "no JSON"
        yield '{"op": "fragment", "id": 1}'
        yield '{"op": "unheard_of"}'
        yield pieces[1]
        yield pieces[0].encode()

    async with other_server(reply) as url:
        done = await in_the_background("topic", "list", "--json", url=url)
    assert done.code == 0
    assert json.loads(done.out) == [{"topic": "/a", "type": "p/A"}, {"topic": "/b", "type": "p/B"}]
    assert "a fragment that cannot be used" in done.err


async def test_answer_without_a_result_field_is_accepted() -> None:
    def reply(frame: Frame) -> Iterable[str | bytes]:
        yield json.dumps({"op": "service_response", "id": frame["id"], "values": {"topics": ["/a"]}})

    async with other_server(reply) as url:
        done = await in_the_background("topic", "list", "-t", url=url)
    assert done.lines == ["/a [?]"]


async def test_control_characters_in_names_do_not_reach_the_terminal() -> None:
    async with other_server(answering(topics={"topics": ["/a\x1b[2J"], "types": ["p/A"]})) as url:
        done = await in_the_background("topic", "list", url=url)
    assert done.lines == ["/a\\x1b[2J"]


async def test_close_reason_of_the_server_is_shown() -> None:
    async def handle(connection: ServerConnection) -> None:
        await connection.close(1008, "too many calls")

    async with talking_server(handle) as url:
        done = await in_the_background("topic", "list", url=url)
    assert (done.code, done.complaint) == (1, f"{url}: the server has closed the connection (1008): too many calls")


async def test_broken_connection_gives_an_error() -> None:
    async def handle(connection: ServerConnection) -> None:
        await connection.recv()
        connection.transport.abort()

    async with talking_server(handle) as url:
        done = await in_the_background("topic", "list", url=url)
    assert (done.code, done.complaint) == (1, f"{url}: the connection was lost")


# Topics there


def publishing(*bodies: str, **services: Frame | str) -> Reply:
    answers = answering(**services)

    def reply(frame: Frame) -> Iterable[str | bytes]:
        if frame["op"] == "subscribe":
            for body in bodies:
                yield f'{{"op": "publish", "topic": "chatter", "msg": {body}}}'
        yield from answers(frame)

    return reply


async def test_echo_needs_neither_rosapi_nor_a_leading_slash() -> None:
    async with asyncio.timeout(PATIENCE), other_server(publishing('{"data": 1}')) as url:
        done = await in_the_background("topic", "echo", "chatter", "--once", "--timeout", "1000", url=url)
    assert (done.code, done.out, done.err) == (0, "data: 1\n---\n", "")


async def test_bare_nan_is_read_and_not_printed_as_json() -> None:
    async with other_server(publishing('{"data": NaN}')) as url:
        plain = await in_the_background("topic", "echo", "chatter", "--once", url=url)
        for_programs = await in_the_background("topic", "echo", "chatter", "--once", "--json", url=url)
    assert plain.out == "data: .nan\n---\n"
    assert for_programs.json == {"data": None}


async def test_echo_reports_a_silent_server_and_goes_on_waiting(capsys: pytest.CaptureFixture[str]) -> None:
    asked = asyncio.Event()

    async def handle(connection: ServerConnection) -> None:
        async for data in connection:
            frame = json.loads(data)
            if frame["op"] == "call_service":
                asked.set()
                await silence.wait()
                await connection.send('{"op": "publish", "topic": "/chatter", "msg": {"data": 1}}')

    silence = asyncio.Event()
    async with talking_server(handle) as url, open_bridge(url, None, PATIENCE) as bridge:
        bridge.patience = float(SHORT)
        loop = asyncio.get_running_loop()
        tool = asyncio.create_task(echo(bridge, "/chatter", None, 1, patience=None, form=Echo()))
        await asked.wait()
        loop.call_later(4 * float(SHORT), silence.set)
        await tool
    said = f"rosbridge-sim: {url}: no answer within {SHORT} s; is rosapi running there? Waiting for messages\n"
    assert capsys.readouterr() == ("data: 1\n---\n", said)


@pytest.mark.slow
@pytest.mark.usefixtures("patient_handshakes")
async def test_publish_to_a_silent_server_reports_that_it_is_silent() -> None:
    heard: list[Frame] = []

    def reply(frame: Frame) -> Iterable[str | bytes]:
        heard.append(frame)
        return ()

    async with other_server(reply) as url:
        done = await in_the_background(
            "topic", "pub", "chatter", "p/A", "{x: 1}", "--once", "--timeout", SHORT, url=url
        )
    assert done.code == 0
    assert "So it is not known if the message was accepted" in done.err
    assert done.err.endswith("rosbridge-sim: published 1 message to /chatter\n")
    by_op = {frame["op"]: frame for frame in heard}
    assert (by_op["advertise"]["topic"], by_op["advertise"]["type"]) == ("/chatter", "p/A")
    assert by_op["publish"]["msg"] == {"x": 1}


async def test_status_reply_to_set_level_is_not_shown() -> None:
    def reply(frame: Frame) -> Iterable[str | bytes]:
        if frame["op"] == "set_level":
            yield json.dumps({"op": "status", "level": "error", "msg": "Unknown operation", "id": frame["id"]})
        yield from answering(subscribers={"subscribers": ["/n"]})(frame)

    async with other_server(reply) as url:
        done = await in_the_background("topic", "pub", "chatter", "p/A", "--once", url=url)
    assert (done.code, done.complaint) == (0, "published 1 message to /chatter (subscribers: /n)")


# Services there


@pytest.mark.slow
async def test_unanswered_call_ends_with_an_error_in_time() -> None:
    heard: list[Frame] = []

    def reply(frame: Frame) -> Iterable[str | bytes]:
        heard.append(frame)
        return ()

    async with other_server(reply) as url:
        done = await in_the_background("service", "call", "/s", "--timeout", SHORT, url=url)
    assert (done.code, done.complaint) == (1, f"/s: no answer within {SHORT} s; --timeout waits longer")
    assert [(frame["service"], frame["timeout"]) for frame in heard if frame["op"] == "call_service"] == [
        ("/s", float(SHORT))
    ]


async def test_service_described_by_rosbridge_suite_for_ros_2_is_shown() -> None:
    request = {"type": "p/SRequest", "fieldnames": ["_at", "_tags"], "fieldtypes": ["p/Point", "string"]}
    point = {"type": "p/Point", "fieldnames": ["_x"], "fieldtypes": ["double"], "fieldarraylen": [-1]}
    response = {"type": "p/SResponse", "fieldnames": ["_cov"], "fieldtypes": ["double"], "fieldarraylen": [9]}
    services: dict[str, Frame | str] = {
        "service_type": {"type": "p/srv/S"},
        "service_node": {"node": "/n"},
        "service_request_details": {"typedefs": [{**request, "fieldarraylen": [-1, 0]}, point]},
        "service_response_details": {"typedefs": [response]},
    }
    async with other_server(answering(**services)) as url:
        done = await in_the_background("service", "info", "s", url=url)
    assert (
        done.out
        == """\
Type: p/srv/S
Provider: /n

Request:
  p/Point at
    double x
  string[] tags

Response:
  double[9] cov
"""
    )


async def test_service_of_an_unknown_type_is_shown_without_a_definition() -> None:
    services: dict[str, Frame | str] = {
        "service_type": {"type": "p/S"},
        "service_node": "oh",
        "service_request_details": "no",
        "service_response_details": {"typedefs": "?"},
    }
    async with other_server(answering(**services)) as url:
        done = await in_the_background("service", "info", "/s", url=url)
        for_programs = await in_the_background("service", "info", "/s", "--json", url=url)
    assert done.out == "Type: p/S\nProvider: unknown\n\nIts definition is unknown, on the server and here.\n"
    nothing = {"provider": None, "request": None, "response": None}
    assert for_programs.json == {"service": "/s", "type": "p/S", **nothing}


async def test_missing_definition_on_the_server_is_replaced_by_the_built_in_one() -> None:
    services: dict[str, Frame | str] = {
        "service_type": {"type": "std_srvs/srv/SetBool"},
        "service_node": {"node": "/n"},
        "service_request_details": "no",
        "service_response_details": "no",
    }
    async with other_server(answering(**services)) as url:
        done = await in_the_background("service", "info", "/s", url=url)
    assert done.out.endswith("Request:\n  bool data\n\nResponse:\n  bool success\n  string message\n")


async def test_recursive_type_is_shown_once() -> None:
    loop = {"type": "p/SRequest", "fieldnames": ["again"], "fieldtypes": ["p/SRequest"], "fieldarraylen": [-1]}
    services: dict[str, Frame | str] = {
        "service_type": {"type": "p/S"},
        "service_node": {"node": "/n"},
        "service_request_details": {"typedefs": [loop]},
        "service_response_details": {"typedefs": [loop]},
    }
    async with other_server(answering(**services)) as url:
        done = await in_the_background("service", "info", "/s", url=url)
    assert done.out.endswith("Request:\n  p/SRequest again\n\nResponse:\n  p/SRequest again\n")
