"""A rosbridge with one fault: a proxy before a good server, which changes frames on their way."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any, Final, NamedTuple

from websockets.asyncio.client import ClientConnection, connect
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from tests.cli.tool_fixture import talking_server

__all__ = ["FAULTS", "Fault", "wrong_server"]

Op = dict[str, Any]
Change = Callable[[Op], list[Op] | None]
"""What becomes of an op: these ops; None closes the connection."""


class Fault(NamedTuple):
    """A fault.

    Attributes:
        check: id of a check that must find it.
        up: change of ops from clients.
        down: change of ops to clients.
        bytes_up: False loses all binary frames from clients.
    """

    check: str
    up: Change = lambda op: [op]
    down: Change = lambda op: [op]
    bytes_up: bool = True


def _lose(kind: str) -> Change:
    return lambda op: [] if op["op"] == kind else [op]


def _without(kind: str, key: str) -> Change:
    return lambda op: [{k: v for k, v in op.items() if op["op"] != kind or k != key}]


def _with(kind: str, **values: object) -> Change:
    return lambda op: [op | values] if op["op"] == kind else [op]


def _absolute_topic(op: Op) -> list[Op]:
    return [op | {"topic": "/" + op["topic"].lstrip("/")}] if op["op"] == "publish" else [op]


def _success(op: Op) -> list[Op]:
    return [op | {"result": True}] if op["op"] == "service_response" else [op]


def _list_for_base64(op: Op) -> list[Op]:
    data = op.get("msg", {}).get("data") if op["op"] == "publish" else None
    return [op | {"msg": op["msg"] | {"data": [1, 2, 255]}}] if data == "AQL/" else [op]


def _twice(op: Op) -> list[Op]:
    return [op, op] if op["op"] == "publish" else [op]


def _status_of_unsubscribe(op: Op) -> list[Op]:
    return [{"op": "subscribe", "topic": "no name"}, op] if op["op"] == "unsubscribe" else [op]


def _close_at_unknown(op: Op) -> list[Op] | None:
    return None if op["op"] == "fly" else [op]


def _seconds_alone(op: Op) -> list[Op]:
    values = op.get("values")
    if isinstance(values, dict) and "time" in values:
        return [op | {"values": {"time": {"secs": 1}}}]
    return [op]


def _text_id(op: Op) -> list[Op]:
    return [op | {"id": str(op["id"])}] if "id" in op else [op]


def _float_total(op: Op) -> list[Op]:
    return [op | {"data": op["data"][1:]}] if op["op"] == "fragment" else [op]


def _wrong_error_result(op: Op) -> list[Op]:
    return [op | {"values": {}}] if op.get("result") is False else [op]


FAULTS: Final[dict[str, Fault]] = {
    "answers lack the id": Fault("services/whole", down=_without("service_response", "id")),
    "answers have another id": Fault("framing/id-any-scalar", down=_text_id),
    "failures are successes": Fault("services/unknown", down=_success),
    "failures have no text": Fault("services/unknown", down=_wrong_error_result),
    "messages have another key": Fault("topics/message-keys", down=_with("publish", type="std_msgs/String")),
    "messages come twice": Fault("topics/burst", down=_twice),
    "names are made absolute": Fault("topics/relative-name", down=_absolute_topic),
    "byte arrays are lists": Fault("conversion/bytes", down=_list_for_base64),
    "a clean client gets a status": Fault("topics/unsubscribe-nothing", up=_status_of_unsubscribe),
    "nothing is latched": Fault("topics/latch", up=_without("advertise", "latch")),
    "everything is latched": Fault("topics/latch-not", up=_with("advertise", latch=True)),
    "throttle_rate is ignored": Fault("flow/throttle-leading-edge", up=_without("subscribe", "throttle_rate")),
    "compression is ignored": Fault("encodings/cbor-string", up=_without("subscribe", "compression")),
    "pieces lose a character": Fault("encodings/fragment-out", down=_float_total),
    "pieces are not joined": Fault("encodings/fragment-in", up=_lose("fragment")),
    "requests lack args": Fault("services/args-absent", down=_without("call_service", "args")),
    "unsubscribe does nothing": Fault("topics/unsubscribe-all", up=_lose("unsubscribe")),
    "unadvertise_service does nothing": Fault("services/unadvertise", up=_lose("unadvertise_service")),
    "binary frames are lost": Fault("framing/binary-json", bytes_up=False),
    "feedback is lost": Fault("actions/whole", down=_lose("action_feedback")),
    "results lack the status": Fault("actions/whole", down=_without("action_result", "status")),
    "cancel does nothing": Fault("actions/cancel", up=_lose("cancel_action_goal")),
    "an unknown op ends the connection": Fault("framing/unknown-op", up=_close_at_unknown),
    "times lack nanoseconds": Fault("rosapi/get_time", down=_seconds_alone),
}
"""What is wrong -> the fault."""


@asynccontextmanager
async def wrong_server(url: str, fault: Fault) -> AsyncIterator[str]:
    """A server with a fault in front of a good one; its URL."""

    async def handle(client: ServerConnection) -> None:
        async with connect(url, compression=None, proxy=None, max_size=None) as server:
            carrying = asyncio.create_task(_carry_down(server, client, fault))
            try:
                async for frame in client:
                    await _carry_up(frame, client, server, fault)
            except ConnectionClosed:
                pass
            finally:
                carrying.cancel()
                await asyncio.gather(carrying, return_exceptions=True)

    async with talking_server(handle) as wrong:
        yield wrong


async def _carry_down(server: ClientConnection, client: ServerConnection, fault: Fault) -> None:
    async for frame in server:
        if isinstance(frame, bytes):
            await client.send(frame)
            continue
        for op in fault.down(json.loads(frame)) or []:
            await client.send(json.dumps(op))


async def _carry_up(frame: str | bytes, client: ServerConnection, server: ClientConnection, fault: Fault) -> None:
    if isinstance(frame, bytes) or not _is_op(frame):
        if isinstance(frame, str) or fault.bytes_up:
            await server.send(frame)
        return
    ops = fault.up(json.loads(frame))
    if ops is None:
        await client.close()
    for op in ops or []:
        await server.send(json.dumps(op))


def _is_op(text: str) -> bool:
    try:
        value = json.loads(text)
    except ValueError:
        return False
    return isinstance(value, dict) and isinstance(value.get("op"), str)
