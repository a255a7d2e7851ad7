"""Malformed frames and forbidden requests: refused, without effect on other clients."""

from __future__ import annotations

import asyncio
import json
import random
from collections.abc import Iterator
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed

from rosbridge_sim.loose_types import JsonValue
from tests.conftest import Connect, Serve
from tests.support import Client, ServerProcess

NUM_FRAMES = 10_000
NUM_PER_CLIENT = 500

MEMORY_BOUND = 24 * 2**20
"""What the server may have grown by in the second half [bytes]: allocators keep some; a leak of 5 kB a frame shows."""

OPS: list[dict[str, Any]] = [
    {"op": "advertise", "topic": "/t", "type": "std_msgs/String", "id": "a", "latch": True, "queue_size": 100},
    {"op": "publish", "topic": "/t", "msg": {"data": "안녕 hello"}, "id": "p", "latch": True},
    {"op": "subscribe", "topic": "/t", "type": "std_msgs/String", "id": "s", "throttle_rate": 0, "queue_length": 0},
    {"op": "subscribe", "topic": "/Ego_topic", "id": "s", "compression": "none", "fragment_size": None},
    {"op": "subscribe", "topic": "Object_topic", "type": "morai_msgs/msg/ObjectStatusList"},
    {"op": "unsubscribe", "topic": "/t", "id": "s"},
    {"op": "unadvertise", "topic": "/t", "id": "a"},
    {"op": "publish", "topic": "/odom", "type": "nav_msgs/Odometry", "msg": {"header": {"stamp": "now"}, "twist": {}}},
    {"op": "publish", "topic": "/image", "type": "sensor_msgs/Image", "msg": {"data": "AAECAw==", "height": 1}},
    {"op": "advertise", "topic": "/own", "type": "my_package/Own"},
    {"op": "publish", "topic": "/own", "msg": {"any": ["thing", 1, 2.5, None, {"deep": [[[]]]}]}},
    {"op": "publish", "topic": "/ctrl_cmd", "msg": {"longlCmdType": 1, "accel": 0.5, "steering": -0.1}},
    {"op": "publish", "topic": "/Ego_topic", "msg": {"heading": 90.0}},
    {"op": "publish", "topic": "/SyncModeAddObj", "msg": {"name": "Box", "position": {"x": 1.0}, "frame": 3}},
    {"op": "publish", "topic": "/SyncModeRemoveObj", "msg": {"unique_id": 3, "frame": 3}},
    {"op": "advertise_service", "service": "/add", "type": "example_interfaces/AddTwoInts"},
    {"op": "advertise_service", "service": "/SyncModeCmd", "type": "morai_msgs/MoraiSyncModeCmdSrv"},
    {"op": "call_service", "service": "/add", "id": 7, "args": {"a": 2**62, "b": -1}, "timeout": 0.05},
    {"op": "service_response", "service": "/add", "id": "service_request:/add:1", "values": {"sum": 3}, "result": True},
    {"op": "unadvertise_service", "service": "/add"},
    {"op": "call_service", "service": "/rosapi/topics", "id": "c"},
    {"op": "call_service", "service": "/rosapi/node_details", "args": {"node": "/morai_sim"}},
    {"op": "call_service", "service": "/rosapi/set_param", "args": {"name": "/p", "value": '{"a": [1]}'}},
    {"op": "call_service", "service": "/rosapi/get_param", "args": ["/p", "0"]},
    {
        "op": "call_service",
        "service": "/SyncModeCmd",
        "args": {"request": {"user_id": "fuzz", "start_sync_mode": True, "time_step": 20}},
    },
    {
        "op": "call_service",
        "service": "/SyncModeWaitForTick",
        "args": {"request": {"user_id": "fuzz", "frame": 2.0}},
    },
    {
        "op": "call_service",
        "service": "/SyncModeCtrlCmd",
        "args": {"request": {"frame": 1, "command": {"longCmdType": 2, "velocity": 9e9}, "sensor_capture": False}},
    },
    {"op": "call_service", "service": "/SyncModeSetGear", "args": {"request": {"gear": 4, "frame": 0}}},
    {
        "op": "call_service",
        "service": "/Service_MoraiSL",
        "args": {"request": {"file_name": "demo", "delete_all": True, "load_object_data": True}},
    },
    {"op": "call_service", "service": "/Service_MoraiEventCmd", "args": {"request": {"option": 3, "ctrl_mode": 3}}},
    {"op": "call_service", "service": "/Service_MoraiVehicleSpec", "args": {"request": {"unique_id": 0}}},
    {"op": "set_level", "level": "info"},
    {"op": "status", "level": "error", "msg": "from a client"},
    {"op": "auth", "mac": "", "client": "", "t": 0},
    {"op": "fragment", "id": "f", "num": 0, "total": 2, "data": '{"op":'},
    {"op": "fragment", "id": "f", "num": 1, "total": 2, "data": '"set_level","level":"none"}'},
    {
        "op": "png",
        "data": "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4z8AAAAMBAQDJ/pLvAAAAAElFTkSuQmCC",
    },
    {"op": "subscribe", "topic": "/t", "id": 1, "throttle_rate": 10, "queue_length": 3, "compression": "png"},
    {"op": "subscribe", "topic": "/Object_topic", "id": 2, "compression": "cbor", "fragment_size": 100},
    {
        "op": "subscribe",
        "topic": "/clock",
        "id": 3,
        "compression": "cbor-raw",
        "qos": {"depth": 1, "history": "keep_last"},
    },
    {"op": "advertise_action", "action": "/fib", "type": "example_interfaces/Fibonacci"},
    {
        "op": "send_action_goal",
        "action": "/fib",
        "action_type": "example_interfaces/Fibonacci",
        "args": {"order": 5},
        "feedback": True,
        "id": "g",
    },
    {"op": "cancel_action_goal", "action": "/fib", "id": "g"},
    {"op": "action_feedback", "action": "/fib", "id": "action_goal:/fib:1", "values": {"sequence": [0, 1]}},
    {"op": "action_result", "action": "/fib", "id": "action_goal:/fib:1", "values": {}, "status": 4, "result": True},
    {"op": "unadvertise_action", "action": "/fib"},
]

