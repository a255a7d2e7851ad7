"""Slow loads: in order for their client, while other clients go on."""

from __future__ import annotations

import json
import logging
from collections import deque
from collections.abc import Callable
from typing import Any

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, given, settings

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.shell.files.document_cache import DocumentCache
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.morai_services.loads import _read_documents
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.plain.reading import AtOnce, Reader
from rosbridge_sim.simulator.scene.load import find_map
from rosbridge_sim.simulator.scene.rehearsal import Rehearsal
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.simulator.sync.sync_table import SyncState
from rosbridge_sim.world.people.known_crossings import KnownCrossings
from rosbridge_sim.world.roads.paths import _lay_once
from rosbridge_sim.world.roads.routing import KnownRoutes
from rosbridge_sim.world.state.world import Dynamics, World
from tests.simulator.sim_harness import ALL, SCENARIOS, Client, ManualReader, SimHarness, make_store

Frame = dict[str, Any]

LOAD, LOAD_AT = "/Service_MoraiSL", "/SyncModeScenarioLoad"
CROWD, PARKED = 6, 1
"""How many are in the world after these scenarios."""


class Wire:
    """A client whose frames all come at once, as from a socket: it stops where its peer is held.

    Attributes:
        peer: its peer.
    """

    def __init__(self, bus: Bus) -> None:
        self._outbox = Outbox(OutboxLimits(), lambda: None, lambda: None)
        self.peer = Peer(bus, Session(self._outbox, lambda _due: None))
        self.peer.on_released = self._go_on
        self._backlog: deque[bytes] = deque()
        self.now = 0.0

    def send(self, **op: object) -> None:
        self._backlog.append(json.dumps(op).encode())
        self._go_on()

    def call(self, service: str, **request: object) -> None:
        self.send(op="call_service", service=service, id=service, args={"request": request})

    def load(self, name: str = "parked", **more: object) -> None:
        self.call(LOAD, file_name=name, **ALL, **more)

    def load_at(self, frame: int, name: str = "parked", **more: object) -> None:
        self.call(LOAD_AT, file_name=name, frame=frame, **ALL, **more)

    def start(self, user_id: str = "me", time_step: int = 20) -> None:
        self.call("/SyncModeCmd", user_id=user_id, start_sync_mode=True, time_step=time_step)

    def stop(self, user_id: str = "me") -> None:
        self.call("/SyncModeCmd", user_id=user_id, start_sync_mode=False)

    def tick(self, user_id: str = "me") -> None:
        self.call("/SyncModeWaitForTick", user_id=user_id)

    def _go_on(self) -> None:
        while self._backlog and not self.peer.is_held:
            self.peer.receive(self._backlog.popleft(), self.now)

    @property
    def frames(self) -> list[bytes]:
        """All that it was sent since the last look."""
        return [bytes(frame) for frame in self._outbox.take(2**40)]

    def answers(self) -> list[tuple[str, Any]]:
        """(service, what its response says) of each answer since the last look."""
        found = []
        for frame in map(json.loads, self.frames):
            if frame["op"] == "service_response":
                assert frame["result"], frame
                response = frame["values"].get("response", frame["values"])
                told = response.get("result", (response.get("tick_status"), response.get("frame")))
                found.append((frame["service"], told))
        return found


class LoadFixture:
    """A simulator, a reader that is worked by hand, and clients."""

    def __init__(self, reader: Reader | None = None, **options: Any) -> None:  # noqa: ANN401 - the stand's own
        self.reader = ManualReader()
        self.harness = SimHarness(reader=reader or self.reader, **options)
        self.world, self.sync = self.harness.world, self.harness.node.sync

    def wire(self) -> Wire:
        return Wire(self.harness.bus)

    def master(self, **options: Any) -> Wire:  # noqa: ANN401 - those of the call
        wire = self.wire()
        wire.start(**options)
        wire.answers()
        return wire


TICK = "/SyncModeWaitForTick"


# Now


