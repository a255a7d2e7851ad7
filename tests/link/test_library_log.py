"""Log lines of the library appear at debug level without secrets: on the server, at a bridge and in a tool."""

from __future__ import annotations

import asyncio
import json
import logging
import signal
from pathlib import Path
from urllib.parse import quote

import pytest
import websockets
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.frames import Frame, Opcode

from rosbridge_sim.link.library_log import _SHOWN, quiet
from tests import fork_server
from tests.conftest import Serve
from tests.support import PATIENCE, AttachProcess, Client, mask, open_raw

TOKEN = "s3same-street"  # noqa: S105 - a test's own
WRONG = "s3same-stret"

SOURCES = "\n".join(path.read_text() for path in Path(websockets.__file__).parent.rglob("*.py"))


REQUESTS = {"< %s %s %s", "< GET %s HTTP/1.1"}
"""The line of a request, from version 17 on and before."""


@pytest.mark.parametrize("line", sorted(_SHOWN.keys() - REQUESTS))
def test_known_log_lines_are_those_of_the_library(line: str) -> None:
    assert json.dumps(line) in SOURCES


def test_request_log_line_is_that_of_the_library() -> None:
    assert any(json.dumps(line) in SOURCES for line in REQUESTS)


@pytest.fixture
def lines(caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    caplog.set_level(logging.DEBUG, "rosbridge_sim.websockets")
    return caplog


def test_request_lines_headers_and_frames_are_shown_without_secrets(lines: pytest.LogCaptureFixture) -> None:
    quiet.debug("< %s %s %s", "GET", "/?token=s3same", "HTTP/1.1")
    quiet.debug("< %s %s %s", "s3same", "/", "HTTP/1.1")
    quiet.debug("< GET %s HTTP/1.1", "/?token=s3same")
    quiet.debug("> GET %s HTTP/1.1", "/")
    quiet.debug("< %s: %s", "Authorization", "Bearer s3same")
    quiet.debug("< %s: %s", "Sec-WebSocket-Protocol", "s3same")
    quiet.debug("< %s: %s", "Host", "localhost:9090")
    quiet.debug("> %s", Frame(Opcode.TEXT, b'{"op":"auth","token":"s3same"}'))
    quiet.debug("= connection is %s", "OPEN")
    quiet.info("connection open")
    assert lines.messages == [
        "< GET /?... HTTP/1.1",
        "< ... / HTTP/1.1",
        "< GET /?... HTTP/1.1",
        "> GET / HTTP/1.1",
        "< Authorization: ...",
        "< Sec-WebSocket-Protocol: ...",
        "< Host: localhost:9090",
        "> TEXT [30 bytes]",
        "= connection is OPEN",
        "connection open",
    ]
    assert {record.levelno for record in lines.records} == {logging.DEBUG}


def test_unknown_log_line_loses_its_values_and_an_exception_its_text(lines: pytest.LogCaptureFixture) -> None:
    quiet.warning("100 %% new: %s of %s", "s3same", 5)
    try:
        int("s3same")
    except ValueError:
        quiet.exception("parser failed")
    assert lines.messages == ["100 %% new: %s of %s (values are not shown)", "parser failed"]
    assert "s3same" not in lines.text


def test_library_log_lines_count_by_their_source(lines: pytest.LogCaptureFixture) -> None:
    logging.LoggerAdapter(quiet, {"websocket": "a connection"}).debug("= connection is %s", "OPEN")
    quiet.debug("= connection is %s", "OPEN")
    assert {record.filename for record in lines.records} == {Path(__file__).name}


# The whole


async def knock(url: str, frames: list[str], **headers: str) -> str:
    """Whatever a server says to a client that comes with these headers and sends these frames."""
    said = ""
    try:
        async with connect(url, additional_headers=headers, ping_interval=None, proxy=None) as socket:
            for frame in frames:
                await socket.send(frame)
                await socket.send([frame[i : i + 9] for i in range(0, len(frame), 9)])  # these go through the library
            await socket.send('{"op": "call_service", "service": "/rosapi/get_time", "id": "last"}')
            async with asyncio.timeout(PATIENCE):
                while '"last"' not in said:
                    said += str(await socket.recv())
    except InvalidStatus as error:
        said += f"{error} {error.response.body!r} {error.response.headers}"
    except ConnectionClosed as error:
        said += str(error)
    return said


def told_by_a_client(token: str) -> list[str]:
    """Frames of a client that is let in, whose words are logged or quoted."""
    return [
        json.dumps({"op": "auth", "token": [token]}),
        json.dumps({"op": token}),
        json.dumps({"op": "subscribe", "topic": f"/?token={quote(token)}"}),
        json.dumps({"op": "status", "level": "error", "msg": f"connected to /?token={token}"}),
    ]


@pytest.mark.slow
async def test_no_token_stands_in_any_log_or_answer_at_any_level(serve: Serve, tmp_path: Path) -> None:
    server = serve("--no-world", "--log-level", "debug", "--compression", env={"ROSBRIDGE_SIM_TOKEN": TOKEN})
    said = ""
    async with Client(await connect(f"{server.url}/?token={TOKEN}", proxy=None)) as listener:
        for topic in ("/rosout", "/sim/clients", "/sim/refusals"):
            await listener.subscribe(topic)
        call = json.dumps({"op": "call_service", "service": "/rosapi/get_time"})
        for token in (TOKEN, WRONG):
            auth = json.dumps({"op": "auth", "token": token})
            said += await knock(f"{server.url}/?token={quote(token)}", [call])
            said += await knock(server.url, [call], Authorization=f"Bearer {token}", Cookie=f"token={token}")
            said += await knock(server.url, [auth, call])
            said += await knock(server.url, [call, auth[:-1]])
            await knock(f"{server.url}/?token={TOKEN}", [auth[:-1], *told_by_a_client(token)] if token == TOKEN else [])
            said += await knock(f"{server.url}/nowhere?token={token}", [])
            for rubbish in (
                f"GET /?token={token} HTTP/1.1\r\n\r\n",
                f"GET /healthz?token={token} HTTP/1.1\r\nAuthorization: Bearer {token}\r\n\r\n",
                f"{token} /?token={token}\r\n\r\n",
                f"GET / HTTP/1.1\r\nUpgrade: websocket\r\nAuthorization: Bearer {token}\r\n{token}\r\n\r\n",
                f"GET /?token={token} HTTP/1.1\r\nUpgrade: {token}\r\nSec-WebSocket-Key: {token}\r\n\r\n",
            ):
                reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
                writer.write(rubbish.encode())
                async with asyncio.timeout(PATIENCE):
                    said += (await reader.read()).decode()
                writer.close()
            reader, writer = await open_raw(server.port)
            writer.write(mask(auth)[:-3])  # cut off in the middle
            writer.transport.abort()
        await listener.message("/sim/clients")
        said += str(list(listener.inbox) + await listener.settle())

    tool = ["-m", "rosbridge_sim", "topic", "list", "--url"]
    for words, code in (
        ([f"{server.url}/?token={TOKEN}"], 0),
        ([f"{server.url}/?token={WRONG}"], 2),
        ([server.url, "--token", WRONG], 2),
        ([server.url, "--tokn", WRONG], 2),
        ([f"ws://x y/?token={WRONG}"], 2),
        ([f"ws://me:{WRONG}@127.0.0.1:1/?token={WRONG}"], 2),
    ):
        done = await asyncio.to_thread(fork_server.run, [*tool, *words])
        assert done.returncode == code, done
        assert "Traceback" not in done.stderr
        said += done.stdout + done.stderr

    attached = AttachProcess(
        tmp_path / "attach.txt", [f"{server.url}/?token={TOKEN}"], ["--log-level", "debug", "--attach-sockets=one"]
    )
    attached.stop()
    attached.stop_cleanly()
    words = ["-m", "rosbridge_sim", "attach", f"{server.url}/?token={WRONG}", "--log-level", "debug"]
    with fork_server.popen(words) as refused:
        assert refused.stderr is not None
        while "it needs a token" not in (line := await asyncio.to_thread(refused.stderr.readline)):
            assert line, "it ended before it was refused"
            said += line
        refused.send_signal(signal.SIGTERM)
        said += line + await asyncio.to_thread(refused.stderr.read)
    server.stop()

    logs = server.log + attached.log
    for token in (TOKEN, WRONG):
        assert token not in said
        assert token not in logs
        assert token not in attached.said + server.said
    assert "< GET /?... HTTP/1.1" in server.log
    assert "< Authorization: ..." in server.log
    assert "> GET /?... HTTP/1.1" in attached.log
    assert "The token is wrong" in said