ODD: list[Any] = [
    None, True, False, 0, -1, 1, 2**31, 2**63, 2**64, -(2**63) - 1, 10**400, 0.5, -0.0, 1e308, 1e-320,
    "", " ", "/", "//", "\x00", "\ud800", "x" * 5000, "../../etc/passwd", "/Ego_topic", "std_msgs/String", "now",
    [], [[]], [None], [1] * 500, {}, {"request": None}, {"": {"": {}}}, {str(i): i for i in range(50)},
    float("nan"), float("inf"), "demo", "Man", 20, 4,
]  # fmt: skip

TEXTS = [
    "", " ", "{", "}", "{}", "[]", "null", "NaN", '"op"', "{{}}", '{"op":}', '{"op":"publish"', '{"receiver":"/x"}',
    "[" * 3000, '{"a":' * 3000, '{"op":"publish","op":"subscribe","topic":"/t"}', "\ufeff{}",
    '{"op":"subscribe","topic":"/t\\ud800"}', '{"op":"unheard_of","id":"u"}',
    '{"op":"publish","topic":"/t","msg":{"data":"' + "y" * 20000 + '"}}',
]  # fmt: skip


def spoil(chance: random.Random, value: JsonValue) -> JsonValue:
    """The value with one thing in it changed, somewhere."""
    if isinstance(value, dict) and value and chance.random() < 0.9:
        key = chance.choice(list(value))
        action = chance.randrange(4)
        if action == 0:
            return {k: v for k, v in value.items() if k != key}
        if action == 1:
            return {**value, chance.choice(["extra", "", "topic", "msg", "png", "args"]): chance.choice(ODD)}
        return {**value, key: spoil(chance, value[key])}
    if isinstance(value, list) and value and chance.random() < 0.7:
        i = chance.randrange(len(value))
        return [*value[:i], spoil(chance, value[i]), *value[i + 1 :]]
    return chance.choice(ODD)


def damage(chance: random.Random, text: str) -> bytes:
    """A frame's text cut, glued, bent, replaced by something odd or by noise; or left as it is."""
    kind = chance.randrange(10)
    if kind == 0:
        text = text[: chance.randrange(len(text) + 1)]
    elif kind == 1:
        text += chance.choice(["", " ", "\n", ",", "\x00"]) + json.dumps(chance.choice(OPS))
    elif kind == 2:
        text = chance.choice(TEXTS)
    data = bytearray(text.encode("utf-8", "surrogatepass"))
    if kind == 3:
        for _ in range(chance.randrange(1, 8)):
            data[chance.randrange(len(data))] = chance.randrange(256)
    elif kind == 4:
        data = bytearray(chance.randbytes(chance.randrange(200)))
    return bytes(data)


