"""The scenarios that rosbridge_suite's ROS 2 server is tested with, played against ours.

Each test keeps the upstream name of its case and asserts what that case asserts; the code is our own.
"""

from __future__ import annotations

import asyncio
import json

import pytest

from tests.conftest import Connect, Serve
from tests.support import Client, Frame, ServerProcess, mask, open_raw

SET_BOOL = "std_srvs/SetBool"
FIBONACCI = "example_interfaces/Fibonacci"


async def test_smoke(server: ServerProcess, connect: Connect) -> None:
    """Ten messages each way in a burst: all twenty arrive, in order, at subscribers with default settings."""
    a, b = await connect(server.url), await connect(server.url)
    for client in (a, b):
        for topic in ("/smoke/a", "/smoke/b"):
            await client.send("subscribe", topic=topic, type="std_msgs/String", queue_length=0)
    for client, topic in ((a, "/smoke/a"), (b, "/smoke/b")):
        await client.send("advertise", topic=topic, type="std_msgs/String")
        await client.settle()
    for i in range(10):
        await a.send("publish", topic="/smoke/a", msg={"data": f"a {i}"})
        await b.send("publish", topic="/smoke/b", msg={"data": f"b {i}"})
    for client in (a, b):
        for letter in "ab":
            heard = [(await client.message(f"/smoke/{letter}"))["data"] for _ in range(10)]
            assert heard == [f"{letter} {i}" for i in range(10)]


async def test_advertise_publish(server: ServerProcess, connect: Connect) -> None:
    """A message that follows its advertise at once is not lost."""
    listener, talker = await connect(server.url), await connect(server.url)
    await listener.subscribe("/advertise_publish", type="std_msgs/String")
    await talker.send("advertise", topic="/advertise_publish", type="std_msgs/String")
    await talker.send("publish", topic="/advertise_publish", msg={"data": "first"})
    assert await listener.message("/advertise_publish") == {"data": "first"}


async def test_call_service(server: ServerProcess, connect: Connect) -> None:
    """No id, and a type that the op does not have: answered without an id, with values as an object."""
    client = await connect(server.url)
    await client.send("call_service", service="/rosapi/get_time", type="rosapi/GetTime", args={})
    answer = await client.read()
    assert answer.keys() == {"op", "service", "values", "result"}
    assert answer["op"] == "service_response"
    assert answer["service"] == "/rosapi/get_time"
    assert answer["result"] is True
    assert isinstance(answer["values"]["time"], dict)


async def test_advertise_service(server: ServerProcess, connect: Connect) -> None:
    """Two calls in flight at once are both forwarded with their args, and each is answered by its id."""
    provider, caller = await connect(server.url), await connect(server.url)
    await provider.send("advertise_service", service="/two_at_once", type=SET_BOOL)
    await provider.settle()
    for i, data in ((1, True), (2, False)):
        await caller.send("call_service", service="/two_at_once", id=f"mine-{i}", args={"data": data})
    requests = [await provider.take("call_service") for _ in range(2)]
    assert [request["args"] for request in requests] == [{"data": True}, {"data": False}]
    for request in reversed(requests):
        values = {"success": request["args"]["data"], "message": "done"}
        await provider.send("service_response", service="/two_at_once", id=request["id"], values=values, result=True)
    for i, data in ((1, True), (2, False)):
        answer = await caller.take("service_response", id=f"mine-{i}")
        assert answer["values"] == {"success": data, "message": "done"}
        assert answer["result"] is True


async def test_advertise_service_duplicate(server: ServerProcess, connect: Connect) -> None:
    """A provider that is gone makes room: the next one gets the next call, and its own count from 1."""
    caller = await connect(server.url)
    for i in range(2):
        provider = await connect(server.url)
        await provider.send("advertise_service", service="/test_service", type=SET_BOOL)
        await provider.settle()
        await caller.send("call_service", service="/test_service", id=f"call-{i}", args={"data": True})
        request = await provider.read()
        mark = "service_request:/test_service:1"
        assert request == {"op": "call_service", "service": "/test_service", "id": mark, "args": {"data": True}}
        values = {"success": True, "message": f"provider {i}"}
        await provider.send("service_response", service="/test_service", id=mark, values=values, result=True)
        answer = await caller.take("service_response", id=f"call-{i}")
        assert answer["values"]["message"] == f"provider {i}"
        await provider.close()


