"""Network settings that come with a scenario, by any of the three ways to load one."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.participant import Participant
from tests.simulator.sim_harness import ALL, SimHarness, put_egos

RENAMED = {
    "publishers": {"/Ego_topic": {"name": "/car/state", "rate": 25}, "/SyncModeInfo": {"name": "/mode"}},
    "subscribers": {"/ctrl_cmd": {"name": "/car/drive"}},
    "services": {"/Service_MoraiSL": {"name": "/load"}, "/SyncModeWaitForTick": {"name": "/next"}},
}
NETWORK = {"load_network_connection_data": True}


class PartOfServer(Participant):
    """An owner that gives way to no other."""

    name = "/recorder"

    def notify(self, level: str, text: str) -> None:
        pass


def test_load_applies_the_scenarios_network_settings_and_is_answered_under_the_old_name() -> None:
    harness = SimHarness(network={"publishers": {"/Ego_topic": {"rate": 10}, "/tf": {"name": "/frames"}}})
    harness.networks.tables["parked"] = RENAMED
    client = harness.client()
    assert client.ask("/Service_MoraiSL", file_name="parked", **ALL, **NETWORK)["result"] is True
    assert client.refused("/Service_MoraiSL") == "Service /Service_MoraiSL does not exist"
    client.listen("/car/state", "/frames")
    client.send("/car/drive", "morai_msgs/CtrlCmd", longlCmdType=2, velocity=30.0)
    harness.run(1.0)
    assert len(client.messages("/car/state")) == 25
    assert len(client.messages("/frames")) == 50, "what it does not name is as at the start"
    assert harness.bus.find_topic("/Ego_topic") is None
    assert client.ask("/load", file_name="crowd", **ALL)["result"] is True
    assert "/load" in harness.bus.services, "nobody has asked for other settings"
    assert client.told == []


def test_network_settings_of_a_scenario_override_those_of_the_start() -> None:
    harness = SimHarness()
    harness.networks.tables |= {"parked": RENAMED, "crowd": {"services": {"/SyncModeCmd": {"name": "/lead"}}}}
    client = harness.client()
    client.ask("/Service_MoraiSL", file_name="parked", **ALL, **NETWORK)
    client.ask("/load", file_name="crowd", **ALL, **NETWORK)
    assert "/lead" in harness.bus.services
    assert client.ask("/Service_MoraiSL", file_name="parked", **ALL)["result"] is True


def test_scenario_without_network_settings_keeps_the_present_ones_and_warns() -> None:
    harness = SimHarness()
    client = harness.client()
    assert client.ask("/Service_MoraiSL", file_name="parked", **ALL, **NETWORK)["result"] is True
    assert client.told == [("warning", "'parked' has no network settings: those in force stay")]
    assert "/Service_MoraiSL" in harness.bus.services


def test_network_settings_alone_can_be_loaded() -> None:
    harness = SimHarness()
    harness.networks.tables["parked"] = RENAMED
    client = harness.client()
    before = harness.world.digest()
    assert client.ask("/Service_MoraiSL", file_name="parked", **NETWORK)["result"] is True
    assert (client.told, harness.world.digest()) == ([], before)
    assert "/load" in harness.bus.services


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"services": {"/SyncMode": {}}}, "the simulator has no such service (did you mean /SyncModeCmd?)"),
        ({"services": {"/SyncModeCmd": {"name": "/a b"}}}, "expected the name of a topic or service"),
        ({"services": {"/SyncModeCmd": {"name": "/theirs"}}}, "service /theirs is provided by /recorder"),
        ({"publishers": {"/clock": {"name": "/tf"}}}, "expected different names for /clock and /tf"),
    ],
)
def test_invalid_network_settings_refuse_the_whole_load(tables: dict[str, Any], said: str) -> None:
    harness = SimHarness()
    harness.networks.tables["parked"] = tables | {"subscribers": {"/lamps": {"on": False}}}
    client = harness.client()
    harness.bus.provide(PartOfServer(), "/theirs", "std_srvs/Trigger", lambda *_: None)
    before = (harness.world.digest(), set(harness.bus.services), set(harness.bus.topics))
    assert client.ask("/Service_MoraiSL", file_name="parked", **ALL, **NETWORK)["result"] is False
    with pytest.raises(GraphError, match=r"^/ScenarioLoad: "):
        client.send("/ScenarioLoad", "morai_msgs/ScenarioLoad", file_name="parked", **ALL, **NETWORK)
    client.start()
    assert client.ask("/SyncModeScenarioLoad", file_name="parked", frame=1, **ALL, **NETWORK)["result"] is False
    assert [level for level, _ in client.told] == ["error", "error"]
    assert all(said in text for _, text in client.told)
    assert (harness.world.digest(), set(harness.bus.services), set(harness.bus.topics)) == before


def test_load_at_a_frame_renames_within_a_tick_that_is_still_answered() -> None:
    harness = SimHarness()
    harness.networks.tables["parked"] = RENAMED
    client = harness.client()
    client.start()
    client.listen("/Ego_topic", "/SyncModeInfo")
    load = {"load_network_connection": True}  # the manual's name of the option
    assert client.ask("/SyncModeScenarioLoad", file_name="parked", frame=2, **ALL, **load)["result"] is True
    client.tick()
    assert [name for name, _ in client.heard] == ["/Ego_topic", "/SyncModeInfo"]
    answer = client.tick()
    assert (answer["frame"], answer["vehicle_status"]["position"]["x"]) == (2, -5.0)
    assert len(client.heard) == 2
    mode = harness.bus.find_topic("/mode")
    assert mode is not None
    assert json.loads(mode.latched[0].json)["frame"] == 2
    client.listen("/car/state")
    assert client.ask("/next", user_id="me", frame=3)["tick_status"] is True
    assert len(client.messages("/car/state")) == 1


def test_load_at_a_frame_is_refused_if_a_new_name_is_taken_by_then() -> None:
    harness = SimHarness()
    harness.networks.tables["parked"] = RENAMED
    client = harness.client()
    client.start()
    assert client.ask("/SyncModeScenarioLoad", file_name="parked", frame=2, **ALL, **NETWORK)["result"] is True
    harness.bus.provide(PartOfServer(), "/load", "std_srvs/Trigger", lambda *_: None)
    size = len(harness.world)
    client.tick()
    client.tick()
    ((level, text),) = client.told
    assert (level, text.partition(": ")[0], text.rpartition(": ")[2]) == (
        "error",
        "/SyncModeScenarioLoad",
        "service /load is provided by /recorder",
    )
    assert len(harness.world) == size
    assert client.tick()["frame"] == 3


def test_load_that_removes_egos_and_renames_leaves_no_old_names() -> None:
    harness = SimHarness()
    harness.networks.tables["parked"] = RENAMED
    client = harness.client()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(2))
    assert client.ask("/Service_MoraiSL", file_name="parked", **NETWORK)["result"] is True
    assert "/Ego-2/next" in harness.bus.services
    assert client.ask("/load", file_name="crowd", **ALL, **NETWORK)["result"] is True
    assert not [name for name in harness.bus.services if name.startswith("/Ego-2/")]
    assert not [t.name for t in harness.bus.topics.values() if t.name.startswith("/Ego-2/") and t.publishers]
    client.call("/sim/reset", {"seed": 1})
    assert "/load" in harness.bus.services, "a reset leaves the network settings"
