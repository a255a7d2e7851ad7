"""Whatever fails while a service reads files, or uses what was read: its call is answered, and the next one served."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, cast

import pytest

from rosbridge_sim.errors import EncodingError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Answer
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.schema.message import Message
from rosbridge_sim.shell.bags.recordings import DiskRecordings
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.shell.files.thread_reader import ThreadReader
from rosbridge_sim.simulator.bus.network_settings import NetworkSettings
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.replays.recorded_drive import Recording
from rosbridge_sim.simulator.replays.recorded_plans import RecordedPlan
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder, Recordings, Then
from rosbridge_sim.simulator.sim_services.scenario_services import Listing
from rosbridge_sim.world.state.world import World
from tests.shell.bags.test_bag_reader import EGO, OBJECTS, ways, write
from tests.simulator.sim_harness import ALL, MemoryLibrary, make_store
from tests.support import PATIENCE


class PanicError(BaseException):
    """What a library in Rust raises when it has a bug: no `Exception`."""


ERRORS = (ZeroDivisionError("odd"), RecursionError("odd"), MemoryError(), PanicError("odd"), SystemExit(3))

Odd = BaseException | None
"""What every read raises; None where it returns what nobody can use."""


class OddDisk:
    """A source of all kinds of documents; `is_odd` after the start.

    Attributes:
        odd: see `Odd`.
    """

    def __init__(self, odd: Odd) -> None:
        self.odd = odd
        self.is_odd = False
        self._library = MemoryLibrary()

    def _fail(self) -> Any:  # noqa: ANN401 - whatever it is
        if self.odd is not None:
            raise self.odd
        return object()

    def scenario(self, name: str) -> Scenario:
        return cast("Scenario", self._fail()) if self.is_odd and name == "odd" else self._library.scenario(name)

    def map(self, name: str) -> RoadMap:
        return cast("RoadMap", self._fail()) if self.is_odd else self._library.map(name)

    def network(self, scenario: str) -> NetworkSettings | None:
        del scenario
        return cast("NetworkSettings", self._fail())

    def list(self, first: int, count: int) -> Listing:
        del first, count
        return cast("Listing", self._fail())

    def picture(self, name: str, width: int, height: int) -> bytes:
        del name, width, height
        return cast("bytes", self._fail())


class OddTexts(dict[tuple[str, str, str], str]):
    """Definitions that cannot be read."""

    def __init__(self, odd: BaseException) -> None:
        super().__init__(read_definitions("22.R2"))
        self._odd = odd

    def keys(self) -> Any:  # noqa: ANN401 - nothing
        raise self._odd

    def __iter__(self) -> Iterator[tuple[str, str, str]]:
        raise self._odd


class OddRecordings:
    """Recordings with a plan that is none."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop

    def read(self, name: str, reading: RecordingBuilder, then: Then) -> None:
        del name
        reading.take_ego(0, make_ego(), (1, 1))
        whole = reading.finish()
        nothing: Any = None
        plan = RecordedPlan(nothing, nothing, [0], [b""], bytes)
        odd = Recording(whole.name, whole.egos, plans=(plan,))
        self._loop.call_soon(lambda: then(odd, self._loop.time()))


def make_ego() -> object:
    store = make_store()
    return store.message("morai_msgs/EgoVehicleStatus").check({"position": {"x": 1.0}}, 0)


class Asker(Participant):
    """A client whose calls are answered later."""

    name = "/asker"

    def __init__(self, bus: Bus) -> None:
        self._bus = bus

    def notify(self, level: str, text: str) -> None:
        """Take what is told."""

    async def call(self, service: str, args: dict[str, Any]) -> Answer:
        answers: asyncio.Queue[Answer] = asyncio.Queue()
        self._bus.call(self, service, args, answers.put_nowait, now=0.0)
        async with asyncio.timeout(PATIENCE):
            return await answers.get()


def serve(odd: Odd, recordings: Recordings | None = None) -> tuple[Asker, OddDisk, ThreadReader]:
    bus, disk = Bus(make_store()), OddDisk(odd)
    reader = ThreadReader(asyncio.get_running_loop())
    node: Any = make_node(
        bus,
        World(),
        disk,
        disk.scenario("crowd"),
        networks=disk,
        reader=reader,
        shelf=disk,
        recordings=recordings,
    )
    del node
    return Asker(bus), disk, reader


