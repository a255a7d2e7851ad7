"""The far bridge behaves like rosbridge_suite for ROS 1, where that is unexpected.

A bare client plays both the simulator and the ROS program behind it. What never comes is told by what comes instead:
the answer to a later call.
"""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio

from tests.conftest import Connect
from tests.far_side.server import FarSide
from tests.support import Client, FarSideProcess, Frame

SET_BOOL = "std_srvs/SetBool"
STRING = "std_msgs/String"


@pytest_asyncio.fixture
async def far_side() -> AsyncIterator[FarSide]:
    async with FarSide() as one:
        yield one
        one.log.clear()  # tests send what does not fit


@pytest_asyncio.fixture
async def provider(far_side: FarSide, connect: Connect) -> Client:
    """A client that serves /switch."""
    client = await connect(far_side.url)
    await client.send("advertise_service", service="/switch", type=SET_BOOL)
    await client.settle()
    return client


async def answer(provider: Client, **fields: object) -> None:
    """Answer the next call of /switch with these fields of a `service_response`."""
    request = await provider.take("call_service", service="/switch")
    await provider.send("service_response", service="/switch", id=request["id"], **fields)


async def ask(client: Client, mark: str) -> None:
    await client.send("call_service", service="/switch", id=mark, args={"data": True})


async def hears_nothing(client: Client) -> None:
    assert await client.settle() == []


# Mistakes


@pytest.mark.parametrize(
    ("frame", "logged"),
    [
        ({"op": "set_level", "level": "info"}, "Unknown operation: set_level"),
        ({"op": "status", "level": "info", "msg": "here"}, "Unknown operation: status"),
        ({"no": "op"}, "Received a message without an op."),
        ([1, 2], "deserialization"),
        ({"op": "advertise", "topic": "/t"}, "advertise: Expected a type field but none was found."),
        ({"op": "subscribe", "topic": "/t", "type": None}, "Expected field type to be one of <class 'str'>"),
        ({"op": "subscribe", "topic": "/t"}, "Cannot infer topic type for topic /t as it is not yet advertised"),
        ({"op": "publish", "topic": "/t", "msg": {}}, "Cannot infer topic type for topic /t"),
        ({"op": "advertise", "topic": "/t", "type": "std_msgs/msg/String"}, "is not a valid type string"),
        ({"op": "advertise", "topic": "/t", "type": "no_msgs/X"}, "Unable to import no_msgs.msg from package no_msgs."),
        (
            {"op": "advertise", "topic": "/t", "type": "std_msgs/X"},
            "Unable to import msg class X from package std_msgs",
        ),
        ({"op": "advertise_service", "service": "/s", "type": "no_msgs/X"}, "Unable to import no_msgs.srv"),
        ({"op": "unadvertise_service", "service": "/s"}, "can't unadvertise"),
        ({"op": "service_response", "service": "/s", "id": "1", "result": True}, "has not been advertised"),
    ],
)
async def test_error_is_logged_and_not_sent_to_the_client(
    far_side: FarSide, connect: Connect, frame: object, logged: str
) -> None:
    client = await connect(far_side.url)
    await client.send_raw(json.dumps(frame))
    await hears_nothing(client)
    assert logged in far_side.log[-1]


async def test_text_that_is_not_json_waits_for_the_next_frame(far_side: FarSide, connect: Connect) -> None:
    client = await connect(far_side.url)
    call = {"op": "call_service", "service": "/rosapi/get_time"}
    text = json.dumps({**call, "id": "halved"}) + json.dumps({**call, "id": "glued"})
    await client.send_raw(text[:20])
    await client.send_raw(text[20:])
    for mark in ("halved", "glued"):
        await client.take("service_response", id=mark)


# Topics


