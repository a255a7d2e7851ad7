"""A car, its mirror and a far side of our own kind in memory, for the tests of this room."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.attach.connection import BridgeConnection
from rosbridge_sim.graph.attach.mirror import Mirror
from rosbridge_sim.graph.attach.mirror_registry import MirrorChoices
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.topics_services import Call, Topic
from rosbridge_sim.protocol.outbox import Outbox
from rosbridge_sim.schema.message import Message
from tests.graph.bus_fixture import make_bus, make_peer, make_store

__all__ = ["Car", "FarBridge", "Frame", "Program", "SimHarness", "make_deaf"]

Frame = dict[str, Any]


class Car(Participant):
    """A node as the simulator is one: a topic, a latched topic, an input and a service; a camera with `add_camera`."""

    name = "/car"

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.heard: list[object] = []
        self.callers: list[Participant] = []
        self.refusal = ""
        self.on_call: Callable[[Call], None] = lambda _call: None
        self.state = bus.advertise(self, "/state", "std_msgs/Int32", is_exclusive=True, is_on_demand=True)
        self.plate = bus.advertise(self, "/plate", "std_msgs/String", depth=1, is_exclusive=True)
        bus.subscribe(self, "/pedal", self._hear, type_name="std_msgs/Float64")
        bus.provide(self, "/honk", "std_srvs/SetBool", self._honk, is_exclusive=True)
        self.show("/plate", data="12 GA 3456")

    def notify(self, level: str, text: str) -> None:
        """Nothing is said to it."""

    def add_camera(self, name: str) -> Topic:
        return self.bus.advertise(self, name, "sensor_msgs/CompressedImage", is_exclusive=True, is_on_demand=True)

    def show(self, name: str, **fields: object) -> None:
        topic = self.bus.topics[name]
        self.bus.publish(self, topic, Message(topic.type, topic.type.check(fields, 0)), 0.0)

    def _hear(self, _topic: Topic, message: Message, sender: Participant, _now: float) -> None:
        if message.value.data < 0:
            sender.notify("warning", "the pedal goes down only")
            raise GraphError("a pedal is not negative")
        self.heard.append(message.value.data)

    def _honk(self, call: Call, _now: float) -> None:
        self.callers.append(call.caller)
        self.on_call(call)
        if self.refusal:
            raise GraphError(self.refusal)
        request: Any = call.request
        self.show("/state", data=len(self.callers))
        call.answer(call.service.type.response.struct_type(request.data, "beep"))


class FarBridge:
    """The far side of one mirror: a gateway of our own kind, with a client for each of the mirror's connections.

    Attributes:
        bus: what there is on the far side.
        frames: all that the mirror has sent, oldest first; and `frames_of` those of each connection by its name.
        mute: services that are never answered.
    """

    def __init__(self, *, has_rosapi: bool = True) -> None:
        self.bus = make_bus()
        if has_rosapi:
            Rosapi(self.bus)
        self.frames: list[Frame] = []
        self.frames_of: dict[str, list[Frame]] = {}
        self.mute: set[str] = set()
        self._wires: dict[BridgeConnection, tuple[Peer, Outbox]] = {}

    def connect(self, mirror: Mirror, connection: BridgeConnection, now: float = 0.0) -> None:
        self._wires[connection] = make_peer(self.bus)
        mirror.connected(connection, lambda: None, lambda: None, now)

    def cut(self, mirror: Mirror, connection: BridgeConnection, now: float = 0.0) -> None:
        peer, _ = self._wires.pop(connection)
        peer.leave(now)
        mirror.lost(connection, now)

    def pump(self, mirror: Mirror, now: float = 0.0) -> None:
        """Carry frames both ways until neither side has any."""
        is_moving = True
        while is_moving:
            is_moving = False
            for connection, (peer, outbox) in list(self._wires.items()):
                for frame in connection.take(8_192, now):
                    is_moving = True
                    self.frames_of.setdefault(connection.name, []).append(json.loads(frame))
                    self._receive(peer, frame, now)
                for frame in outbox.take(2**30):
                    is_moving = True
                    mirror.receive(connection, frame, now)

    def _receive(self, peer: Peer, frame: bytes, now: float) -> None:
        op = json.loads(frame)
        self.frames.append(op)
        if op.get("service") not in self.mute or op["op"] != "call_service":
            peer.receive(frame, now)

    def ops(self, name: str) -> list[Frame]:
        return [frame for frame in self.frames if frame["op"] == name]


class Program:
    """A program on the far side, by rosbridge too."""

    def __init__(self, far: FarBridge) -> None:
        self._peer, self._outbox = make_peer(far.bus)

    def send(self, op: str, **fields: object) -> None:
        self._peer.receive(json.dumps({"op": op, **fields}).encode(), 0.0)

    def received(self, op: str | None = None) -> list[Frame]:
        frames = [json.loads(frame) for frame in self._outbox.take(2**30)]
        return [frame for frame in frames if op in (None, frame["op"])]


class SimHarness:
    """A car, its mirror and the far side.

    Attributes:
        noted: mistakes of programs there.
        is_synchronous: with cameras: only calls move the world. The first camera's name is the chosen one, and the
            others are second names.
    """

    def __init__(
        self,
        *,
        has_connection_each: bool = False,
        has_rosapi: bool = True,
        is_ros_2: bool = False,
        cameras: Sequence[str] = (),
    ) -> None:
        self.bus = Bus(make_store(2)) if is_ros_2 else make_bus()
        self.noted: list[RefusedRequest] = []
        self.bus.on_refusal = self.noted.append
        self.car = Car(self.bus)
        self.far = FarBridge(has_rosapi=has_rosapi)
        self.num_attached = 0
        for name in cameras:
            self.car.add_camera(name)
        self.is_synchronous = False
        self.mirror = Mirror(
            self.bus,
            self.car,
            "ws://far:9090",
            MirrorChoices(has_connection_each=has_connection_each, second_names=lambda: cameras[1:]),
        )
        self.mirror.is_synchronous = lambda: self.is_synchronous or not cameras
        self.mirror.on_attached = self._count

    def _count(self) -> None:
        self.num_attached += 1

    @property
    def connection(self) -> BridgeConnection:
        return self.mirror.connections[""]

    def attach(self, now: float = 0.0) -> None:
        for connection in self.mirror.connections.values():
            self.far.connect(self.mirror, connection, now)
        self.pump(now)

    def pump(self, now: float = 0.0) -> None:
        self.far.pump(self.mirror, now)

    def cut(self, now: float = 0.0) -> None:
        for connection in self.mirror.connections.values():
            self.far.cut(self.mirror, connection, now)

    def flood(self, num_messages: int = 5_000) -> None:
        """Publish more than a far side handles that stands still, carrying whenever it may be."""
        for i in range(num_messages):
            self.car.show("/state", data=i)
            if i % 50 == 49:
                self.pump()

    def run(self, until: float) -> None:
        """Let time pass for the mirror."""
        now = 0.0
        while True:
            due = self.mirror.next_due(now)
            if due is None or due > until:
                return
            now = max(now, due)
            self.mirror.advance(now)
            self.pump(now)

    def receive(self, frame: Frame | bytes, now: float = 0.0) -> None:
        data = frame if isinstance(frame, bytes) else json.dumps(frame).encode()
        self.mirror.receive(self.connection, data, now)


def make_deaf(harness: SimHarness, *names: str) -> None:
    """Have the far side pass over advertisements, as rosbridge_suite does of types that it does not know."""
    receive = harness.far._receive

    def pass_over(peer: Peer, frame: bytes, now: float) -> None:
        op = json.loads(frame)
        if op["op"] in {"advertise", "advertise_service"} and (op.get("topic") or op.get("service")) in names:
            return
        receive(peer, frame, now)

    harness.far._receive = pass_over  # type: ignore[method-assign]
