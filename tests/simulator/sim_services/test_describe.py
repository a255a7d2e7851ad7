"""`/sim/describe`: what an entity is and does, on maps where the answer can be seen at a glance."""

from __future__ import annotations

import copy
import json
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.schema.message import Message
from rosbridge_sim.world.lane_changes.lane_change_model import LaneChange
from rosbridge_sim.world.roads.signal_plan import Lamp
from tests.simulator.sim_harness import SCENARIOS, Client, SimHarness, put_egos


def describe(client: Client, number: int) -> dict[str, Any]:
    answer = client.call("/sim/describe", {"id": number})
    assert isinstance(answer.values, Message), answer
    values: dict[str, Any] = json.loads(answer.values.json)
    return values


def in_sync(scenario: str = "crossing") -> tuple[SimHarness, Client]:
    harness = SimHarness(scenario, start="sync")
    client = harness.client()
    client.start()
    return harness, client


def test_entities_of_each_kind_are_described() -> None:
    harness, client = in_sync("crowd")
    client.tick()
    told = {number: describe(client, number) for number in (0, 7, 10, 9, 3)}
    assert [each["kind"] for each in told.values()] == [0, 1, 1, 2, 3]
    assert [each["behaviour"] for each in told.values()] == ["driven", "straight", "stand", "path", "stand"]
    assert told[7]["text"] == "drives at 36 km/h straight on"
    assert told[9]["text"].startswith("walks at 4 km/h")
    assert told[0]["text"] == "stands"
    assert (told[0]["controlled_by"], told[7]["controlled_by"]) == ("nobody", "simulator")
    assert told[7]["x"] == harness.world.x[harness.world.row(7)]
    assert (told[7]["gap"], told[7]["stop_distance"], told[7]["link"]) == (-1.0, -1.0, "")


@pytest.mark.parametrize("number", [1, 4_000_000_000, 2**32 - 1])
def test_unknown_number_is_refused_with_the_reason(number: int) -> None:
    _, client = in_sync("crowd")
    told = describe(client, number)
    assert (told["result"], told["text"]) == (False, "")
    assert told["message"] == f"id: there is no entity {number}; /sim/scene/state has the numbers"


def test_removed_entity_is_unknown() -> None:
    _, client = in_sync("crowd")
    assert describe(client, 7)["result"]
    client.call("/sim/remove", {"unique_ids": [7]})
    assert not describe(client, 7)["result"]


def test_further_ego_is_described_by_its_number() -> None:
    _, client = in_sync("crowd")
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 5))
    told = describe(client, 5)
    assert (told["kind"], told["behaviour"], told["x"]) == (0, "driven", 30.0)


def test_driver_that_stops_for_a_light_names_it() -> None:
    harness, client = in_sync()
    client.start(time_step=1000)
    world, plan = harness.world, harness.world.signals.plan
    client.call("/sim/remove", {"unique_ids": [2]})
    for _ in range(16):
        for light in range(len(plan.lights)):
            world.signals.force(light, Lamp.RED)
        client.tick()
    told = describe(client, 1)
    assert (told["behaviour"], told["stops_for"], told["speed"]) == ("lane", "light", pytest.approx(0.0, abs=0.1))
    assert plan.lights[plan.light_of_lane[world.roads.ids.index(told["stop_link"])]].name == told["light"]
    assert told["text"] == f"stands, stops for light {told['light']} in 1 m"
    assert told["next_links"][0] == told["stop_link"]


def test_description_changes_nothing() -> None:
    hashes = []
    for is_asked in (False, True):
        harness, client = in_sync()
        for _ in range(20):
            client.tick()
            if is_asked:
                for uid in harness.world.uid[: harness.world.n].tolist():
                    describe(client, uid)
        hashes.append(harness.world.digest())
    assert hashes[0] == hashes[1]


def test_driver_that_changes_lanes_signals_and_says_why() -> None:
    harness, client = in_sync()
    world = harness.world
    row = world.row(1)
    assert (describe(client, 1)["changes_lane"], describe(client, 1)["turn_signal"]) == ("", 0)
    world.change[row], world.signal[row] = LaneChange.AROUND, 2
    told = describe(client, 1)
    assert (told["changes_lane"], told["is_changing"], told["turn_signal"]) == ("around", False, 2)
    assert "wants to change to the lane to the right to pass what stands" in told["text"]
    world.leaving[row] = 1
    assert describe(client, 1)["is_changing"]


def test_vehicle_of_a_file_keeps_its_lane_and_its_offset(monkeypatch: pytest.MonkeyPatch) -> None:
    document = copy.deepcopy(SCENARIOS["crossing"])
    document["vehicleList"][0] |= {"isLaneChange": False, "latBias": "0.25"}
    monkeypatch.setitem(SCENARIOS, "offset", document)
    harness, client = in_sync("offset")
    client.tick()
    row = int(np.flatnonzero(harness.world.has_lane)[0])
    assert harness.world.keeps_lane[row] == 1.0
    assert describe(client, int(harness.world.uid[row]))["lateral"] == 0.25