@pytest.mark.parametrize(
    ("kind", "msg", "logged"),
    [
        (STRING, {"text": ""}, "Message type std_msgs/String does not have a field text"),
        (
            STRING,
            {"data": None},
            "std_msgs/String message requires a string for field data, but got a <class 'NoneType'>",
        ),
        ("std_msgs/Float64", {"data": None}, "requires a float64 for field data, but got a <class 'NoneType'>"),
        (
            "sensor_msgs/LaserScan",
            {"ranges": [1.0, None]},
            "sensor_msgs/LaserScan message requires a float32 for field ranges, but got a <class 'NoneType'>",
        ),
        (
            "geometry_msgs/PoseArray",
            {"poses": [{"position": {"x": None}}]},
            "requires a float64 for field poses.position.x, but got a <class 'NoneType'>",
        ),
        ("std_msgs/Int8", {"data": 1.0}, "requires a int8 for field data, but got a <class 'float'>"),
        ("std_msgs/Int8", {"data": 128}, "field data: integer out of range for 'b' format code"),
        ("std_msgs/Bool", {"data": 1}, "requires a bool for field data, but got a <class 'int'>"),
        ("std_msgs/Header", {"stamp": {"secs": 1}, "frame": ""}, "does not have a field frame"),
    ],
)
async def test_message_that_does_not_fit_its_type_is_dropped(
    far_side: FarSide, connect: Connect, kind: str, msg: Frame, logged: str
) -> None:
    client = await connect(far_side.url)
    await client.send("advertise", topic="/t", type=kind)
    await client.subscribe("/t")
    await client.send("publish", topic="/t", msg=msg)
    await hears_nothing(client)
    assert logged in far_side.log[-1]


async def test_words_that_python_reads_are_numbers(far_side: FarSide, connect: Connect) -> None:
    client = await connect(far_side.url)
    await client.send("advertise", topic="/scan", type="sensor_msgs/LaserScan")
    await client.subscribe("/scan")
    for text in ("Infinity", "-Infinity", "NaN"):
        frame = f'{{"op": "publish", "topic": "/scan", "msg": {{"ranges": [1.0, {text}], "range_max": {text}}}}}'
        await client.send_raw(frame)
        heard = await client.message("/scan")
        assert (heard["ranges"], heard["range_max"]) == ([1.0, None], None), "its own way out has no words"
    assert not far_side.log


async def test_relayed_messages_have_all_fields_as_ros_1_serializes_them(far_side: FarSide, connect: Connect) -> None:
    client = await connect(far_side.url)
    await client.send("advertise", topic="/scan", type="sensor_msgs/LaserScan")
    await client.subscribe("scan")
    for _ in range(2):
        msg = {"header": {"seq": 77}, "range_max": 0.1, "ranges": [1, 1e39]}
        await client.send("publish", topic="/scan", msg=msg)
        heard = await client.message("scan")
    assert heard["range_max"] == 0.10000000149011612
    assert heard["ranges"] == [1.0, None]
    assert heard["angle_min"] == 0.0
    assert heard["header"]["stamp"]["secs"] > 0, "a header without a stamp gets the time"
    assert heard["header"]["seq"] == 2, "the publisher's own count"


async def test_a_topic_keeps_its_type(far_side: FarSide, connect: Connect) -> None:
    first, second = await connect(far_side.url), await connect(far_side.url)
    await first.send("advertise", topic="/t", type=STRING)
    await first.settle()
    await second.send("advertise", topic="/t", type="std_msgs/Bool")
    await hears_nothing(second)
    assert "Tried to register topic /t with type std_msgs/Bool but it is already established" in far_side.log[-1]
    await first.close()
    topics = await second.values("/rosapi/topics")
    assert "/t" in topics["topics"], "a publisher outlives its client"


async def test_latched_messages_are_sent_at_each_subscribe(far_side: FarSide, connect: Connect) -> None:
    client = await connect(far_side.url)
    await client.send("advertise", topic="/t", type=STRING, latch=True)
    await client.send("publish", topic="/t", msg={"data": "kept"})
    for i in range(2):
        await client.send("subscribe", topic="/t", id=f"{i}")
        assert await client.message("/t") == {"data": "kept"}