@pytest.mark.parametrize("way", ["service", "topic"])
def test_messages_after_a_load_act_on_the_new_scene(way: str) -> None:
    one = LoadFixture()
    client = one.master()
    if way == "service":
        client.load()
    else:
        client.send(
            op="publish", topic="/ScenarioLoad", type="morai_msgs/ScenarioLoad", msg={"file_name": "parked", **ALL}
        )
    client.tick()
    client.call("/Service_MoraiEventCmd", option=0)
    assert client.answers() == []
    assert (len(one.world), one.world.frame) == (CROWD, 0)
    one.reader.hand_over()
    assert (len(one.world), one.world.frame) == (PARKED, 1)
    assert [service for service, _ in client.answers()] == [*[LOAD][: way == "service"], TICK, "/Service_MoraiEventCmd"]


def test_other_clients_go_on_while_a_scenario_is_read() -> None:
    one = LoadFixture()
    loader, other = one.wire(), one.wire()
    loader.load()
    one.harness.run(0.1)
    assert one.world.frame >= 5
    other.call("/Service_MoraiEventCmd", option=0)
    other.start()
    other.tick()
    assert [service for service, _ in other.answers()] == ["/Service_MoraiEventCmd", "/SyncModeCmd", TICK]
    frame = one.world.frame
    one.reader.hand_over()
    assert (len(one.world), one.world.frame) == (PARKED, frame)
    assert loader.answers() == [(LOAD, True)]


def test_loads_of_one_client_are_read_in_order() -> None:
    one = LoadFixture()
    client = one.wire()
    client.load("parked")
    client.load("elsewhere")
    client.load("crowd")
    for _ in range(3):
        assert len(one.reader.waiting) == 1
        one.reader.hand_over()
    assert client.answers() == [(LOAD, True)] * 3
    assert one.harness.node.scene.loaded.name == "crowd"
    assert not client.peer.is_held


@pytest.mark.parametrize("way", ["service", "topic"])
def test_failed_load_gives_the_reason_and_releases_its_client(way: str) -> None:
    one = LoadFixture()
    client = one.wire()
    before = one.world.digest()
    if way == "service":
        client.load("lost")
    else:
        message = {"file_name": "lost", **ALL}
        client.send(op="publish", id="p1", topic="/ScenarioLoad", type="morai_msgs/ScenarioLoad", msg=message)
    client.call("/Service_MoraiEventCmd", option=0)
    one.reader.hand_over()
    status, *others = [json.loads(frame) for frame in client.frames]
    assert (status["op"], status["level"]) == ("status", "error")
    assert status["id"] == (LOAD if way == "service" else "p1")
    assert "no link 'no such link'" in status["msg"]
    assert others[-1]["service"] == "/Service_MoraiEventCmd"
    if way == "service":
        assert others[0]["values"]["response"] == {"result": False}
    assert one.world.digest() == before


@pytest.mark.parametrize("way", ["service", "topic"])
def test_load_of_a_departed_client_takes_effect(way: str) -> None:
    one = LoadFixture()
    client = one.wire()
    if way == "service":
        client.load()
    else:
        message = {"file_name": "parked", **ALL}
        client.send(op="publish", topic="/ScenarioLoad", type="morai_msgs/ScenarioLoad", msg=message)
    client.tick()
    client.peer.leave(0.0)
    one.reader.hand_over()
    assert len(one.world) == PARKED
    assert client.answers() == []
    assert not client.peer.is_held
    assert client.peer not in one.harness.bus.owners()


def test_load_overtaken_by_a_reset_fails() -> None:
    one = LoadFixture()
    client, other = one.wire(), one.wire()
    client.load()
    client.call("/Service_MoraiEventCmd", option=0)
    other.send(op="call_service", service="/sim/reset")
    before = one.world.digest()
    one.reader.hand_over()
    status, answer, after = [json.loads(frame) for frame in client.frames]
    assert "the simulation was reset or restored before the scenario was read" in status["msg"]
    assert answer["values"]["response"] == {"result": False}
    assert after["service"] == "/Service_MoraiEventCmd"
    assert one.world.digest() == before