LOAD = {"file_name": "crowd", **ALL}
CALLS: dict[str, tuple[str, dict[str, Any]]] = {
    "scenario": ("/Service_MoraiSL", {"request": {**LOAD, "file_name": "odd"}}),
    "map": ("/Service_MoraiSL", {"request": {**LOAD, "file_name": "elsewhere"}}),
    "network": ("/Service_MoraiSL", {"request": {**LOAD, "load_network_connection_data": True}}),
    "list": ("/sim/scenarios", {}),
    "picture": ("/sim/scenario_picture", {"name": "crowd"}),
}


@pytest.mark.parametrize("what", CALLS)
@pytest.mark.parametrize("odd", [*ERRORS, None], ids=lambda odd: type(odd).__name__)
async def test_call_that_reads_is_answered_whatever_fails(what: str, odd: Odd) -> None:
    asker, disk, reader = serve(odd)
    disk.is_odd = True
    service, args = CALLS[what]
    for _ in range(3):  # more than there are threads
        answer = await asker.call(service, args)
        assert not answer.is_ok or not result_of(answer)
    assert reader.num_bugs == 3 or odd is None


def result_of(answer: Answer) -> bool:
    assert isinstance(answer.values, Message)
    with suppress(EncodingError):  # a peer refuses the call then
        assert answer.values.json
        return bool(getattr(answer.values.value, "response", answer.values.value).result)
    return False


@pytest.mark.parametrize("odd", [*ERRORS, None], ids=lambda odd: type(odd).__name__)
async def test_load_at_a_frame_is_answered_whatever_fails(odd: Odd) -> None:
    asker, disk, _reader = serve(odd)
    disk.is_odd = True
    start = {"request": {"user_id": "me", "start_sync_mode": True, "time_step": 20}}
    assert (await asker.call("/SyncModeCmd", start)).is_ok
    for name, network in (("odd", False), ("elsewhere", False), ("crowd", True)):
        load = {**LOAD, "file_name": name, "load_network_connection_data": network, "frame": 3}
        answer = await asker.call("/SyncModeScenarioLoad", {"request": load})
        assert not answer.is_ok or not result_of(answer)
    tick = await asker.call("/SyncModeWaitForTick", {"request": {"user_id": "me"}})
    assert tick.is_ok  # the world does not wait for a load that has failed


@pytest.mark.parametrize("odd", [*ERRORS, None], ids=lambda odd: type(odd).__name__)
async def test_restore_is_answered_whatever_fails_in_reading_its_map(odd: Odd) -> None:
    asker, disk, _reader = serve(odd)
    assert (await asker.call("/Service_MoraiSL", {"request": {**LOAD, "file_name": "elsewhere"}})).is_ok
    taken = await asker.call("/sim/snapshot", {"id": "a", "with_data": True})
    assert isinstance(taken.values, Message)
    data = taken.values.value.data
    assert (await asker.call("/sim/snapshots", {"remove": ["a"]})).is_ok
    assert (await asker.call("/Service_MoraiSL", {"request": LOAD})).is_ok
    disk.is_odd = True
    for _ in range(3):
        answer = await asker.call("/sim/restore", {"data": data})
        assert not answer.is_ok or not result_of(answer)


@pytest.mark.parametrize("odd", ERRORS, ids=lambda odd: type(odd).__name__)
async def test_replay_is_answered_whatever_fails_in_reading(tmp_path: Path, odd: BaseException) -> None:
    write(tmp_path / "drive.bag", {"/Ego_topic": (EGO, ways(1.0, 2.0)), "/Object_topic": (OBJECTS, [{}])})
    recordings = DiskRecordings(tmp_path, OddTexts(odd), asyncio.get_running_loop())
    asker, _disk, _reader = serve(None, recordings)
    for _ in range(3):
        play = {"sim_process_status": 1, "replay_option": 1, "rosbag_file_name": "drive"}
        answer = await asker.call("/Morai_SimProc", {"request": play})
        assert not answer.is_ok or not result_of(answer)
    assert recordings.reader.num_bugs == 3


async def test_replay_is_answered_whatever_fails_in_showing_it() -> None:
    asker, _disk, _reader = serve(None, OddRecordings(asyncio.get_running_loop()))
    errors: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda _loop, context: errors.append(context))
    play = {"sim_process_status": 1, "replay_option": 1, "rosbag_file_name": "drive"}
    answer = await asker.call("/Morai_SimProc", {"request": play})
    assert not answer.is_ok
    assert len(errors) == 1
