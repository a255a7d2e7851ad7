"""A server as a node of ROS 1, with a small master and small nodes: topics, services, parameters, ends."""

from __future__ import annotations

import asyncio
import hashlib
import json
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.errors import DocumentError, GraphError
from rosbridge_sim.graph.gateway.gateway import Gateway
from rosbridge_sim.graph.ros1.tcpros import with_length
from rosbridge_sim.shell.ros1 import node_server, ros1_node, topic_links
from rosbridge_sim.shell.ros1.xmlrpc_http import call
from tests.graph.participants import Somebody
from tests.shell.ros1.small_ros1 import (
    MOST_SERVICES,
    STRING_MD5,
    TRIGGER_MD5,
    SmallMaster,
    SmallNode,
    ask,
    take_message,
    until,
)
from tests.support import PATIENCE, Client

NAME = "/rosbridge_sim"


def text_of(word: str) -> bytes:
    """A std_msgs/String as bytes."""
    return with_length(word.encode())


class Joined(NamedTuple):
    """A server on a graph, a client of it, the master and a node."""

    sim: Simulator
    client: Client
    master: SmallMaster
    node: SmallNode

    async def registered(self, topic: str) -> None:
        await until(lambda: NAME in self.master.publishers(topic))

    @property
    def uri(self) -> str:
        """Address of the server's node."""
        return self.master.nodes[NAME]