def test_scenario_without_a_map_uses_the_map_of_its_load_time() -> None:
    one = LoadFixture()
    first, second = one.wire(), one.wire()
    first.load("parked")  # names no map
    second.load("elsewhere")
    one.reader.hand_over(1)
    road_map = one.harness.node.scene.road_map
    assert road_map.name == "hills"
    one.reader.hand_over(0)
    assert one.harness.node.scene.road_map is road_map
    assert one.harness.node.scene.loaded.name == "parked"


def test_load_whose_call_timed_out_still_delays_later_messages() -> None:
    one = LoadFixture()
    client = one.master()
    client.send(op="call_service", service=LOAD, timeout=1.0, args={"request": {"file_name": "parked", **ALL}})
    client.tick()
    one.harness.bus.expire(2.0)
    (refusal,) = [json.loads(frame) for frame in client.frames]
    assert (refusal["result"], one.world.frame) == (False, 0)
    one.reader.hand_over()
    assert (len(one.world), one.world.frame) == (PARKED, 1)


class Broken:
    """A reader that hands over what no reader may."""

    def read(self, work: Callable[[], Any], then: Callable[[Any, float], None], now: float) -> None:
        del work
        then("no documents", now)


@pytest.mark.parametrize("load", [Wire.load, lambda wire: wire.load_at(1)], ids=["now", "at a frame"])
def test_internal_failure_answers_the_caller_and_releases_it(load: Callable[[Wire], None]) -> None:
    one = LoadFixture(Broken())
    client = one.master()
    with pytest.raises(AttributeError):
        load(client)
    assert [told for _, told in client.answers()] == [False]
    client.tick()
    assert client.answers() == [(TICK, (True, 1))]


def test_held_master_does_not_lose_its_lease() -> None:
    one = LoadFixture(sync_lease=1.0)
    client = one.master()
    client.load()
    client.now = 30.0
    client.tick()
    one.harness.node.advance(20.0)
    assert one.harness.node.next_due(20.0) is None
    one.reader.hand_over(now=30.0)
    assert client.answers() == [(LOAD, True), (TICK, (True, 1))]
    assert one.harness.node.next_due(30.0) == 31.0
    one.harness.node.advance(31.0)
    assert one.sync.state is SyncState.FREE


# At a frame


def test_load_at_a_frame_is_answered_when_it_is_checked() -> None:
    one = LoadFixture()
    client = one.master()
    client.load_at(1)
    client.load_at(2, "lost")
    client.load_at(2, "nothing")
    client.tick()
    client.tick()
    for _ in range(3):
        one.reader.hand_over()
    assert client.answers() == [
        (LOAD_AT, True),
        (LOAD_AT, False),
        (LOAD_AT, False),
        (TICK, (True, 1)),
        (TICK, (True, 2)),
    ]
    assert len(one.world) == PARKED
    assert len(one.sync.waiting()) == 0


def test_tick_and_its_caller_wait_for_the_load_of_its_frame() -> None:
    one = LoadFixture()
    master, loader, other = one.master(), one.wire(), one.wire()
    loader.load_at(2)
    master.tick()
    master.tick()
    master.call("/Service_MoraiEventCmd", option=0)
    assert master.answers() == [(TICK, (True, 1))]
    assert one.sync.num_ticks == 1
    other.call("/Service_MoraiEventCmd", option=0)
    assert len(other.answers()) == 1
    one.reader.hand_over()
    assert loader.answers() == [(LOAD_AT, True)]
    assert [service for service, _ in master.answers()] == [TICK, "/Service_MoraiEventCmd"]
    assert (one.world.frame, len(one.world)) == (2, PARKED)
    assert one.sync.state is SyncState.LED


def test_tick_of_many_frames_waits_before_its_first_frame() -> None:
    one = LoadFixture()
    master, loader = one.master(time_step=100), one.wire()
    loader.load_at(4)
    master.tick()
    assert one.world.frame == 0
    one.reader.hand_over()
    assert master.answers() == [(TICK, (True, 5))]
    assert len(one.world) == PARKED


