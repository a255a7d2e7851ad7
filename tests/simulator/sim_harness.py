"""Test harness: the simulator on a bus without sockets, with simple clients and a time that tests set."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, TypeVar

import orjson

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import OfferKind, Participant
from rosbridge_sim.graph.topics_services import Answer, Topic
from rosbridge_sim.maps.road_map import Projection, RoadMap
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.scenarios.scenario_reader import read_scenario
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.simulator.bus.network_settings import InterfaceKind, NetworkSettings, read_choices
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.plain.reading import Reader
from rosbridge_sim.simulator.replays.recording_builder import Recordings
from rosbridge_sim.simulator.sensors.drawing import SensorWorker
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import Dynamics, World
from tests.simulator.small_maps import tiny

__all__ = [
    "ALL",
    "SCENARIOS",
    "Client",
    "ManualReader",
    "MemoryDataStore",
    "MemoryLibrary",
    "MemoryNetworks",
    "SimHarness",
    "make_store",
    "network_settings",
    "put_egos",
    "rates",
]

STRAIGHT = [{"pos": {"x": 0, "y": 0, "z": 0}}, {"pos": {"x": -50, "y": 0, "z": 0}}]

SCENARIOS: dict[str, dict[str, Any]] = {
    "crowd": {
        "mapInfo": {"mapName": "track"},
        "egoVehicle": {"initPosition": {"pos": {"x": 10, "y": 20}, "rot": {"yaw": 90}}, "gear": 4},
        "vehicleList": [
            {"UNIQUEID": 7, "initPosition": {"pos": {"x": 30, "y": 0}}, "velocityType": 2, "constantVelocity": 36},
            {"initPosition": {"pos": {"x": 60, "y": 0}}},
        ],
        "pedestrianList": [{"UNIQUEID": 9, "pos": {"x": 0, "y": 5}, "speed": 3.6, "pathName": "walk", "loop": True}],
        "objectList": [{"UNIQUEID": 3, "pos": {"x": 5, "y": 5}}, {"UNIQUEID": 4, "pos": {"x": 15, "y": 25}}],
        "waypointDataList": [{"pathName": "walk", "waypointData": STRAIGHT}],
    },
    "parked": {"egoVehicle": {"initPosition": {"pos": {"x": -5, "y": 0}}, "gear": 1}},
    "elsewhere": {
        "mapInfo": {"mapName": "hills"},
        "egoVehicle": {"initPosition": {"initPositionMode": "Link", "initLink": "up", "initLinkRatio": 0.5}},
    },
    "crossing": {
        "mapInfo": {"mapName": "tiny"},
        "egoVehicle": {"initPosition": {"pos": {"x": 50, "y": 3.5}}, "gear": 4},
        "vehicleList": [
            {"initPosition": {"initPositionMode": "Link", "initLink": "A1B1"}, "isWaypointMode": False},
            {"initPosition": {"pos": {"x": 30, "y": 3.5}}, "constantVelocity": 36},
        ],
    },
    "nowhere": {
        "mapInfo": {"mapName": "R_KR_PG_K-City"},
        "egoVehicle": {"initPosition": {"pos": {"x": 1, "y": 2}}},
    },
    "lost": {"egoVehicle": {"initPosition": {"initPositionMode": "Link", "initLink": "no such link"}}},
    "empty": {"objectList": []},
}

ALL = {
    "delete_all": True,
    "load_ego_vehicle_data": True,
    "load_surrounding_vehicle_data": True,
    "load_pedestrian_data": True,
    "load_obstacle_data": True,
}


@cache
def make_store(release: str = "22.R2", ros: Generation = 1) -> Store:
    """All types, with the other names and shapes that MORAI's documents use."""
    return Store(read_definitions(release), leniency=LENIENCY, ros=ros)


def _roads(name: str) -> Roads:
    import numpy as np  # noqa: PLC0415 - for this alone

    line = np.array([[0.0, 0.0, 0.0], [0.0, 100.0, 10.0]])
    return Roads(["up"], [line], [[]], [3.5], [10.0]) if name == "hills" else Roads()


# A scenario and a map never change, and neither does what is computed of its roads.
_scenario = cache(read_scenario)


