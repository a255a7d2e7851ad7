"""Topics of the server about itself."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from typing import Any, cast

import pytest
import pytest_asyncio

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.policy import OPEN, Policy, Rule
from rosbridge_sim.schema.message import Message
from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.shell.monitoring.server_topics import ServerTopics
from rosbridge_sim.shell.monitoring.topic_report import TopicReport
from rosbridge_sim.shell.websocket.limits import ServerLimits
from rosbridge_sim.shell.websocket.server import Server
from tests.graph.bus_fixture import make_bus
from tests.support import Client, mask, open_raw


class Owner(Participant):
    """A publisher."""

    name = "/owner"

    def notify(self, level: str, text: str) -> None:
        raise AssertionError((level, text))


@pytest_asyncio.fixture
async def sim() -> AsyncIterator[Simulator]:
    async with Simulator(port=0, world=False) as sim:
        yield sim


async def test_client_list_is_latched_and_follows_each_change(sim: Simulator) -> None:
    async with await Client.open(sim.url) as first:
        await first.send("subscribe", topic="/client_count")
        await first.send("subscribe", topic="/connected_clients")
        assert (await first.message("/client_count"))["data"] == 1
        async with await Client.open(sim.url):
            assert (await first.message("/client_count"))["data"] == 2
        assert (await first.message("/client_count"))["data"] == 1
        (entry,) = (await first.message("/connected_clients"))["clients"]
        assert entry["ip_address"] == "127.0.0.1"
        assert entry["connection_time"]["secs"] > 1_700_000_000


async def test_client_changes_in_one_loop_turn_are_published_once() -> None:
    bus = make_bus()
    server = Server(bus, ServerLimits(), lambda: None)
    reports = ServerTopics(bus, server, asyncio.get_running_loop())
    counts: list[int] = []
    bus.subscribe(reports, "/client_count", lambda _topic, message, _sender, _now: counts.append(message.value.data))
    for _ in range(100):
        server.on_clients()
    assert counts == []
    await asyncio.sleep(0)
    assert counts == [0]
    server.on_clients()
    reports.stop()
    await asyncio.sleep(0)
    assert counts == [0]


async def test_log_is_published_on_rosout_where_clients_may_publish_too(sim: Simulator) -> None:
    async with await Client.open(sim.url) as client:
        assert (await client.values("/rosapi/topic_type", {"topic": "/rosout"})) == {"type": "rosgraph_msgs/Log"}
        await client.subscribe("/rosout")
        await client.settle()
        logging.getLogger("rosbridge_sim.test").warning("a line with %s", "a value")
        line = await client.message_where("/rosout", lambda log: log["msg"] == "a line with a value")
        assert (line["level"], line["name"], line["file"]) == (4, "/rosbridge_sim/test", "test_server_topics.py")
        assert line["header"]["stamp"]["secs"] > 1_700_000_000
        logging.getLogger("rosbridge_sim.test").debug("below info")
        await client.send("advertise", topic="/rosout", type="rosgraph_msgs/Log")
        await client.send("publish", topic="/rosout", msg={"msg": "mine", "level": 2})
        assert (await client.message("/rosout"))["msg"] == "mine"


async def test_rosout_has_the_type_of_the_ros_version() -> None:
    async with Simulator(port=0, world=False, ros=2) as sim, await Client.open(sim.url) as client:
        topics = await client.values("/rosapi/topics")
        assert dict(zip(topics["topics"], topics["types"], strict=True))["/rosout"] == "rcl_interfaces/msg/Log"
        await client.subscribe("/rosout")
        logging.getLogger("rosbridge_sim.test").error("a line")
        line = await client.message("/rosout")
        assert (line["level"], line["msg"]) == (40, "a line")
        assert line["stamp"]["sec"] > 1_700_000_000


async def test_stalled_client_is_counted_and_others_are_unaffected() -> None:
    async with Simulator(port=0, world=False, outbox_burst=10, outbox_size=100_000) as sim, AsyncExitStack() as stack:
        assert sim.bus is not None
        _, writer = await open_raw(sim.port)  # nobody ever reads from it
        writer.write(mask(json.dumps({"op": "subscribe", "topic": "/big", "type": "std_msgs/String"})))
        talker = await stack.enter_async_context(await Client.open(sim.url))
        await talker.send("advertise", topic="/big", type="std_msgs/String")
        live = [await stack.enter_async_context(await Client.open(sim.url)) for _ in range(3)]
        for client in live:
            await client.subscribe("/big", type="std_msgs/String")
        while len(sim.bus.topics["/big"].subscriptions) < 4:
            await talker.settle()
        for i in range(400):
            await talker.send("publish", topic="/big", msg={"data": f"{i}:" + "x" * 50_000})
            for client in live:
                assert (await client.message("/big"))["data"].startswith(f"{i}:")
        await talker.subscribe("/sim/clients")
        status = await talker.message("/sim/clients")
        stalled, _, *readers = status["clients"]
        assert stalled["dropped_topics"] == ["/big"]
        assert 100 < stalled["dropped_counts"][0] < 400
        assert 0 < stalled["bytes_waiting"] < 20_000_000
        for reader in readers:
            assert (reader["dropped_topics"], reader["frames_refused"]) == ([], 0)
            assert reader["messages_sent"] == 400
            assert reader["bytes_sent"] > 20_000_000
        writer.transport.abort()


async def test_client_that_cannot_be_listed_is_disconnected_and_others_listed(sim: Simulator) -> None:
    async with await Client.open(sim.url) as listener, await Client.open(sim.url) as bad:
        await listener.subscribe("/sim/clients")
        await bad.settle()
        assert sim._server is not None
        assert sim._reports is not None
        sim._reports._timer.cancel()  # a message that comes by itself would have both clients
        await listener.settle()
        served = list(sim._server.clients)[1]
        served.outbox.dropped = None  # type: ignore[assignment] # as good a bug as any
        sim._reports._tick()
        sim._reports._tick()  # before it is closed
        (status,) = (await listener.message("/sim/clients"))["clients"]
        assert status["address"] != served.peer.address
        await bad.socket.wait_closed()
        assert bad.socket.close_code == 1011
        assert sim.num_bugs == 1


async def test_failing_rosout_subscriber_affects_neither_writer_nor_others(
    sim: Simulator, caplog: pytest.LogCaptureFixture
) -> None:
    async with await Client.open(sim.url) as good, await Client.open(sim.url) as bad:
        for client in (good, bad):
            await client.subscribe("/rosout")
        assert sim._server is not None
        served = list(sim._server.clients)[1]
        served.peer.topics._subscriptions["/rosout"].feed._head = 5  # type: ignore[assignment] # as above
        logging.getLogger("rosbridge_sim.app").warning("a line")
        assert (await good.message("/rosout"))["msg"] == "a line"
        await bad.socket.wait_closed()
        assert bad.socket.close_code == 1011
        assert sim.num_bugs == 1
        assert len([record for record in caplog.records if record.exc_info]) == 1


async def test_client_that_fails_on_its_own_failure_line_is_disconnected_once(
    sim: Simulator, caplog: pytest.LogCaptureFixture
) -> None:
    async with await Client.open(sim.url) as client:
        await client.subscribe("/rosout")
        await client.subscribe("/t", type="std_msgs/String")
        assert sim._server is not None
        (served,) = sim._server.clients
        for listening in served.peer.topics._subscriptions.values():
            listening.feed._head = 5  # type: ignore[assignment] # as above
        await client.send("publish", topic="/t", msg={"data": "x"})
        await client.socket.wait_closed()
        assert client.socket.close_code == 1011
        assert len([record for record in caplog.records if record.exc_info]) == 1


async def test_failing_rosout_publication_does_not_fail_the_writer(sim: Simulator) -> None:
    async with await Client.open(sim.url) as client:
        await client.subscribe("/rosout")
        assert sim._reports is not None
        sim._reports._log._ros = 3  # type: ignore[assignment] # as above
        logging.getLogger("rosbridge_sim.app").warning("a line")
        assert await client.settle() == []
        assert sim.num_bugs == 1


async def test_topics_tell_types_traffic_and_clients_while_somebody_listens(sim: Simulator) -> None:
    assert sim.bus is not None
    async with await Client.open(sim.url) as talker, await Client.open(sim.url) as listener:
        await talker.send("advertise", topic="/chatter", type="std_msgs/String")
        await listener.subscribe("/chatter", type="std_msgs/String")
        await listener.send("subscribe", topic="/sim/topics")  # `subscribe` would lose a message that comes at once
        first = await listener.message("/sim/topics")
        (chatter,) = [each for each in first["topics"] if each["name"] == "/chatter"]
        assert (chatter["rate"], chatter["size"], chatter["bytes_per_second"]) == (-1.0, 0, 0.0)
        for _ in range(10):
            await talker.send("publish", topic="/chatter", msg={"data": "hello"})
        (chatter,) = [each for each in (await listener.message("/sim/topics"))["topics"] if each["name"] == "/chatter"]
        assert (chatter["type"], chatter["size"], chatter["dropped"]) == ("std_msgs/String", len('{"data":"hello"}'), 0)
        assert 0.0 < chatter["rate"] <= 11.0
        assert chatter["bytes_per_second"] == chatter["rate"] * chatter["size"]
        assert [len(chatter[side]) for side in ("publishers", "subscribers")] == [1, 1]
        assert chatter["publishers"] != chatter["subscribers"]
        (own,) = [each for each in first["topics"] if each["name"] == "/sim/topics"]
        assert own["publishers"] == ["/rosbridge_websocket"]
        await listener.send("unsubscribe", topic="/sim/topics")
        await listener.settle()


async def test_topics_are_counted_only_while_somebody_listens() -> None:
    bus = make_bus()
    report = TopicReport(bus, OPEN)
    report.stop()
    taken = report.take((), 10.0)
    assert taken["num_topics"] == 0
    owner = Owner()
    topic = bus.advertise(owner, "/a", "std_msgs/Int32")
    for _ in range(5):
        bus.publish(owner, topic, Message(topic.type, topic.type.default()), 0.0)
    (told,) = cast("list[Any]", report.take((), 12.0)["topics"])
    assert (told.rate, told.size, told.publishers) == (2.5, len('{"data":0}'), ["/owner"])
    (told,) = cast("list[Any]", report.take((), 13.0)["topics"])
    assert (told.rate, told.size) == (0.0, 0)
    report.stop()
    bus.publish(owner, topic, Message(topic.type, topic.type.default()), 0.0)
    (told,) = cast("list[Any]", report.take((), 20.0)["topics"])
    assert told.rate == -1.0


async def test_topics_that_clients_may_not_see_are_not_told() -> None:
    bus = make_bus()
    owner = Owner()
    for name in ("/secret", "/open"):
        bus.advertise(owner, name, "std_msgs/Int32")
    report = TopicReport(bus, Policy(subscribe=Rule(deny=("/secret",)), publish=Rule(deny=("/secret",))))
    told = report.take((), 0.0)
    assert [each.name for each in cast("list[Any]", told["topics"])] == ["/open"]
    assert told["num_topics"] == 1
