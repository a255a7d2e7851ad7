"""Each alias that MORAI's documents or another release use, over the wire, in both releases.

A row says what a client sends, in its documented and in its plain spelling, and what is seen of it. The first must do
what the second does, without a word; and a wrong spelling of the same must do nothing, and be told.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.scenarios.scenario_reader import read_scenario
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.world.state.world import World
from tests.simulator.sim_harness import make_store
from tests.simulator.small_maps import ROADRUNNER, read

RELEASES = ("22.R2", "26.R1")

Frame = dict[str, Any]

SCENE: Frame = {
    "mapInfo": {"mapName": "tiny"},
    "egoVehicle": {"initPosition": {"pos": {"x": 10, "y": 0}}, "gear": 4},
}
THINGS: Frame = {**SCENE, "objectList": [{"pos": {"x": i, "y": 50}} for i in range(3)]}


@cache
def crossing_map() -> RoadMap:
    return read(ROADRUNNER)


class CrossingLibrary:
    """The hand-written crossing, empty and with three things beside it."""

    def scenario(self, name: str) -> Scenario:
        if name not in {"scene", "things"}:
            raise DocumentError(f"no scenario {name!r}")
        return read_scenario(json.dumps(THINGS if name == "things" else SCENE).encode(), f"{name}.json")

    def map(self, name: str) -> RoadMap:
        assert name == "tiny"
        return crossing_map()


class Client:
    """JSON ops in, JSON frames out."""

    def __init__(self, bus: Bus) -> None:
        self._outbox = Outbox(OutboxLimits(), lambda: None, lambda: None)
        self._peer = Peer(bus, Session(self._outbox, lambda _due: None))
        self._num = 0
        self._frames: list[Frame] = []

    def send(self, op: str, **fields: object) -> None:
        self._peer.receive(json.dumps({"op": op, **fields}).encode(), 0.0)

    def publish(self, topic: str, type_name: str, **msg: object) -> None:
        self.send("advertise", topic=topic, type=type_name)
        self.send("publish", topic=topic, msg=msg)

    def call(self, service: str, **request: object) -> Any:  # noqa: ANN401 - an answer's values
        self._num += 1
        self.send("call_service", id=f"call:{self._num}", service=service, args={"request": request})
        (frame,) = self.frames("service_response")
        return frame["values"]["response"] if frame["result"] else frame["values"]

    def frames(self, op: str) -> list[Frame]:
        """The frames of one op that came since they were last asked for."""
        self._frames += [json.loads(frame) for frame in self._outbox.take(2**40)]
        found = [frame for frame in self._frames if frame["op"] == op]
        self._frames = [frame for frame in self._frames if frame["op"] != op]
        return found

    def complaints(self) -> str:
        """All that it was told, and the reasons of refusals."""
        return "\n".join(str(frame["msg"]) for frame in self.frames("status"))


class Wire(Client):
    """A simulator that stands at frame 0, and a client of it."""

    def __init__(self, release: str) -> None:
        self.bus = Bus(make_store(release))
        shelf = CrossingLibrary()
        make_node(self.bus, World(seed=0), shelf, shelf.scenario("scene"), NodeSettings(start="sync"))
        super().__init__(self.bus)
        self.told: list[str] = []
        self.listener = Client(self.bus)

    def notify(self, type_name: str, **msg: object) -> None:
        """Publish on a topic of one's own, to which somebody listens."""
        self.send("advertise", topic="/own", type=type_name)
        self.listener.send("subscribe", topic="/own")
        self.send("publish", topic="/own", msg=msg)

    def ask(self, service: str, **request: object) -> Any:  # noqa: ANN401 - an answer's values
        """Call; a refusal is something that one is told."""
        answer = self.call(service, **request)
        if isinstance(answer, str):
            self.told.append(answer)
        return answer

    def drive(self, seconds: float) -> Frame:
        """Become master, let time pass, and return the ego's state."""
        self.call("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        for _ in range(round(seconds * 50)):
            answer: Frame = self.call("/SyncModeWaitForTick", user_id="me", frame=0)
        status: Frame = answer["vehicle_status"]
        return status

    def hear(self, topic: str) -> Frame | None:
        """The message of a topic after a frame more."""
        self.send("subscribe", topic=topic)
        self.drive(0.02)
        found = [frame["msg"] for frame in self.frames("publish") if frame["topic"] == topic]
        return found[-1] if found else None


# What is sent and what is seen; `spelling` is what the row is about.


def control(wire: Wire, spelling: str) -> None:
    """A command by its name for the mode, in synchronous mode."""
    wire.call("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
    wire.ask("/SyncModeCtrlCmd", frame=1, command={spelling: 2, "velocity": 36.0})


def steer(wire: Wire, spelling: str) -> None:
    wire.call("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
    wire.ask("/SyncModeCtrlCmd", frame=1, command={"longlCmdType": 2, "velocity": 36.0, spelling: 0.25})


def control_by_type(wire: Wire, spelling: str) -> None:
    wire.notify(spelling, longlCmdType=2, velocity=36.0)


def lamps(wire: Wire, spelling: str) -> None:
    wire.publish("/lamps", "morai_msgs/Lamps", **{spelling: 1})


def lamps_by_topic(wire: Wire, spelling: str) -> None:
    wire.publish(spelling, "morai_msgs/Lamps", turnSignal=1)


def load(wire: Wire, spelling: str) -> None:
    wire.ask("/Service_MoraiSL", file_name="things", **{spelling: True})


def load_at_frame(wire: Wire, spelling: str) -> None:
    wire.call("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
    wire.ask("/SyncModeScenarioLoad", file_name="things", frame=1, **{spelling: True})


def load_without_network(wire: Wire, spelling: str) -> None:
    wire.ask("/Service_MoraiSL", file_name="things", load_obstacle_data=True, **{spelling: False})


def load_without_network_at_frame(wire: Wire, spelling: str) -> None:
    wire.call("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
    wire.ask("/SyncModeScenarioLoad", file_name="things", frame=1, load_obstacle_data=True, **{spelling: False})


def offer(wire: Wire, spelling: str) -> None:
    """Offer a service of that type; who calls it may use the documented names too."""
    wire.send("advertise_service", service="/mine", type=spelling)
    request = {"file_name": "x", "load_object_data": True}
    Client(wire.bus).send("call_service", service="/mine", args={"request": request})


def crossing(wire: Wire, spelling: object) -> None:
    wire.publish("/InsnControl", "morai_msgs/IntersectionControl", intersection_index=spelling, intersection_status=1)


def light(wire: Wire, spelling: str) -> None:
    wire.publish("/SetTrafficLight", "morai_msgs/SetTrafficLight", **{spelling: "C1", "trafficLightStatus": 4})


def sensor(wire: Wire, spelling: Callable[[Any], Any]) -> None:
    """The first sensor, as scalars or as lists of one."""
    pose = {"sensor_index": 0, "pose_x": 1.5, "pose_y": 0.5, "pose_z": 2.0, "roll": 0.0, "pitch": 0.0, "yaw": 0.0}
    fields = {name: spelling(value) for name, value in pose.items()}
    wire.publish("/SensorPosControl", "morai_msgs/SensorPosControl", **fields)


def objects(wire: Wire, spelling: object) -> None:
    wire.notify("morai_msgs/ObjectStatusList", num_of_npcs=1, npc_list=spelling)


def replay(wire: Wire, spelling: object) -> None:
    wire.notify("morai_msgs/ReplayInfo", obstacle_list=spelling)


def start(wire: Wire, spelling: str) -> None:
    wire.ask(spelling, user_id="me", start_sync_mode=True, time_step=40)


def gear_at(wire: Wire, spelling: object) -> None:
    wire.call("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
    wire.ask("/SyncModeSetGear", frame=spelling, gear=2)


def gear(wire: Wire, spelling: int) -> None:
    wire.ask("/Service_MoraiEventCmd", option=spelling, gear=2)


def ego_speed(wire: Wire) -> object:
    return round(wire.drive(0.1)["velocity"]["x"], 6)


def ego_heading(wire: Wire) -> object:
    return round(wire.drive(0.2)["heading"], 6)


def ego_gear(wire: Wire) -> object:
    wire.drive(0.06)
    return wire.call("/Service_MoraiEventCmd", option=0)["gear"]


def turn_signal(wire: Wire) -> object:
    return wire.call("/Service_MoraiEventCmd", option=0)["lamps"]["turnSignal"]


def num_things(wire: Wire) -> object:
    heard = wire.hear("/Object_topic")
    return heard and heard["num_of_obstacle"]


def phase(wire: Wire) -> object:
    heard = wire.hear("/IntscnTL_topic")
    return heard and heard["state"]


def shown(wire: Wire) -> object:
    return wire.call("/Morai_TLSrv", idx="C1")["status"]


def mounting(wire: Wire) -> object:
    wire.send("subscribe", topic="/tf_static")
    (frame,) = wire.frames("publish")
    return [entry["transform"] for entry in frame["msg"]["transforms"] if entry["child_frame_id"] == "gps_link"]


def own_message(wire: Wire) -> object:
    return [frame["msg"] for frame in wire.listener.frames("publish")]


def request_passed_on(wire: Wire) -> object:
    return [frame["args"]["request"]["load_obstacle_data"] for frame in wire.frames("call_service")]


def time_step(wire: Wire) -> object:
    return wire.call("/SyncModeCmd", user_id="other", start_sync_mode=True, time_step=20)["time_step"]


@dataclass(frozen=True)
class Row:
    """One alias.

    Attributes:
        what: of which message or call.
        documented, plain: two spellings of one thing.
        wrong: a third, which means nothing.
        why: what is said about it.
        act, seen: what is done with a spelling, and what comes of it.
    """

    what: str
    documented: Any
    plain: Any
    wrong: Any
    why: str
    act: Callable[[Wire, Any], None]
    seen: Callable[[Wire], object]


NPC: Frame = {"unique_id": 7, "name": "2015_Kia_K5"}

NAMES = [
    Row("CtrlCmd", "longCmdType", "longlCmdType", "longCmdTyp", "longCmdTyp", control, ego_speed),
    Row("CtrlCmd", "longl_cmd_type", "longlCmdType", "longl_cmdtype", "longl_cmdtype", control, ego_speed),
    Row("CtrlCmd", "long_cmd_type", "longlCmdType", "long_command_type", "long_command_type", control, ego_speed),
    Row("CtrlCmd", "front_steer", "steering", "steer", "steer", steer, ego_heading),
    Row("Lamps", "turn_signal", "turnSignal", "turn", "turn", lamps, turn_signal),
    Row("SetTrafficLight", "traffic_light_index", "trafficLightIndex", "index", "index", light, shown),
    Row("ScenarioLoad", "load_object_data", "load_obstacle_data", "load_objects", "load_objects", load, num_things),
    Row(
        *("SyncModeScenarioLoad", "load_object_data", "load_obstacle_data", "load_objects", "load_objects"),
        *(load_at_frame, num_things),
    ),
    Row(
        *("ScenarioLoad", "load_network_connection", "load_network_connection_data", "load_network", "load_network"),
        *(load_without_network, num_things),
    ),
    Row(
        *("SyncModeScenarioLoad", "load_network_connection", "load_network_connection_data", "load_net", "load_net"),
        *(load_without_network_at_frame, num_things),
    ),
]

TYPES = [
    Row(
        *("topic's type", spelling, "morai_msgs/CtrlCmd", "morai_msgs/CtrlCmmd", "CtrlCmmd"),
        *(control_by_type, own_message),
    )
    for spelling in ("morai_msg/CtrlCmd", "morai_msgs/msg/CtrlCmd", "morai_msg/msg/CtrlCmd")
] + [
    Row(
        *("service's type", spelling, "morai_msgs/MoraiSyncModeSLSrv", "morai_msgs/SyncModeScnSrv", "SyncModeScnSrv"),
        *(offer, request_passed_on),
    )
    for spelling in (
        *("morai_msgs/SyncModeSLSrv", "morai_msg/SyncModeSLSrv", "morai_msgs/srv/SyncModeSLSrv"),
        *("morai_msg/MoraiSyncModeSLSrv", "morai_msg/srv/MoraiSyncModeSLSrv"),
    )
]

SHAPES = [
    *(
        Row("IntersectionControl", number, 13, "north", "intersection_index", crossing, phase)
        for number in ("13", "IntTL13", 13.0)
    ),
    Row("SensorPosControl", lambda x: x, lambda x: [x], lambda x: {"x": x}, "sensor_index", sensor, mounting),
    Row("ObjectStatusList", NPC, [NPC], "a car", "npc_list", objects, own_message),
    Row("ReplayInfo", NPC, [NPC], 7, "obstacle_list", replay, own_message),
    Row("SyncModeSetGear.frame", 1.0, 1, 1.5, "frame", gear_at, ego_gear),
    Row("SyncModeSetGear.frame", 1.0, 1, "soon", "frame", gear_at, ego_gear),
]

PLACES = [
    Row("topic without a slash", "lamps", "/lamps", "ctrl_cmd", "ctrl_cmd", lamps_by_topic, turn_signal),
    Row("service without a slash", "SyncModeCmd", "/SyncModeCmd", "SyncModeComd", "SyncModeComd", start, time_step),
    Row("EventInfo.option", 16, 2, "gear", "option", gear, ego_gear),
]

ROWS = [*NAMES, *TYPES, *SHAPES, *PLACES]


def name_of(spelling: object) -> str:
    """A test's id is the same in each process that collects it; a function's text is not."""
    return "computed" if callable(spelling) else str(spelling)


def outcome(row: Row, release: str, act: Callable[[Wire, Any], None], spelling: object) -> tuple[object, str]:
    """What is seen after a spelling, and what was said about it."""
    wire = Wire(release)
    act(wire, spelling)
    said = "\n".join([wire.complaints(), *wire.told]).strip()
    return row.seen(wire), said


@cache
def untouched(seen: Callable[[Wire], object], release: str) -> object:
    """What is seen if nothing is sent."""
    return seen(Wire(release))


PLAIN: dict[object, tuple[object, str]] = {}
"""What the plain spelling does, for all rows that have the same one."""


def plain_outcome(row: Row, release: str) -> tuple[object, str]:
    key = release, row.act, row.seen, name_of(row.plain)
    if key not in PLAIN:
        PLAIN[key] = outcome(row, release, row.act, row.plain)
    return PLAIN[key]


@pytest.mark.parametrize("release", RELEASES)
@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.what}-{name_of(row.documented)}")
def test_documented_spelling_has_the_effect_of_the_wire_name(row: Row, release: str) -> None:
    before = untouched(row.seen, release)
    plain, said = plain_outcome(row, release)
    assert said == ""
    assert plain != before, "something comes of it"
    assert outcome(row, release, row.act, row.documented) == (plain, "")


@pytest.mark.parametrize("release", RELEASES)
@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.what}-{name_of(row.wrong)}")
def test_wrong_spelling_is_reported_and_does_nothing(row: Row, release: str) -> None:
    before = untouched(row.seen, release)
    after, said = outcome(row, release, row.act, row.wrong)
    assert row.why in said
    assert after == before