async def test_multiple_subscribers(server: ServerProcess, connect: Connect) -> None:
    """Two who subscribed before anybody published get exactly this, and no other keys."""
    listeners = [await connect(server.url) for _ in range(2)]
    for listener in listeners:
        await listener.subscribe("/a_topic", type="std_msgs/String")
    talker = await connect(server.url)
    await talker.send("advertise", topic="/a_topic", type="std_msgs/String")
    await talker.send("publish", topic="/a_topic", msg={"data": "hello"})
    for listener in listeners:
        assert await listener.read() == {"op": "publish", "topic": "/a_topic", "msg": {"data": "hello"}}


@pytest.mark.parametrize("ros", [1, 2])
async def test_multiple_subscribers_raw(serve: Serve, connect: Connect, ros: int) -> None:
    """The same in cbor-raw: the bytes of ROS's own wire, and the time under the keys of ROS 1 in both generations."""
    url = serve("--ros", str(ros)).url
    listeners = [await connect(url) for _ in range(2)]
    for listener in listeners:
        await listener.subscribe("/a_topic", type="std_msgs/String", compression="cbor-raw")
    talker = await connect(url)
    await talker.send("advertise", topic="/a_topic", type="std_msgs/String")
    await talker.send("publish", topic="/a_topic", msg={"data": "hello"})
    wire = b"\x05\0\0\0hello" if ros == 1 else b"\0\1\0\0" + b"\x06\0\0\0hello\0"
    for listener in listeners:
        frame = (await listener.read())["$cbor"]
        assert frame.keys() == {"op", "topic", "msg"}
        assert (frame["op"], frame["topic"]) == ("publish", "/a_topic")
        assert frame["msg"].keys() == {"secs", "nsecs", "bytes"}
        assert all(isinstance(frame["msg"][key], int) for key in ("secs", "nsecs"))
        assert bytes.fromhex(frame["msg"]["bytes"]["$hex"]) == wire


async def test_transient_local_publisher(server: ServerProcess, connect: Connect) -> None:
    """Those who come late, one after another, each get the latched message."""
    talker = await connect(server.url)
    await talker.send("advertise", topic="/latched", type="std_msgs/String", latch=True)
    await talker.send("publish", topic="/latched", msg={"data": "for later"}, latch=True)
    await talker.settle()
    for _ in range(3):
        listener = await connect(server.url)
        await listener.send("subscribe", topic="/latched", type="std_msgs/String")
        assert await listener.message("/latched") == {"data": "for later"}
        await listener.close()


async def test_best_effort_publisher(server: ServerProcess, connect: Connect) -> None:
    """A publisher's quality of service is no obstacle, whatever it asks for."""
    listener, talker = await connect(server.url), await connect(server.url)
    await listener.subscribe("/best_effort", type="std_msgs/String")
    qos = {"reliability": "best_effort", "history": "keep_last", "depth": 1}
    await talker.send("advertise", topic="/best_effort", type="std_msgs/String", qos=qos)
    await talker.send("publish", topic="/best_effort", msg={"data": "hello"})
    assert await listener.message("/best_effort") == {"data": "hello"}
    assert await talker.settle() == []


async def perform(provider: Client, request: Frame) -> None:
    """Count Fibonacci numbers: feedback after each, and the whole as the result."""
    mark = {"action": request["action"], "id": request["id"]}
    sequence = [0, 1]
    for _ in range(1, request["args"]["order"]):
        sequence.append(sequence[-1] + sequence[-2])
        await provider.send("action_feedback", values={"sequence": sequence}, **mark)
    await provider.send("action_result", values={"sequence": sequence}, status=4, result=True, **mark)


