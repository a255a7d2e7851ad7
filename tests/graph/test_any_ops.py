"""Any ops of three clients: every call and goal ends once, every frame is complete, and nothing is left over."""

from __future__ import annotations

import json
import math
from collections import Counter
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.doctor.check_frames import read_frame
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.topic_table import TYPE_MEMORY
from rosbridge_sim.protocol.outbox import BinaryFrame, Outbox
from tests.graph.bus_fixture import make_bus, make_peer

names = st.sampled_from(["/a", "a", "/b"])
ids = st.sampled_from([None, "1", 2])
topic_types = st.sampled_from(["std_msgs/String", "std_msgs/msg/String", "std_msgs/Int32", "my_msgs/Thing", "bad"])
compressions = st.sampled_from(["none", "cbor", "cbor-raw", "png"])


def op(name: str, **fields: st.SearchStrategy[Any]) -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries({"op": st.just(name), **fields})


ADD, FIB = st.just("rospy_tutorials/AddTwoInts"), st.just("example_interfaces/Fibonacci")
acts = st.one_of(
    op("advertise", topic=names, type=topic_types, id=ids, latch=st.booleans()),
    op("unadvertise", topic=names, id=ids),
    op("publish", topic=names, msg=st.sampled_from([{}, {"data": "x"}, {"data": 1}, {"y": [None]}]), id=ids),
    op(
        "subscribe",
        topic=names,
        id=ids,
        type=st.none() | topic_types,
        compression=compressions,
        throttle_rate=st.sampled_from([0, 1000]),
        queue_length=st.sampled_from([0, 2]),
        fragment_size=st.sampled_from([None, 20]),
    ),
    op("unsubscribe", topic=names, id=ids),
    op("advertise_service", service=names, type=ADD),
    op("unadvertise_service", service=names),
    op("call_service", service=names, args=st.sampled_from([{}, [1, 2], {"z": 1}]), timeout=st.sampled_from([None, 1])),
    op("advertise_action", action=names, type=FIB),
    op("unadvertise_action", action=names),
    op("send_action_goal", action=names, action_type=FIB, args=st.just({"order": 2}), feedback=st.booleans(), id=ids),
    op("cancel_action_goal", action=names, id=st.sampled_from(["1", "2"])),
    st.just({"op": "answer"}),
    st.just({"op": "fail"}),
    st.just({"op": "wait"}),
    st.just({"op": "leave"}),
)


class FuzzedBus:
    """Three clients on a bus, and what each has been asked and told."""

    def __init__(self) -> None:
        self.bus: Bus = make_bus()
        Rosapi(self.bus)
        self.clients: list[tuple[Peer, Outbox]] = [make_peer(self.bus) for _ in range(3)]
        self.asked: list[list[dict[str, Any]]] = [[], [], []]
        self.sent: list[Counter[str]] = [Counter() for _ in range(3)]
        self.got: list[Counter[str]] = [Counter() for _ in range(3)]
        self.now = 0.0
        self.bus.agenda.first = math.inf

    def send(self, who: int, frame: dict[str, Any]) -> None:
        self.clients[who][0].receive(json.dumps(frame).encode(), self.now)

    def act(self, who: int, act: dict[str, Any]) -> None:
        match act["op"]:
            case "answer" | "fail":
                self.answer(who, is_ok=act["op"] == "answer")
            case "wait":
                self.now += 2.0
                self.bus.expire(self.now)
                for peer, _ in self.clients:
                    peer.flush(self.now)
            case "leave":
                self.clients[who][0].leave(self.now)
                self.clients[who] = make_peer(self.bus)
                self.asked[who].clear()
                self.sent[who].clear()
                self.got[who].clear()
            case name:
                self.sent[who][name] += 1
                self.send(who, act)
        self.hear()

    def answer(self, who: int, *, is_ok: bool) -> None:
        """Answer the oldest thing that one was asked."""
        if not self.asked[who]:
            return
        frame = self.asked[who].pop(0)
        if frame["op"] == "call_service":
            reply = {"op": "service_response", "service": frame["service"], "values": {"sum": 1}}
        else:
            reply = {"op": "action_result", "action": frame["action"], "values": {"sequence": [1]}, "status": 4}
        self.send(who, {**reply, "id": frame["id"], "result": is_ok})

    def hear(self) -> None:
        for who, (_, outbox) in enumerate(self.clients):
            for frame in outbox.take(2**40):
                said = read_frame(frame if isinstance(frame, BinaryFrame) else frame.decode())
                if said.get("op") in {"call_service", "send_action_goal"}:
                    self.asked[who].append(said)
                self.got[who][said.get("op", "binary")] += 1


@given(st.lists(st.tuples(st.integers(0, 2), acts), max_size=40))
def test_any_ops_of_three_clients_leave_the_bus_consistent(acts: list[tuple[int, dict[str, Any]]]) -> None:
    room = FuzzedBus()
    for who, act in acts:
        room.act(who, act)
        due = room.bus.next_deadline()
        assert due is None or room.bus.agenda.first <= due, "the scheduler would not know"
        for sent, got in zip(room.sent, room.got, strict=True):
            assert got["service_response"] <= sent["call_service"]
            assert got["action_result"] <= sent["send_action_goal"]
    # whoever provides leaves first: then all who wait have their answers, each exactly one
    for service in list(room.bus.services.values()):
        if service.owner.name != "/rosapi":
            room.bus.withdraw(service.owner, service.name)
    for action in list(room.bus.actions.by_name.values()):
        room.bus.actions.withdraw(action.owner, action.name)
    room.hear()
    for sent, got in zip(room.sent, room.got, strict=True):
        assert got["service_response"] == sent["call_service"]
        assert got["action_result"] == sent["send_action_goal"]
    for peer, _ in room.clients:
        peer.leave(room.now)
    room.bus.expire(room.now + TYPE_MEMORY)
    assert [owner.name for owner in room.bus.owners()] == ["/rosapi"]
    assert room.bus.topics == {}
    assert all(name.startswith("/rosapi/") for name in room.bus.services)
    assert room.bus.actions.by_name == {}