async def test_throttle_without_a_queue_loses_the_last_of_a_burst(far_side: FarSide, connect: Connect) -> None:
    client = await connect(far_side.url)
    await client.send("subscribe", topic="/t", type=STRING, throttle_rate=100_000)
    await client.send("subscribe", topic="/other", type=STRING, throttle_rate=100_000)
    await client.send("subscribe", topic="/other", type=STRING, id="second")
    for topic in ("/t", "/other"):
        for i in range(3):
            await client.send("publish", topic=topic, msg={"data": f"{i}"})
    assert [(await client.message("/other"))["data"] for _ in range(3)] == ["0", "1", "2"], "the lowest counts"
    assert [frame["msg"]["data"] for frame in await client.settle()] == ["0"]


async def test_queue_drops_the_oldest(far_side: FarSide, connect: Connect) -> None:
    client = await connect(far_side.url)
    await client.subscribe("/t", type=STRING, throttle_rate=50, queue_length=1)  # [ms]: much longer than a publish
    for i in range(100):
        await client.send("publish", topic="/t", msg={"data": f"{i}"})
    heard = [await client.message("/t")]
    while heard[-1]["data"] != "99":
        heard.append(await client.message("/t"))
    assert len(heard) < 100


# Services


async def test_result_false_counts_as_success_with_its_values(
    far_side: FarSide, connect: Connect, provider: Client
) -> None:
    client = await connect(far_side.url)
    await ask(client, "mine")
    await answer(provider, result=False, values={"message": "no"})
    frame = await client.take("service_response", id="mine")
    assert (frame["result"], frame["values"]) == (True, {"success": False, "message": "no"})


@pytest.mark.parametrize(
    ("fields", "logged"),
    [
        ({"result": False}, "service_response: KeyError('values')"),
        ({"result": False, "values": "no"}, "Expected a JSON object for type std_srvs/SetBoolResponse"),
        ({"result": True, "values": {"reason": "no"}}, "does not have a field reason"),
        ({"values": {}}, "service_response: Expected a result field but none was found."),
    ],
)
async def test_caller_waits_forever_if_the_values_do_not_fit(
    far_side: FarSide, connect: Connect, provider: Client, fields: Frame, logged: str
) -> None:
    client = await connect(far_side.url)
    await ask(client, "mine")
    await answer(provider, **fields)
    await hears_nothing(provider)
    await hears_nothing(client)
    assert logged in far_side.log[-1]


async def test_lost_provider_stays_listed_and_its_callers_wait(
    far_side: FarSide, connect: Connect, provider: Client
) -> None:
    client, heir = await connect(far_side.url), await connect(far_side.url)
    await ask(client, "before")
    await provider.take("call_service")
    await provider.close()
    await ask(client, "after")
    await hears_nothing(client)
    assert "/switch" in (await client.values("/rosapi/services"))["services"]
    assert "WebSocketClosedError" in far_side.log[-1]
    await heir.send("advertise_service", service="/switch", type=SET_BOOL)
    for mark in ("before", "after"):
        frame = await client.take("service_response", id=mark)
        assert (frame["result"], frame["values"]) == (False, "Service /switch was unadvertised")
    assert any("Duplicate service advertised. Overwriting /switch." in line for line in far_side.log)
    await ask(client, "new")
    await answer(heir, result=True, values={"success": True})
    assert (await client.take("service_response", id="new"))["values"]["success"] is True


async def test_last_advertiser_serves_without_a_notice(far_side: FarSide, connect: Connect, provider: Client) -> None:
    heir = await connect(far_side.url)
    await heir.send("advertise_service", service="/switch", type=SET_BOOL)
    await hears_nothing(heir)
    await hears_nothing(provider)
    await ask(provider, "mine")
    await answer(heir, result=True, values={})
    await provider.take("service_response", id="mine")


async def test_calls_in_flight_are_answered_in_any_order(far_side: FarSide, connect: Connect, provider: Client) -> None:
    client = await connect(far_side.url)
    for mark in ("a", "b"):
        await ask(client, mark)
    requests = [await provider.take("call_service") for _ in range(2)]
    assert [request["id"] for request in requests] == [f"service_request:/switch:{n}" for n in (1, 2)]
    for request in reversed(requests):
        await provider.send("service_response", service="/switch", id=request["id"], values={}, result=True)
    assert [(await client.take("service_response"))["id"] for _ in range(2)] == ["b", "a"]


