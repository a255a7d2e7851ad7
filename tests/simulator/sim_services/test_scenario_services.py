"""`/sim/scenarios` and `/sim/scenario_picture`: requests, refusals and answers. The disk is tested in `shell/files`."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.topics_services import Answer
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.sim_services.scenario_services import ListedRecording, ListedScenario, Listing
from tests.simulator.sim_harness import Client, ManualReader, MemoryLibrary, SimHarness, make_store


class MemoryShelf:
    """A shelf in memory."""

    def __init__(self) -> None:
        self.asked: list[tuple[object, ...]] = []
        self.scenarios = [
            ListedScenario("Town/crowd", "track", 1, 2, 3, 4, ""),
            ListedScenario("torn", "", 0, 0, 0, 0, "torn.json: expected a document"),
        ]

    def list(self, first: int, count: int) -> Listing:
        self.asked.append((first, count))
        recordings = [ListedRecording("drive.mcap", 5_000_000_000, 1_500_000_000_123_456_789)]
        return Listing(self.scenarios[first : first + count], 2, recordings[first : first + count], 1)

    def picture(self, name: str, width: int, height: int) -> bytes:
        self.asked.append((name, width, height))
        if name == "none":
            raise DocumentError("no scenario 'none'")
        return b"PNG"


def shelved(shelf: MemoryShelf, reader: ManualReader | None = None) -> tuple[Client, ManualReader | None]:
    from rosbridge_sim.graph.bus import Bus  # noqa: PLC0415
    from rosbridge_sim.world.state.world import World  # noqa: PLC0415

    bus, library = Bus(make_store()), MemoryLibrary()
    make_node(bus, World(), library, library.scenario("crowd"), reader=reader, shelf=shelf)
    return Client(bus, "/asker"), reader


def ask(client: Client, service: str, **request: object) -> dict[str, Any]:
    answer = client.call(service, request)
    assert isinstance(answer.values, Message), answer
    values: dict[str, Any] = json.loads(answer.values.json)
    return values


def test_list_has_scenarios_and_recordings_of_a_page() -> None:
    client, _ = shelved(MemoryShelf())
    told = ask(client, "/sim/scenarios")
    assert (told["result"], told["num_scenarios"], told["num_recordings"]) == (True, 2, 1)
    first, torn = told["scenarios"]
    assert (first["name"], first["map"], first["num_obstacles"], first["is_loaded"]) == ("Town/crowd", "track", 4, True)
    assert (torn["is_loaded"], torn["problem"]) == (False, "torn.json: expected a document")
    (drive,) = told["recordings"]
    assert (drive["size"], drive["modified"]) == (5_000_000_000, {"secs": 1_500_000_000, "nsecs": 123_456_789})
    second = ask(client, "/sim/scenarios", first=1, count=1)
    assert [each["name"] for each in second["scenarios"]] == ["torn"]
    assert second["recordings"] == []
    assert ask(client, "/sim/scenarios", first=2**32 - 1)["scenarios"] == []


def test_count_is_bounded() -> None:
    shelf = MemoryShelf()
    client, _ = shelved(shelf)
    ask(client, "/sim/scenarios", count=4_000_000_000)
    assert shelf.asked == [(0, 50)]


def test_picture_has_the_usual_size_or_the_asked_one() -> None:
    shelf = MemoryShelf()
    client, _ = shelved(shelf)
    told = ask(client, "/sim/scenario_picture", name="crowd")
    assert (told["result"], told["format"], told["data"]) == (True, "png", "UE5H")
    ask(client, "/sim/scenario_picture", name="crowd", width=64, height=1024)
    assert shelf.asked == [("crowd", 320, 200), ("crowd", 64, 1024)]


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        ({"name": "crowd", "width": 63}, "width: expected 64..1024 pixels, or 0; got 63"),
        ({"name": "crowd", "height": 2**32 - 1}, "height: expected 64..1024 pixels, or 0; got 4294967295"),
        ({"name": "x" * 401}, "name: expected at most 400 characters, got 401"),
        ({"name": "none"}, "no scenario 'none'"),
    ],
)
def test_wrong_picture_is_refused_with_the_reason(request_: dict[str, object], why: str) -> None:
    client, _ = shelved(MemoryShelf())
    told = ask(client, "/sim/scenario_picture", **request_)
    assert (told["result"], told["message"], told["data"]) == (False, why, "")


def test_more_than_a_few_that_wait_are_refused_and_callers_that_left_are_not_answered() -> None:
    reader = ManualReader()
    client, _ = shelved(MemoryShelf(), reader)
    answers: list[Answer] = []
    bus = client._bus
    for _ in range(8):
        bus.call(client, "/sim/scenario_picture", {"name": "crowd"}, answers.append, now=0.0)
    assert answers == []
    refused = ask(client, "/sim/scenarios")
    assert refused["message"] == "8 lists and pictures are being made; ask again after one of the answers"
    reader.hand_over()
    assert [answer.is_ok for answer in answers] == [True]
    client.leave()
    for _ in range(7):
        reader.hand_over()
    other = Client(bus, "/other")
    bus.call(other, "/sim/scenarios", {}, answers.append, now=0.0)
    reader.hand_over()
    assert answers[-1].is_ok


def test_simulator_without_a_shelf_says_so() -> None:
    told = ask(SimHarness().client(), "/sim/scenarios")
    assert (told["result"], told["message"]) == (False, "this simulator has no folder with scenarios")