async def test_advertise_action(server: ServerProcess, connect: Connect) -> None:
    """Two goals at once are both forwarded, with the type as it was advertised, and each is answered by its id."""
    provider, caller = await connect(server.url), await connect(server.url)
    await provider.send("advertise_action", action="/two_goals", type=FIBONACCI)
    await provider.settle()
    for i, order in ((1, 3), (2, 5)):
        goal = {"action": "/two_goals", "action_type": FIBONACCI, "args": {"order": order}}
        await caller.send("send_action_goal", id=f"mine-{i}", **goal)
    requests = [await provider.take("send_action_goal") for _ in range(2)]
    for request, order in zip(requests, (3, 5), strict=True):
        assert request.keys() == {"op", "action", "action_type", "args", "feedback", "id"}
        assert (request["action"], request["action_type"]) == ("/two_goals", FIBONACCI)
        assert request["args"] == {"order": order}
    assert requests[0]["id"] != requests[1]["id"]
    for request in reversed(requests):
        await perform(provider, request)
    for i, sequence in ((1, [0, 1, 1, 2]), (2, [0, 1, 1, 2, 3, 5])):
        result = await caller.take("action_result", id=f"mine-{i}")
        assert result["values"] == {"sequence": sequence}
        assert (result["status"], result["result"]) == (4, True)


async def test_advertise_action_feedback(server: ServerProcess, connect: Connect) -> None:
    """Feedback of a provider's reaches who sent the goal and asked for it, and comes before the result."""
    provider, caller = await connect(server.url), await connect(server.url)
    await provider.send("advertise_action", action="/feedback", type=FIBONACCI)
    await provider.settle()
    goal = {"action": "/feedback", "action_type": FIBONACCI, "args": {"order": 2}}
    await caller.send("send_action_goal", id="asked", feedback=True, **goal)
    await caller.send("send_action_goal", id="unasked", **goal)
    for _ in range(2):
        await perform(provider, await provider.take("send_action_goal"))
    values = {"sequence": [0, 1, 1]}
    feedback = {"op": "action_feedback", "action": "/feedback", "id": "asked", "values": values}
    result = {"op": "action_result", "action": "/feedback", "values": values, "status": 4, "result": True}
    assert [await caller.read() for _ in range(3)] == [feedback, {**result, "id": "asked"}, {**result, "id": "unasked"}]


async def test_send_action_goal(server: ServerProcess, connect: Connect) -> None:
    """An order of five without an id: four times feedback, then a result that says so; none has an id."""
    provider, caller = await connect(server.url), await connect(server.url)
    await provider.send("advertise_action", action="/fibonacci", type=FIBONACCI)
    await provider.settle()
    goal = {"action": "/fibonacci", "action_type": FIBONACCI, "args": {"order": 5}, "feedback": True}
    await caller.send("send_action_goal", **goal)
    await perform(provider, await provider.take("send_action_goal"))
    frames = [await caller.read() for _ in range(5)]
    assert [frame["op"] for frame in frames] == ["action_feedback"] * 4 + ["action_result"]
    assert [frame["values"]["sequence"][2:] for frame in frames] == [[1], [1, 2], [1, 2, 3], [1, 2, 3, 5], [1, 2, 3, 5]]
    assert (frames[-1]["status"], frames[-1]["result"]) == (4, True)
    assert all("id" not in frame for frame in frames)


async def test_event_loop_starvation(server: ServerProcess, connect: Connect) -> None:
    """Somebody who publishes as fast as the socket takes it does not keep the server from answering others."""
    other = await connect(server.url)
    _, writer = await open_raw(server.port)
    writer.write(mask(json.dumps({"op": "advertise", "topic": "/flood", "type": "std_msgs/String"})))
    burst = 500 * mask(json.dumps({"op": "publish", "topic": "/flood", "msg": {"data": "x" * 200}}))

    async def flood() -> None:
        while True:
            writer.write(burst)
            await writer.drain()
            await asyncio.sleep(0)  # draining alone does not let others have their turn

    flooding = asyncio.create_task(flood())
    try:
        for _ in range(20):
            assert "time" in await other.values("/rosapi/get_time")
        assert not flooding.done()
    finally:
        flooding.cancel()
        writer.transport.abort()