def hostile_frames(seed: int) -> Iterator[str | bytes]:
    """Frames without end: good ones, spoilt ones, damaged ones, in text and in binary frames."""
    chance = random.Random(seed)  # noqa: S311 - to be repeated, not to be secret
    while True:
        op: Any = chance.choice(OPS)
        for _ in range(chance.choice([0, 1, 1, 2, 5])):
            op = spoil(chance, op)
        data = damage(chance, json.dumps(op, ensure_ascii=chance.random() < 0.8))
        try:  # a text frame must be UTF-8, or the WebSocket itself ends; JSON in binary frames need not
            yield data.decode() if chance.random() < 0.7 else data
        except UnicodeDecodeError:
            yield data


async def send_and_go(url: str, frames: list[str | bytes]) -> None:
    """One hostile client: sends all of it, reads what comes, and leaves."""
    client = await Client.open(url)

    async def drain() -> None:
        try:
            async for _ in client.socket:
                pass
        except ConnectionClosed:
            pass

    draining = asyncio.create_task(drain())
    for frame in frames:
        await client.send_raw(frame)
    await client.close()  # the server answers the closing only after it has handled all frames
    await draining
    assert client.socket.close_code == 1000, "it was not thrown out either"


async def be_a_good_client(url: str, connect: Connect) -> None:
    """Topics, services and the world still do what they are for."""
    talker, listener = await connect(url), await connect(url)
    await listener.subscribe("/good", type="std_msgs/String")
    await talker.send("advertise", topic="/good", type="std_msgs/String")
    await talker.send("publish", topic="/good", msg={"data": "hello"})
    assert await listener.message("/good") == {"data": "hello"}
    await talker.ask("/Service_MoraiSL", file_name="demo", delete_all=True, load_ego_vehicle_data=True)
    await talker.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    started = await talker.ask("/SyncModeCmd", user_id="good", start_sync_mode=True, time_step=20)
    assert started["result"] is True
    answer = await talker.ask("/SyncModeWaitForTick", user_id="good", frame=started["frame"] + 1)
    assert (answer["tick_status"], answer["frame"]) == (True, started["frame"] + 1)
    await talker.ask("/SyncModeCmd", user_id="good", start_sync_mode=False, time_step=20)
    assert await talker.settle() == []


@pytest.mark.slow
async def test_ten_thousand_hostile_frames_change_nothing(serve: Serve, connect: Connect) -> None:
    process = serve()
    frames = hostile_frames(seed=20)
    memory_half_way = 0
    for i in range(NUM_FRAMES // NUM_PER_CLIENT):
        if i == NUM_FRAMES // NUM_PER_CLIENT // 2:
            memory_half_way = process.memory
        await send_and_go(process.url, [next(frames) for _ in range(NUM_PER_CLIENT)])
    assert process.is_alive
    assert process.memory < memory_half_way + MEMORY_BOUND
    await be_a_good_client(process.url, connect)
    assert "Traceback" not in process.log


async def test_clients_cannot_take_names_of_the_simulator(moving_server: ServerProcess, connect: Connect) -> None:
    thief, watcher = await connect(moving_server.url), await connect(moving_server.url)
    await watcher.subscribe("/Ego_topic", type="morai_msgs/EgoVehicleStatus")
    attempts: dict[str, dict[str, Any]] = {
        "serve": {"op": "advertise_service", "service": "/SyncModeCmd", "type": "morai_msgs/MoraiSyncModeCmdSrv"},
        "rosapi": {"op": "advertise_service", "service": "/rosapi/topics", "type": "rosapi/Topics"},
        "take": {"op": "advertise", "topic": "/Ego_topic", "type": "morai_msgs/EgoVehicleStatus"},
        "publish": {"op": "publish", "topic": "/Ego_topic", "msg": {"unique_id": 99}},
        "relative": {"op": "publish", "topic": "Object_topic", "msg": {}},
        "unserve": {"op": "unadvertise_service", "service": "/SyncModeCmd"},
        "respond": {"op": "service_response", "service": "/SyncModeCmd", "result": True, "values": {}},
    }
    for mark, attempt in attempts.items():
        await thief.send_raw(json.dumps({**attempt, "id": mark}))
        told = await thief.take("status", id=mark)
        assert told["level"] == "error"
        assert told["msg"]
    for _ in range(5):
        assert (await watcher.message("/Ego_topic"))["unique_id"] != 99
    answer = await watcher.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
    assert answer["result"] is True
    await watcher.ask("/SyncModeCmd", user_id="me", start_sync_mode=False, time_step=20)