def test_tick_goes_on_after_a_failed_load() -> None:
    one = LoadFixture()
    master, loader = one.master(), one.wire()
    loader.load_at(1, "lost")
    master.tick()
    one.reader.hand_over()
    status, answer = [json.loads(frame) for frame in loader.frames]
    assert "no link" in status["msg"]
    assert answer["values"]["response"] == {"result": False}
    assert master.answers() == [(TICK, (True, 1))]
    assert len(one.world) == CROWD


def test_tick_waits_for_all_loads_of_its_frame_in_order_of_arrival() -> None:
    one = LoadFixture()
    master, first, second = one.master(), one.wire(), one.wire()
    first.load_at(1, "elsewhere")
    second.load_at(1, "crowd")
    master.tick()
    one.reader.hand_over(1)
    assert master.answers() == []
    assert second.answers() == [(LOAD_AT, True)]
    one.reader.hand_over()
    assert master.answers() == [(TICK, (True, 1))]
    assert one.harness.node.scene.loaded.name == "crowd"


def test_ticks_of_all_holders_of_the_master_id_wait_in_order() -> None:
    one = LoadFixture()
    masters, loader = [one.master(), one.wire(), one.wire()], one.wire()
    loader.load_at(1)
    loader_2 = one.wire()
    loader_2.load_at(3, "crowd")
    for master in masters:
        master.tick()
    masters[0].tick()
    one.reader.hand_over()
    assert [master.answers() for master in masters] == [[(TICK, (True, 1))], [(TICK, (True, 2))], []]
    assert one.sync.num_ticks == 2
    one.reader.hand_over()
    assert [master.answers() for master in masters] == [[(TICK, (True, 4))], [], [(TICK, (True, 3))]]


def test_tick_of_a_departed_caller_runs_if_its_id_has_another_holder() -> None:
    one = LoadFixture()
    first, second, loader = one.master(), one.wire(), one.wire()
    second.tick()
    second.answers()
    loader.load_at(2)
    first.tick()
    second.tick()
    assert one.sync.is_muted(first.peer)
    first.peer.leave(0.0)
    one.reader.hand_over()
    assert (first.answers(), second.answers()) == ([], [(TICK, (True, 3))])
    assert not any(one.sync.is_muted(each.peer) for each in (first, second, loader))


def test_departure_of_the_last_holder_during_a_waiting_tick_ends_the_mode() -> None:
    one = LoadFixture(sync_on_loss="wait")
    master, loader = one.master(), one.wire()
    loader.load_at(1)
    master.tick()
    master.peer.leave(0.0)
    assert one.sync.state is SyncState.OPEN
    one.reader.hand_over()
    assert loader.answers() == [(LOAD_AT, True)], "it was accepted, and dropped with the mode"
    assert (one.world.frame, len(one.world)) == (0, CROWD)
    assert not any(one.sync.is_muted(each.peer) for each in (master, loader))


def pause(wire: Wire) -> None:
    wire.call("/Service_MoraiEventCmd", option=8, set_pause=True)


def reset(wire: Wire) -> None:
    wire.send(op="call_service", service="/sim/reset")


@pytest.mark.parametrize(
    ("act", "state", "why"),
    [
        (pause, SyncState.LED_PAUSED, "the simulation was paused"),
        (Wire.stop, SyncState.FREE, "synchronous mode has ended"),
        (reset, SyncState.LED, "the simulation was reset"),
    ],
)
def test_pause_stop_and_reset_refuse_a_waiting_tick(act: Callable[[Wire], None], state: SyncState, why: str) -> None:
    one = LoadFixture()
    master, loader, other = one.master(), one.wire(), one.wire()
    master.tick()
    loader.load_at(2)
    master.send(op="set_level", level="warning")
    master.tick()
    master.call("/Service_MoraiEventCmd", option=0)
    master.answers()
    act(other)
    assert one.sync.state is state
    told, refused, after = [json.loads(frame) for frame in master.frames]
    assert why in told["msg"]
    response = refused["values"]["response"]
    assert response["tick_status"] is False
    assert response["pause_status"] is (act is pause)
    assert response["frame"] == one.world.frame == (0 if act is reset else 1)
    assert after["service"] == "/Service_MoraiEventCmd"
    one.reader.hand_over()
    assert loader.answers() == [(LOAD_AT, True)]
    assert len(one.sync.waiting()) == (1 if act is pause else 0)


