"""`/sim/drivers`: who moves time, and who drives."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests.simulator.sim_harness import Client, SimHarness, put_egos

DRIVERS = "/sim/drivers"
COMMAND = "morai_msgs/CtrlCmd"


class Neighbour(Client):
    """A client with an address, as those of the server have."""

    address = "192.0.2.1:4711"


def watched(scenario: str = "crossing", **settings: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - NodeSettings'
    harness = SimHarness(scenario, **settings)
    viewer = harness.client()
    hear(harness, viewer)
    return harness, viewer


def hear(harness: SimHarness, viewer: Client) -> None:
    """Subscribe as a client of the server does, which gets the latched message."""
    viewer.listen(DRIVERS)
    for message in harness.bus.topics[DRIVERS].latched:
        viewer.heard.append((DRIVERS, json.loads(message.json)))
    harness.run(0.0)


def now(harness: SimHarness, viewer: Client) -> dict[str, Any]:
    harness.run(0.0)
    return viewer.messages(DRIVERS)[-1]


def test_new_subscriber_is_told_once_and_nothing_follows_without_a_change() -> None:
    harness, viewer = watched()
    harness.run(1.0)
    (told,) = viewer.messages(DRIVERS)
    assert (told["is_paused"], told["is_synchronous"], told["master"], told["time_step"]) == (False, False, "", 0)
    assert told["real_time_factor"] == 1.0
    assert told["egos"] == [
        {"unique_id": 0, "ctrl_mode": 3, "gear": 4, "driver": "nobody", "client": "", "publishers": []}
    ]
    other = harness.client()
    hear(harness, other)
    assert (len(other.messages(DRIVERS)), len(viewer.messages(DRIVERS))) == (1, 1)


def test_late_subscriber_gets_the_present_state_alone_and_others_get_changes_once() -> None:
    harness, viewer = watched()
    harness.client().ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    other = harness.client()
    hear(harness, other)
    assert [told["is_paused"] for told in viewer.messages(DRIVERS)] == [False, True]
    assert [told["is_paused"] for told in other.messages(DRIVERS)] == [True]
    viewer.leave()
    other.leave()
    harness.client().ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    last = harness.client()
    hear(harness, last)
    assert [told["is_paused"] for told in last.messages(DRIVERS)] == [False]
    harness.run(1.0)
    assert len(last.messages(DRIVERS)) == 1


def test_client_that_commands_is_named_by_its_address_until_it_leaves() -> None:
    harness, viewer = watched()
    neighbour = Neighbour(harness.bus, "/rosbridge_websocket")
    harness.bus.advertise(neighbour, "/ctrl_cmd", COMMAND)
    ego = now(harness, viewer)["egos"][0]
    assert (ego["driver"], ego["client"], ego["publishers"]) == ("nobody", "", [neighbour.address])
    neighbour.send("/ctrl_cmd", COMMAND, longlCmdType=1, accel=0.5)
    ego = now(harness, viewer)["egos"][0]
    assert (ego["driver"], ego["client"]) == ("client", neighbour.address)
    num = len(viewer.messages(DRIVERS))
    neighbour.send("/ctrl_cmd", COMMAND, longlCmdType=1, accel=0.6)
    harness.run(1.0)
    assert len(viewer.messages(DRIVERS)) == num
    neighbour.leave()
    ego = now(harness, viewer)["egos"][0]
    assert (ego["driver"], ego["client"], ego["publishers"]) == ("nobody", "", [])


def test_master_of_synchronous_mode_and_its_commands_are_told() -> None:
    harness, viewer = watched()
    master = Neighbour(harness.bus, "/rosbridge_websocket")
    master.start("pilot", time_step=40)
    told = now(harness, viewer)
    assert (told["is_synchronous"], told["master"], told["time_step"]) == (True, "pilot", 40)
    assert told["master_clients"] == [master.address]
    master.control(0, longlCmdType=1, accel=0.5)
    assert now(harness, viewer)["egos"][0]["client"] == master.address
    other = harness.client()
    step = {"user_id": "nobody", "n": 1, "commands": [{"ego": 0, "commands": [{"accel": 1.0}]}]}
    assert not getattr(other.call("/sim/step", step), "is_done", False)
    assert now(harness, viewer)["egos"][0]["client"] == master.address
    master.stop("pilot")
    told = now(harness, viewer)
    assert (told["is_synchronous"], told["master"], told["master_clients"]) == (False, "", [])


def test_refused_command_does_not_make_a_driver() -> None:
    harness, viewer = watched(start_mode="keyboard")
    neighbour = Neighbour(harness.bus, "/rosbridge_websocket")
    neighbour.send("/ctrl_cmd", COMMAND, longlCmdType=1, accel=0.5)
    assert now(harness, viewer)["egos"][0]["driver"] == "nobody"


def test_members_of_a_barrier_are_told() -> None:
    harness, viewer = watched(start="sync")
    members = [Neighbour(harness.bus, f"/{name}") for name in "ab"]
    for member in members:
        member.call("/sim/barrier/join", {"user_id": member.name[1:], "time_step": 20, "deadline_s": 1.0})
    told = now(harness, viewer)
    assert told["barrier_members"] == ["a", "b"]
    assert told["master_clients"] == [Neighbour.address]


def test_mode_gear_pause_factor_and_further_egos_are_told() -> None:
    harness, viewer = watched()
    client = harness.client()
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 5))
    harness.bus.advertise(client, "/Ego-5/ctrl_cmd", COMMAND)
    egos = now(harness, viewer)["egos"]
    assert [(ego["unique_id"], ego["publishers"]) for ego in egos] == [(0, []), (5, [client.name])]
    client.ask("/Service_MoraiEventCmd", option=1, ctrl_mode=6)
    assert now(harness, viewer)["egos"][0]["driver"] == "self-driving"
    client.call("/sim/real_time_factor", {"factor": 2.0})
    assert now(harness, viewer)["real_time_factor"] == 2.0
    client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    assert now(harness, viewer)["is_paused"]
    client.call("/sim/reset", {"seed": -1})
    assert len(now(harness, viewer)["egos"]) == 1


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
def test_both_releases_have_the_topic_under_changed_names_too(release: str) -> None:
    harness, viewer = watched(release=release, network={"subscribers": {"/ctrl_cmd": {"name": "/drive"}}})
    client = harness.client()
    harness.bus.advertise(client, "/drive", COMMAND)
    assert now(harness, viewer)["egos"][0]["publishers"] == [client.name]


def test_sample_of_a_step_does_not_take_a_change_from_subscribers() -> None:
    harness, viewer = watched(start="sync")
    client = harness.client()
    client.start()
    harness.run(0.0)
    client.ask("/Service_MoraiEventCmd", option=2, gear=1)
    assert client.call("/sim/step", {"user_id": "me", "n": 1, "topics": [DRIVERS, "/sim/scene/state"]}).is_ok
    assert now(harness, viewer)["egos"][0]["gear"] == 1