@pytest.mark.parametrize(
    ("service", "args", "told"),
    [
        ("/nobody", {}, "Service /nobody does not exist"),
        ("/switch", {"on": True}, "Message type std_srvs/SetBoolRequest does not have a field on"),
        ("/rosapi/message_details", {"type": "no_msgs/X"}, "Unable to import no_msgs.msg from package no_msgs."),
    ],
)
async def test_failed_call_has_a_text_as_its_values(
    far_side: FarSide, provider: Client, service: str, args: Frame, told: str
) -> None:
    assert far_side.num_clients == 1
    frame = await provider.call(service, args)
    assert frame["result"] is False
    assert told in frame["values"]


# Fragments


async def test_long_messages_come_in_unrequested_fragments(connect: Connect) -> None:
    async with FarSide(max_message_size=100) as far_side:
        client = await connect(far_side.url)
        await client.send("subscribe", topic="/t", type=STRING)
        await client.send("publish", topic="/t", msg={"data": "x" * 300})
        first = await client.take("fragment")
        assert first["id"] == 0
        assert isinstance(first["total"], float)
        pieces = [first] + [await client.take("fragment", id=0) for _ in range(math.floor(first["total"]) - 1)]
        assert [piece["num"] for piece in pieces] == [0, 1, 2, 3]
        assert json.loads("".join(piece["data"] for piece in pieces))["msg"]["data"] == "x" * 300


# Machines


async def test_bridge_can_lack_a_package_and_rosapi(connect: Connect) -> None:
    async with FarSide(without=["morai_msgs"], has_rosapi=False) as far_side:
        client = await connect(far_side.url)
        await client.send("subscribe", topic="/Ego_topic", type="morai_msgs/EgoVehicleStatus")
        frame = await client.call("/rosapi/topics")
        assert frame["values"] == "Service /rosapi/topics does not exist"
        assert "Unable to import morai_msgs.msg from package morai_msgs." in far_side.log[-1]


async def test_unhandled_frames_of_a_slow_bridge_are_unbounded(far_side: FarSide, connect: Connect) -> None:
    client = await connect(far_side.url)
    far_side.may_work.clear()
    for i in range(1000):
        await client.send("publish", topic="/client_count", msg={"data": i})
    pong = await client.socket.ping()
    await pong
    assert far_side.most_waiting >= 1000, "all was read, and pings are answered"
    far_side.may_work.set()
    await client.settle()
    assert far_side.num_handled == 1001


async def test_restarted_bridge_remembers_nothing(far_side: FarSide, connect: Connect, provider: Client) -> None:
    url = far_side.url
    await far_side.kill()
    await provider.socket.wait_closed()
    assert provider.socket.close_code == 1006
    await far_side.listen()
    assert far_side.url == url
    client = await connect(url)
    assert "/switch" not in (await client.values("/rosapi/services"))["services"]


@pytest.mark.slow
async def test_far_bridge_runs_as_a_process(connect: Connect, tmp_path: Path) -> None:
    options = ["--provide", f"/switch={SET_BOOL}", "--utf8-check", "0.1", "--rosapi-delay", "0.01"]
    process = FarSideProcess(tmp_path / "log.txt", options)
    try:
        client = await connect(process.url)
        assert (await client.values("/switch", {"data": True}))["success"] is False
        assert process.report == {"handled": 1, "most_waiting": 1, "clients": 1, "published": {}}
        await client.close()
    finally:
        process.stop_cleanly()


async def test_check_of_a_long_text_takes_its_time(far_side: FarSide, connect: Connect) -> None:
    client = await connect(far_side.url)
    far_side.utf8_check = 0.5
    loop = asyncio.get_running_loop()
    began = loop.time()
    await client.send("publish", topic="/nothing", msg={"data": "x" * 200_000})
    await client.values("/rosapi/get_time")
    assert loop.time() - began >= 0.1


async def test_busy_rosapi_answers_later(connect: Connect) -> None:
    async with FarSide(rosapi_delay=0.05) as far_side:
        client = await connect(far_side.url)
        loop = asyncio.get_running_loop()
        began = loop.time()
        await client.values("/rosapi/get_time")
        assert loop.time() - began >= 0.05