@cache
def _map(name: str) -> RoadMap:
    if name == "track":
        return RoadMap(name, Projection(is_tm=False, zone=52), (300.0, 400.0, 5.0), _roads(name))
    if name == "tiny":
        return tiny()
    if name == "hills":
        projection = Projection(is_tm=True, central_latitude=38.0, central_meridian=127.0, false_easting=200_000.0)
        return RoadMap(name, projection, (0.0, 0.0, 0.0), _roads(name))
    raise DocumentError(f"no map {name!r}")


class MemoryLibrary:
    """A library in memory."""

    def __init__(self) -> None:
        self.num_maps_read = 0

    def scenario(self, name: str) -> Scenario:
        if name == "torn":
            return read_scenario(b'{"egoVehicle": ', "torn.json")
        if name not in SCENARIOS:
            raise DocumentError(f"no scenario {name!r}")
        return _scenario(json.dumps(SCENARIOS[name]).encode(), f"{name}.json")

    def map(self, name: str) -> RoadMap:
        self.num_maps_read += 1
        return _map(name)


T = TypeVar("T")


class ManualReader:
    """A reader whose outcomes are handed over when a test says so.

    Attributes:
        waiting: functions of `now` that hand over what was asked for, in the order in which it was asked for.
    """

    def __init__(self) -> None:
        self.waiting: list[Callable[[float], None]] = []

    def read(self, work: Callable[[], T], then: Callable[[T | DocumentError, float], None], now: float) -> None:
        del now
        outcome: T | DocumentError
        try:
            outcome = work()
        except DocumentError as error:
            outcome = error
        self.waiting.append(lambda now: then(outcome, now))

    def hand_over(self, i: int = 0, *, now: float = 0.0) -> None:
        """Hand over one of those that wait."""
        self.waiting.pop(i)(now)


def put_egos(*indices: int) -> dict[str, Any]:
    """The fields of a MultiEgoSetting that puts these."""
    n = len(indices)
    return {
        "number_of_ego_vehicle": n,
        "ego_index": list(indices),
        **{f"global_position_{axis}": [30.0 * i for i in range(n)] for axis in "xyz"},
        "global_roll": [0.0] * n,
        "global_pitch": [0.0] * n,
        "global_yaw": [0.0] * n,
        "velocity": [0.0] * n,
        "gear": [4] * n,
        "ctrl_mode": [16] * n,
    }


class MemoryNetworks:
    """Scenarios' network settings in memory.

    Attributes:
        tables: name of the scenario -> what a TOML file would say.
    """

    def __init__(self) -> None:
        self.tables: dict[str, Mapping[str, Any]] = {}

    def network(self, scenario: str) -> NetworkSettings | None:
        return network_settings(self.tables[scenario]) if scenario in self.tables else None


class MemoryDataStore:
    """An archive in memory.

    Attributes:
        saved: (folder, name, contents by file name), in order; those of *.csv and *.txt as text.
        refusal: why nothing can be saved; None while it can.
    """

    def __init__(self) -> None:
        self.saved: list[tuple[str, str, dict[str, Any]]] = []
        self.refusal: str | None = None

    def save(self, folder: str, name: str, files: Mapping[str, bytes], source: str) -> None:
        if self.refusal is not None:
            raise DocumentError(self.refusal)
        assert source
        self.saved.append(
            (
                folder,
                name,
                {
                    file: content.decode() if file.endswith((".csv", ".txt")) else content
                    for file, content in files.items()
                },
            )
        )