def test_lease_does_not_end_while_a_tick_waits() -> None:
    one = LoadFixture(sync_lease=1.0)
    master, loader = one.master(), one.wire()
    loader.load_at(1)
    master.tick()
    one.harness.node.advance(50.0)
    one.reader.hand_over(now=50.0)
    assert master.answers() == [(TICK, (True, 1))]
    assert one.harness.node.next_due(50.0) == 51.0


def test_scenario_for_the_first_frame_may_be_loaded_before_a_master() -> None:
    one = LoadFixture(start="sync")
    loader, master = one.wire(), one.wire()
    loader.load_at(1)
    master.start()
    master.tick()
    master.answers()
    assert one.world.frame == 0
    one.reader.hand_over()
    assert master.answers() == [(TICK, (True, 1))]
    assert len(one.world) == PARKED


def test_load_at_an_impossible_frame_is_refused_without_reading() -> None:
    one = LoadFixture()
    client = one.wire()
    client.load_at(1)
    client.start()
    client.load_at(100_000)
    assert [told for _, told in client.answers()] == [False, True, False]
    assert one.reader.waiting == []


def test_command_during_a_waiting_tick_is_for_a_later_frame() -> None:
    one = LoadFixture()
    master, loader, other = one.master(), one.wire(), one.wire()
    loader.load_at(1, "crowd")
    master.tick()
    other.call("/SyncModeCtrlCmd", frame=1, command={"longlCmdType": 1, "accel": 1.0})
    one.reader.hand_over()
    assert len(one.sync.waiting()) == 1


# A world that fails meanwhile


@pytest.mark.parametrize("mode", ["exit", "serve"])
def test_waiting_ticks_are_refused_if_the_first_fails(mode: str) -> None:
    one = LoadFixture(on_world_failure=mode)
    first, second, loader = one.master(), one.wire(), one.wire()
    loader.load_at(1)
    first.tick()
    second.tick()
    one.harness.node.context.hooks.place.append(lambda: 1 // 0)  # as good a bug as any
    one.reader.hand_over()
    assert loader.answers() == [(LOAD_AT, True)]
    for master in (first, second):
        (answer,) = [json.loads(frame) for frame in master.frames]
        assert (answer["result"], answer["values"][:21]) == (False, "the world has failed:")
        assert not master.peer.is_held
    assert one.world.frame == 0


@pytest.mark.parametrize("load", [Wire.load, lambda wire: wire.load_at(1)], ids=["now", "at a frame"])
def test_load_into_a_failed_world_is_refused(load: Callable[[Wire], None]) -> None:
    one = LoadFixture(on_world_failure="serve")
    master, loader = one.master(), one.wire()
    load(loader)
    one.harness.node.context.failure.note(ZeroDivisionError("planted"))
    before = one.world.digest()
    one.reader.hand_over()
    answer, told = [json.loads(frame) for frame in loader.frames]
    assert (answer["result"], answer["values"][:21]) == (False, "the world has failed:")
    assert "the world has failed" in told["msg"]
    assert one.world.digest() == before
    assert not loader.peer.is_held
    assert master.answers() == []


# The same bytes, however long the reading takes


ACTS: dict[str, Callable[[Wire, int], None]] = {
    "tick": lambda wire, _n: wire.tick(),
    "load": lambda wire, n: wire.load(sorted(SCENARIOS)[n % len(SCENARIOS)]),
    "load at": lambda wire, n: wire.load_at(n % 4, sorted(SCENARIOS)[n % len(SCENARIOS)], set_pause=n % 11 == 0),
    "control": lambda wire, n: wire.call(
        "/SyncModeCtrlCmd", frame=n % 5, command={"longlCmdType": 1, "accel": 0.1 * (n % 10)}
    ),
    "start": lambda wire, n: wire.start(time_step=20 * (n % 4)),
    "stop": lambda wire, _n: wire.stop(),
    "play": lambda wire, _n: wire.call("/Service_MoraiEventCmd", option=8, set_pause=False),
    "reset": lambda wire, _n: reset(wire),
}


def run(acts: list[tuple[str, int]], reader: Reader) -> tuple[list[bytes], str]:
    """All that a client hears that does one thing after the other, and the state in the end."""
    one = LoadFixture(reader, start="sync")
    client = one.wire()
    for topic in ("/Ego_topic", "/Object_topic", "/SyncModeInfo"):
        client.send(op="subscribe", topic=topic)
    client.send(op="set_level", level="info")
    client.start()
    for name, n in acts:
        ACTS[name](client, n)
    if isinstance(reader, ManualReader):
        while reader.waiting:
            reader.hand_over()
    return client.frames, one.world.digest()


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.tuples(st.sampled_from(sorted(ACTS)), st.integers(0, 60)), max_size=12))
def test_slow_disk_changes_no_byte_for_one_client(acts: list[tuple[str, int]]) -> None:
    logging.disable(logging.ERROR)
    try:
        assert run(acts, ManualReader()) == run(acts, AtOnce())
    finally:
        logging.disable(logging.NOTSET)