@pytest.fixture
async def joined(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[Joined]:
    monkeypatch.setattr(ros1_node, "PERIOD", 0.02)
    monkeypatch.setattr(ros1_node, "MOST_LOOKING", 1.0)
    options: dict[str, Any] = {"world": False, "deny_service": MOST_SERVICES, **getattr(request, "param", {})}
    master = await SmallMaster().start()
    master.parameters = {"robot": {"name": "husky", "wheels": 4}, "use_sim_time": True}
    sim = Simulator(port=0, data_dir=tmp_path, ros1_master=master.uri, **options)
    node = await SmallNode(master, "/planner").start()
    async with sim, await Client.open(sim.url) as client:
        yield Joined(sim, client, master, node)
    node.die()
    master.server.stop()


@pytest.fixture
def lines(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    caplog.set_level(logging.INFO, "rosbridge_sim.ros1")
    return lambda: [record.getMessage() for record in caplog.records if record.name == "rosbridge_sim.ros1"]


# Topics


async def test_messages_of_clients_reach_nodes(joined: Joined) -> None:
    await joined.client.send("advertise", topic="/words", type="std_msgs/String")
    await joined.registered("/words")
    header, (reader, _) = await joined.node.subscribe("/words", md5sum=STRING_MD5, type="std_msgs/String")
    await joined.client.send("publish", topic="/words", msg={"data": "hi"})
    assert await take_message(reader) == text_of("hi")
    assert (header["type"], header["md5sum"], header["latching"]) == ("std_msgs/String", STRING_MD5, "0")
    assert "string data" in header["message_definition"]


async def test_a_mock_is_there_for_nodes(tmp_path: Path) -> None:
    answers = "[{value: {success: true, message: done}}]"
    robot = tmp_path / "robot.yaml"
    robot.write_text(f"""
topics: {{/words: {{type: std_msgs/String, rate: 50, value: {{data: hello}}}}}}
services: {{/reset: {{type: std_srvs/Trigger, answers: {answers}}}}}
""")
    master = await SmallMaster().start()
    node = await SmallNode(master, "/planner").start()
    async with Simulator(port=0, mock=robot, ros1_master=master.uri):
        await until(lambda: master.publishers("/words") and "/reset" in master.services)
        _, (reader, _) = await node.subscribe("/words", md5sum=STRING_MD5, type="std_msgs/String")
        assert await take_message(reader) == text_of("hello")
        _, (reader, writer) = await node.open_service("/reset", md5sum=TRIGGER_MD5)
        writer.write(with_length(b""))
        assert await reader.readexactly(1) == b"\1"
        assert await take_message(reader) == b"\1" + text_of("done")
    node.die()
    master.server.stop()


async def test_late_subscribers_get_latched_messages_once(joined: Joined) -> None:
    await joined.client.send("advertise", topic="/map_name", type="std_msgs/String", latch=True)
    await joined.client.send("publish", topic="/map_name", msg={"data": "old"})
    await joined.client.send("publish", topic="/map_name", msg={"data": "town"})
    await joined.registered("/map_name")
    for _ in range(2):
        header, (reader, _) = await joined.node.subscribe("/map_name")
        assert header["latching"] == "1"
        assert await take_message(reader) == text_of("town")
    await joined.client.send("publish", topic="/map_name", msg={"data": "new"})
    assert await take_message(reader) == text_of("new")


async def test_messages_of_nodes_reach_clients(joined: Joined) -> None:
    joined.node.answer_header = {"type": "std_msgs/String", "md5sum": STRING_MD5}
    await joined.node.register("Publisher", "/plan", "std_msgs/String")
    await joined.client.send("subscribe", topic="/plan", type="std_msgs/String")
    await until(lambda: joined.node.subscribers)
    joined.node.say(text_of("turn left"))
    assert await joined.client.message("/plan") == {"data": "turn left"}
    header = joined.node.headers[-1]
    assert (header["topic"], header["md5sum"], header["tcp_nodelay"]) == ("/plan", STRING_MD5, "1")


async def test_a_type_is_learnt_from_its_publisher(joined: Joined, lines: Callable[[], list[str]]) -> None:
    text = f"robots/Wheel[] wheels\n{'=' * 80}\nMSG: robots/Wheel\nfloat32 speed\nstring name"
    md5 = hashlib.md5(b"float32 speed\nstring name", usedforsecurity=False).hexdigest()
    md5 = hashlib.md5(f"{md5} wheels".encode(), usedforsecurity=False).hexdigest()
    await joined.client.send("subscribe", topic="/state", type="robots/State")  # of a type that is not known yet
    liar = await SmallNode(joined.master, "/liar").start()
    liar.answer_header = {"type": "robots/Lie", "md5sum": "0" * 32, "message_definition": text}
    await liar.register("Publisher", "/lie", "robots/Lie")
    joined.node.answer_header = {"type": "robots/State", "md5sum": md5, "message_definition": text}
    await joined.node.register("Publisher", "/state", "robots/State")
    await until(lambda: joined.node.headers and joined.node.headers[-1]["md5sum"] == md5)
    joined.node.say(bytes([1, 0, 0, 0]) + bytes(4) + text_of("front"))
    assert await joined.client.message("/state") == {"wheels": [{"speed": 0.0, "name": "front"}]}
    assert any("/liar publishes /lie: its type robots/Lie is not known" in line for line in lines()), lines()
    liar.die()


async def test_a_misfit_is_told_once_to_both_sides(joined: Joined, lines: Callable[[], list[str]]) -> None:
    await joined.client.send("advertise", topic="/words", type="std_msgs/String")
    await joined.registered("/words")
    for _ in range(3):
        header, _ = await joined.node.subscribe("/words", md5sum="0" * 32, type="std_msgs/String")
        assert "/planner has std_msgs/String with md5 sum 000" in header["error"]
    assert len([line for line in lines() if "/planner has std_msgs/String with md5 sum 000" in line]) == 1


async def test_a_subscriber_that_never_reads_loses_its_oldest_messages(
    joined: Joined, lines: Callable[[], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(topic_links, "MAX_WAITING_BYTES", 2 * 2**20)
    await joined.client.send("advertise", topic="/words", type="std_msgs/String")
    await joined.registered("/words")
    _, (slow, _) = await joined.node.subscribe("/words")
    quick = await SmallNode(joined.master, "/quick").start()
    _, (reader, _) = await quick.subscribe("/words")
    word = "x" * 2**20
    num = topic_links.MAX_WAITING_BYTES // 2**20 + 12  # more than all buffers hold
    for i in range(num):
        await joined.client.send("publish", topic="/words", msg={"data": f"{i:03d}{word}"})
        assert (await take_message(reader))[4:7] == b"%03d" % i
    assert "node /planner is too slow for /words: its oldest messages are dropped" in lines()
    await joined.client.send("publish", topic="/words", msg={"data": "last"})
    got = [await take_message(slow)]
    while got[-1] != text_of("last"):
        got.append(await take_message(slow))
    assert len(got) < num
    quick.die()


# Services


@pytest.mark.parametrize("persistent", ["0", "1"])
async def test_nodes_call_services_of_clients(joined: Joined, persistent: str) -> None:
    await joined.client.send("advertise_service", service="/reset", type="std_srvs/Trigger")
    await until(lambda: "/reset" in joined.master.services)
    header, stream = await joined.node.open_service("/reset", md5sum=TRIGGER_MD5, persistent=persistent)
    assert (header["type"], header["md5sum"]) == ("std_srvs/Trigger", TRIGGER_MD5)
    for i in range(1 + int(persistent)):
        stream[1].write(with_length(b""))
        frame = await joined.client.take("call_service", service="/reset")
        values = {"success": True, "message": f"done {i}"}
        await joined.client.send("service_response", service="/reset", id=frame["id"], values=values, result=True)
        assert await stream[0].readexactly(1) == b"\1"
        assert await take_message(stream[0]) == b"\1" + text_of(f"done {i}")
    if persistent == "0":
        assert await stream[0].read() == b""
        header, (reader, _) = await joined.node.open_service("/reset", probe="1")
        assert header["response_type"] == "std_srvs/TriggerResponse"
        assert await reader.read() == b""


async def test_a_failed_call_of_a_node_has_the_reason(joined: Joined) -> None:
    _, stream = await joined.node.open_service("/rosapi/delete_param", persistent="1")
    assert await ask(stream, text_of("/nothing")) == (False, b"Parameter /nothing is not set")
    is_ok, why = await ask(stream, b"\1")
    assert (is_ok, b"rosapi/DeleteParamRequest: the bytes are not a message" in why) == (False, True)
    assert await ask(stream, text_of("/robot/wheels")) == (True, b"\1" + text_of(""))


async def test_clients_call_services_of_nodes(joined: Joined) -> None:
    joined.node.answer_header = {"type": "std_srvs/Trigger", "md5sum": TRIGGER_MD5}
    joined.node.handle = lambda _request: (True, b"\1" + text_of("moved"))
    await joined.node.register("Service", "/move", "")
    assert joined.sim.bus is not None
    services = joined.sim.bus.services
    await until(lambda: "/move" in services)
    for i in range(3):
        await joined.client.send("call_service", service="/move", id=str(i))
    for i in range(3):
        answer = await joined.client.take("service_response", id=str(i))
        assert (answer["result"], answer["values"]) == (True, {"success": True, "message": "moved"})
    joined.node.handle = lambda _request: (False, b"the arm is stuck")
    await joined.client.send("call_service", service="/move", id="a")
    answer = await joined.client.take("service_response", id="a")
    assert (answer["result"], answer["values"]) == (False, "the arm is stuck")
    joined.node.die()
    await joined.client.send("call_service", service="/move", id="b")
    answer = await joined.client.take("service_response", id="b")
    assert (answer["result"], "Service /move of ROS 1 was lost" in answer["values"]) == (False, True)
    del joined.master.services["/move"]
    await until(lambda: "/move" not in services)


async def test_a_node_that_says_nothing_is_lost_for_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(topic_links, "HEADER_TIMEOUT", 0.02)
    ends: list[asyncio.StreamWriter] = []
    async with await asyncio.start_server(lambda _reader, writer: ends.append(writer), "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        with pytest.raises(topic_links.LOST) as lost:
            await topic_links.open_stream("localhost", port, {})
        for one in ends:
            one.close()
    assert topic_links.why_lost(lost.value) == "no answer came in time"


# The world


@pytest.mark.parametrize("joined", [{"world": True, "start": "sync"}], indirect=True)
async def test_a_node_is_master_of_synchronous_mode_until_it_dies(joined: Joined) -> None:
    assert joined.sim.node is not None
    await joined.node.register("Publisher", "/rosout", "rosgraph_msgs/Log")  # as each rospy node does
    header, (clock, _) = await joined.node.subscribe("/clock")
    assert header["type"] == "rosgraph_msgs/Clock"
    start = text_of("me") + b"\1" + (20).to_bytes(4, "little")
    _, stream = await joined.node.open_service("/SyncModeCmd")
    assert (await ask(stream, start))[0]
    assert joined.sim.node.sync.is_on
    for i in range(1, 4):  # each call on a connection of its own
        _, stream = await joined.node.open_service("/SyncModeWaitForTick")
        is_ok, _ = await ask(stream, text_of("me") + bytes(8))
        assert is_ok
        assert await take_message(clock) == (0).to_bytes(4, "little") + (20_000_000 * i).to_bytes(4, "little")
    assert joined.sim.node.world.frame == 3
    joined.node.die()
    await until(lambda: not joined.sim.node.sync.is_on)  # type: ignore[union-attr] # see above


@pytest.mark.parametrize("joined", [{"world": True, "start": "sync"}], indirect=True)
async def test_a_node_that_ends_between_two_looks_is_no_master_any_more(
    joined: Joined, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert joined.sim.node is not None
    monkeypatch.setattr(ros1_node, "PERIOD", 0.5)
    num = joined.master.num_looks
    await until(lambda: joined.master.num_looks > num)
    await joined.node.register("Publisher", "/rosout", "rosgraph_msgs/Log")
    _, stream = await joined.node.open_service("/SyncModeCmd")
    assert (await ask(stream, text_of("me") + b"\1" + (20).to_bytes(4, "little")))[0]
    assert joined.sim.node.sync.is_on
    await call(joined.master.uri, "unregisterPublisher", joined.node.name, "/rosout", joined.node.uri)
    del joined.master.nodes[joined.node.name]
    joined.node.die()
    await until(lambda: not joined.sim.node.sync.is_on)  # type: ignore[union-attr] # see above


# Parameters


async def test_parameters_are_those_of_the_master(joined: Joined) -> None:
    assert json.loads((await joined.client.values("/rosapi/get_param", {"name": "/robot"}))["value"]) == {
        "name": "husky",
        "wheels": 4,
    }
    await joined.client.values("/rosapi/set_param", {"name": "/speed", "value": "1.5"})
    await until(lambda: joined.master.parameters.get("speed") == 1.5)
    await joined.client.values("/rosapi/delete_param", {"name": "/speed"})
    await until(lambda: "speed" not in joined.master.parameters)
    await call(joined.uri, "paramUpdate", "/master", "/robot/wheels/", 6)
    await call(joined.uri, "paramUpdate", "/master", "/robot/name/", {})
    assert json.loads((await joined.client.values("/rosapi/get_param", {"name": "/robot"}))["value"]) == {"wheels": 6}
    assert joined.master.parameters["use_sim_time"] is True, "the server never sets it"
    await joined.client.values("/rosapi/set_param", {"name": "/use_sim_time", "value": "false"})
    await until(lambda: joined.master.parameters["use_sim_time"] is False)
    refusal = await joined.client.call("/rosapi/set_param", {"name": "/big", "value": str(2**40)})
    assert "no integer beyond 32 bits" in refusal["values"]


# Ends


async def test_a_restarted_master_gets_everything_anew(joined: Joined, lines: Callable[[], list[str]]) -> None:
    await joined.client.send("advertise", topic="/words", type="std_msgs/String")
    await joined.registered("/words")
    joined.master.forget()
    await joined.registered("/words")
    await until(lambda: "/rosapi/topics" in joined.master.services)
    assert len([line for line in lines() if "registered anew" in line]) == 1


async def test_the_end_of_a_server_leaves_nothing_at_the_master(
    joined: Joined, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros1_node, "LAST_CALL", PATIENCE)  # a busy machine may need more than the user's patience
    monkeypatch.setattr(ros1_node, "GOODBYE", PATIENCE)
    await joined.client.send("advertise", topic="/words", type="std_msgs/String")
    await joined.registered("/words")
    await joined.sim.stop()
    assert not joined.master.services
    assert not any(NAME in nodes for topics in joined.master.kinds.values() for nodes in topics.values())


async def test_a_node_that_connects_anew_during_the_end_gives_no_warning(
    joined: Joined, caplog: pytest.LogCaptureFixture
) -> None:
    """As /rosout of roscore does for each publisher that it loses."""
    caplog.set_level(logging.WARNING)
    await joined.client.send("advertise", topic="/words", type="std_msgs/String")
    await joined.registered("/words")
    _, (reader, _) = await joined.node.subscribe("/words")
    _, host, port = await call(joined.uri, "requestTopic", "/planner", "/words", [["TCPROS"]])
    fields = {"topic": "/words", "type": "*", "md5sum": "*"}
    await joined.client.send("unadvertise", topic="/words")
    assert await reader.read() == b""
    header, _ = await joined.node.connect(host, port, fields)
    assert header == {"error": "'/words' is not published here"}
    end = asyncio.create_task(joined.sim.stop())
    await asyncio.sleep(0)
    with suppress(OSError, asyncio.IncompleteReadError):
        await joined.node.connect(host, port, fields)
    await end
    assert caplog.records == []


async def test_a_stranger_cannot_shut_the_node_down_and_a_namesake_can(
    joined: Joined, lines: Callable[[], list[str]]
) -> None:
    await call(joined.uri, "shutdown", "/rosnode", "user request")
    await until(lambda: any("ignored a request to shut down (/rosnode: user request)" in line for line in lines()))
    uri = joined.uri
    joined.master.nodes[NAME] = joined.node.uri
    await call(uri, "shutdown", "/master", f"[{NAME}] Reason: new node registered with same name")
    await until(lambda: any("so this one leaves the graph; use --ros1-name" in line for line in lines()))
    await joined.client.values("/rosapi/topics", {})  # its own clients are served as before


async def test_rosnode_finds_what_it_asks_for(joined: Joined) -> None:
    await joined.client.send("advertise", topic="/words", type="std_msgs/String")
    await joined.registered("/words")
    await joined.node.subscribe("/words")
    assert (await call(joined.uri, "getPid", "/rosnode")) > 0
    assert ["/words", "std_msgs/String"] in await call(joined.uri, "getPublications", "/rosnode")
    (info,) = await call(joined.uri, "getBusInfo", "/rosnode")
    assert info[1:] == ["/planner", "o", "TCPROS", "/words", True]


async def test_a_name_that_is_taken_is_told_at_the_start(joined: Joined) -> None:
    second = Simulator(port=0, world=False, ros1_master=joined.master.uri)
    with pytest.raises(DocumentError, match=f"ros1-name: the node {NAME} is on the graph of .* use --ros1-name"):
        await second.start()
    other = Simulator(port=0, world=False, ros1_master=joined.master.uri, ros1_namespace="/two", ros1_name="/sim")
    async with other, await Client.open(other.url) as client:
        await client.send("advertise", topic="/words", type="std_msgs/String")
        await until(lambda: "/two/sim" in joined.master.publishers("/two/words"))


async def test_a_server_starts_without_its_master(tmp_path: Path, lines: Callable[[], list[str]]) -> None:
    master = await SmallMaster().start()
    uri = master.uri
    master.server.stop()
    async with Simulator(port=0, world=False, data_dir=tmp_path, ros1_master=uri) as sim:
        assert sim.url
    assert any("the master cannot be used; it is tried again each second" in line for line in lines())


async def test_a_start_does_not_spin_until_the_next_look_is_due(monkeypatch: pytest.MonkeyPatch) -> None:
    turns: list[float] = []
    advance = Gateway.advance

    def count(gateway: Gateway[Any], now: float) -> None:
        turns.append(now)
        advance(gateway, now)

    monkeypatch.setattr(Gateway, "advance", count)
    master = await SmallMaster().start()
    async with Simulator(port=0, world=False, ros1_master=master.uri, deny_service=MOST_SERVICES):
        assert 1 < len(turns) < 20
    master.server.stop()


# Strangers


async def test_malformed_headers_end_their_connection_alone(joined: Joined, lines: Callable[[], list[str]]) -> None:
    _, host, port = await call(joined.uri, "requestTopic", "/x", "/rosout", [["TCPROS"]])
    bad = {
        b"\xff\xff\xff\xff": "at most 262,144 bytes",
        with_length(b"\x09\0\0\0no equals"): "malformed connection header",
        with_length(b"\xff\xff\xff\xff"): "malformed connection header",
        with_length(with_length(b"callerid=a b")): "expected a callerid",
        with_length(with_length(b"callerid=/a") + with_length(b"topic=/nothing")): "is not published here",
        with_length(with_length(b"callerid=/a") + with_length(b"service=/nothing")): "does not exist",
    }
    for data, why in bad.items():
        reader, writer = await asyncio.open_connection(host, port)
        writer.write(data)
        assert why.encode() in await reader.read()
        writer.close()
    for _ in range(3):  # what differs in a number or in a stranger's bytes is told once
        reader, writer = await asyncio.open_connection(host, port)
        writer.write(b"\xfe\xff\xff\xff")
        await reader.read()
        writer.close()
    assert len([line for line in lines() if "a node is refused" in line]) == len(bad) - 1
    await joined.client.values("/rosapi/topics", {})


async def test_connections_that_say_nothing_make_way_for_nodes(joined: Joined, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(node_server.NodeServer, "most", 20)
    await joined.client.send("advertise", topic="/words", type="std_msgs/String")
    await joined.registered("/words")
    host, port = await joined.node.ask_topic("/words")
    silent = [await asyncio.open_connection(host, port) for _ in range(30)]
    _, (reader, _) = await joined.node.subscribe("/words")
    await joined.client.send("publish", topic="/words", msg={"data": "hi"})
    assert await take_message(reader) == text_of("hi")
    for _, writer in silent:
        writer.close()


async def test_nobody_waits_for_nodes_that_say_nothing(joined: Joined) -> None:
    silent: list[asyncio.StreamWriter] = []
    trap = await asyncio.start_server(lambda _reader, writer: silent.append(writer), "127.0.0.1", 0)
    uri = f"//127.0.0.1:{trap.sockets[0].getsockname()[1]}/"
    for i in range(60):
        for kind, rest in (("Publisher", f"mute/T{i}"), ("Service", f"rosrpc:{uri}")):
            joined.master.answer(f"register{kind}", [f"/mute_{i}", f"/mute_{i}", rest, f"http:{uri}"])
    await until(lambda: len(silent) > 20)
    num = joined.master.num_looks
    await joined.client.send("advertise", topic="/words", type="std_msgs/String")
    await joined.registered("/words")
    await until(lambda: joined.master.num_looks > num + 3)
    trap.close()
    for writer in silent:
        writer.close()


async def test_a_stranger_cannot_take_the_publishers_of_a_topic_away(joined: Joined) -> None:
    joined.node.answer_header = {"type": "std_msgs/String", "md5sum": STRING_MD5}
    await joined.node.register("Publisher", "/plan", "std_msgs/String")
    await joined.client.send("subscribe", topic="/plan", type="std_msgs/String")
    await until(lambda: joined.node.subscribers)
    num = joined.master.num_looks
    await call(joined.uri, "publisherUpdate", "/liar", "/plan", [])
    await until(lambda: joined.master.num_looks > num + 2)
    joined.node.say(text_of("turn left"))
    assert await joined.client.message("/plan") == {"data": "turn left"}
    assert len(joined.node.subscribers) == 1


async def test_a_promise_of_many_bytes_takes_no_memory_from_others(
    joined: Joined, monkeypatch: pytest.MonkeyPatch
) -> None:
    streams = [(await joined.node.open_service("/rosapi/get_time", persistent="1"))[1] for _ in range(12)]
    for _, writer in streams:
        writer.write((15 * 2**20).to_bytes(4, "little") + b"x")
    _, stream = await joined.node.open_service("/rosapi/get_param", persistent="1")
    assert (await ask(stream, text_of("/robot/name") + text_of("")))[0]
    monkeypatch.setattr(topic_links, "REST_TIMEOUT", 0.02)
    _, (reader, writer) = await joined.node.open_service("/rosapi/get_time", persistent="1")
    writer.write((15 * 2**20).to_bytes(4, "little") + b"x")
    assert await reader.read() == b"", "its rest does not come"


CLOSED = {
    "deny_publish": ("/secret/*",),
    "deny_subscribe": ("/secret/*",),
    "deny_service": ("/secret/*",),
    "deny_param": ("/robot/name", "/use_sim_time"),
}


@pytest.mark.parametrize("joined", [CLOSED], indirect=True)
async def test_patterns_of_access_hold_for_nodes(joined: Joined) -> None:
    bus = joined.sim.bus
    assert bus is not None
    me = Somebody("/server")  # a part of the server, for which no pattern holds
    bus.advertise(me, "/secret/pose", "std_msgs/String")
    bus.subscribe(me, "/secret/goal", me.deliver, type_name="std_msgs/String")
    bus.provide(me, "/secret/open", "std_srvs/Trigger", me.keep)
    bus.advertise(me, "/open", "std_msgs/String")
    joined.node.answer_header = {"type": "std_srvs/Trigger", "md5sum": TRIGGER_MD5}
    await joined.node.register("Publisher", "/secret/goal", "std_msgs/String")
    await joined.node.register("Service", "/secret/move", "")
    await joined.node.register("Service", "/move", "")
    await joined.registered("/open")
    await until(lambda: "/move" in bus.services)
    assert not joined.master.publishers("/secret/pose")
    assert NAME not in joined.master.kinds["Subscriber"].get("/secret/goal", {})
    assert not {"/secret/move"} & bus.services.keys()
    assert "/secret/open" not in joined.master.services
    with pytest.raises(GraphError, match="not published here"):
        await call(joined.uri, "requestTopic", "/x", "/secret/pose", [["TCPROS"]])
    _, stream = await joined.node.open_service("/rosapi/get_param", persistent="1")
    assert (await ask(stream, text_of("/robot/name") + text_of("")))[0] is False
    refusal = await joined.client.call("/rosapi/set_param", {"name": "/use_sim_time", "value": "false"})
    assert (refusal["result"], joined.master.parameters["use_sim_time"]) == (False, True)