class Client(Participant):
    """Somebody on the bus.

    Attributes:
        told: what it was told that answers nothing: (level, text).
        lost: what the simulator has taken from it: (kind, name).
        heard: (topic, message as Python objects), of all topics that it listens to, in order.
        raw: the same as JSON text.
    """

    is_guest = True

    def __init__(self, bus: Bus, name: str) -> None:
        self.name = name
        self.told: list[tuple[str, str]] = []
        self.lost: list[tuple[OfferKind, str]] = []
        self.heard: list[tuple[str, dict[str, Any]]] = []
        self.raw: list[bytes] = []
        self._bus = bus
        self.now = 0.0

    def notify(self, level: str, text: str) -> None:
        self.told.append((level, text))

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        self.lost.append((kind, name))
        self.told.append(("error", why))

    def listen(self, *topics: str) -> None:
        for topic in topics:
            self._bus.subscribe(self, topic, self._hear)

    def _hear(self, topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        self.heard.append((topic.name, orjson.loads(message.json)))
        self.raw.append(topic.name.encode() + b" " + message.json)

    def messages(self, topic: str) -> list[dict[str, Any]]:
        return [message for name, message in self.heard if name == topic]

    def send(self, name: str, type_name: str, /, **fields: object) -> None:
        """Publish; raises what a real peer would be told in a status."""
        topic = self._bus.advertise(self, name, type_name)
        value = topic.type.check(fields, self._bus.stamp_ns)
        self._bus.publish(self, topic, Message(topic.type, value), self.now)

    def call(self, service: str, args: dict[str, Any]) -> Answer:
        answers: list[Answer] = []
        self._bus.call(self, service, args, answers.append, now=self.now)
        assert len(answers) == 1, "every call is answered at once, and once"
        return answers[0]

    def ask(self, service: str, **request: object) -> dict[str, Any]:
        """The response to a MORAI service."""
        answer = self.call(service, {"request": request})
        assert answer.is_ok, answer.values
        assert isinstance(answer.values, Message)
        response: dict[str, Any] = orjson.loads(answer.values.json)["response"]
        return response

    def refused(self, service: str, **request: object) -> str:
        """Why a call was refused."""
        answer = self.call(service, {"request": request})
        assert not answer.is_ok
        assert isinstance(answer.values, str)
        return answer.values

    # The calls of synchronous mode

    def start(self, user_id: str = "me", time_step: int = 20) -> dict[str, Any]:
        return self.ask("/SyncModeCmd", user_id=user_id, start_sync_mode=True, time_step=time_step)

    def stop(self, user_id: str = "me", time_step: int = 20) -> dict[str, Any]:
        return self.ask("/SyncModeCmd", user_id=user_id, start_sync_mode=False, time_step=time_step)

    def tick(self, user_id: str = "me", frame: float = 0) -> dict[str, Any]:
        return self.ask("/SyncModeWaitForTick", user_id=user_id, frame=frame)

    def control(self, frame: float, **command: object) -> bool:
        result: bool = self.ask("/SyncModeCtrlCmd", frame=frame, command=command)["result"]
        return result

    def leave(self) -> None:
        self._bus.leave(self, self.now)


def network_settings(tables: Mapping[str, Any]) -> NetworkSettings:
    """The network settings that a TOML file with these tables has."""
    return NetworkSettings(**{name: read_choices(InterfaceKind(name), table) for name, table in tables.items()})


def rates(hertz: Mapping[str, float]) -> dict[str, Any]:
    """The tables that give these publishers these rates."""
    return {"publishers": {name: {"rate": rate} for name, rate in hertz.items()}}


class SimHarness:
    """A simulator on a bus of its own."""

    def __init__(
        self,
        scenario: str = "crowd",
        *,
        release: str = "22.R2",
        ros: Generation = 1,
        recordings: Recordings | None = None,
        reader: Reader | None = None,
        worker: SensorWorker | None = None,
        network: Mapping[str, Any] | None = None,
        dynamics: Dynamics = Dynamics.KINEMATIC,
        is_creeping: bool = False,
        has_impacts: bool = False,
        **settings: Any,  # noqa: ANN401 - NodeSettings' own fields
    ) -> None:
        """A simulator with its opening scene; `network` is what a TOML file would say of it."""
        self.bus = Bus(make_store(release, ros))
        self.world = World(0, dynamics, is_creeping=is_creeping, has_impacts=has_impacts)
        self.shelf = MemoryLibrary()
        self.drawer = MemoryDataStore()
        self.networks = MemoryNetworks()
        chosen = NodeSettings(network=network_settings(network or {}), **settings)
        self.node = make_node(
            self.bus,
            self.world,
            self.shelf,
            self.shelf.scenario(scenario),
            chosen,
            archive=self.drawer,
            recordings=recordings,
            networks=self.networks,
            reader=reader,
            worker=worker,
        )
        self.now = 100.0
        self._num_clients = 0

    def client(self) -> Client:
        self._num_clients += 1
        return Client(self.bus, f"/client_{self._num_clients}")

    def run(self, seconds: float) -> None:
        """Let real time pass, with `advance` called just when it asks for it."""
        end = self.now + seconds
        while True:
            due = self.node.next_due(self.now)
            if due is None or due > end + 1e-9:
                break
            self.now = max(self.now, due)
            self.node.advance(self.now)
        self.now = end