def test_slow_disk_changes_no_byte_for_a_subscriber_beside_a_master_and_a_loader() -> None:
    def heard(reader: Reader) -> tuple[list[bytes], str]:
        one = LoadFixture(reader, start="sync")
        listener = one.harness.client()
        listener.listen("/Ego_topic", "/Object_topic", "/SyncModeInfo")
        master = one.master(time_step=60)
        for i in range(8):
            loaders = [one.wire(), one.wire()]
            for j, loader in enumerate(loaders):
                loader.load_at(3 * i + j + i % 4, ["parked", "elsewhere", "lost", "crowd"][(i + j) % 4])
            master.tick()
            if isinstance(reader, ManualReader):
                while reader.waiting:
                    reader.hand_over(-1)
            master.call("/SyncModeCtrlCmd", frame=3 * i, command={"longlCmdType": 1, "accel": 0.5})
        return listener.raw, one.world.digest()

    slow = heard(ManualReader())
    assert len(slow[0]) > 18
    assert slow == heard(AtOnce())


@pytest.mark.parametrize(("name", "traffic"), [("rush_hour", 0), ("town", 0), ("hills", 20), ("parking", 20)])
def test_first_frames_compute_nothing_of_the_roads_that_reading_has_not(
    name: str, traffic: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rosbridge_sim.shell.files.library._BUILT_IN_MAPS", DocumentCache())  # nothing is known yet
    library, reader, bus = DiskLibrary(), ManualReader(), Bus(make_store())
    settings = NodeSettings(start="sync", traffic=traffic)
    node = make_node(bus, World(0), library, library.scenario("loop"), settings, reader=reader)
    Client(bus, "loader").send("/ScenarioLoad", "morai_msgs/ScenarioLoad", file_name=name, **ALL)
    map_name = library.scenario(name).map_name
    assert map_name is not None
    roads = library.map(map_name).roads

    crossings = roads.derived(KnownCrossings)

    routes = roads.derived(KnownRoutes)._found

    def known() -> tuple[set[object], int, int, int]:
        return set(roads.kept), len(crossings._table.numbers), len(routes), _lay_once.cache_info().misses

    read = known()
    reader.hand_over()
    for _ in range(60):  # the first vehicle of a spawn point comes after a second
        node.context.stepper.compute(0.0, is_tick=True, is_last=True)
    assert node.context.world.roads is roads
    assert known() == read, "the event loop has computed it"


def test_scenario_is_rehearsed_once_on_a_map(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rosbridge_sim.shell.files.library._BUILT_IN_MAPS", DocumentCache())  # nothing is rehearsed yet
    library, played = DiskLibrary(), list[str]()

    class Counting(Rehearsal):
        def _play(self, placed: Scenario, road_map: RoadMap) -> None:
            played.append(placed.name)
            super()._play(placed, road_map)

    rehearsal = Counting(Dynamics.KINEMATIC, has_traffic=False)
    for name in ("hills", "demo", "hills", "demo"):
        _read_documents(library, None, name, find_map(library, "track"), rehearsal)
    assert played == ["hills", "demo"]
