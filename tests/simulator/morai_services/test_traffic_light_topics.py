"""Lights and intersections as clients see and set them."""

from __future__ import annotations

import math

import pytest

from rosbridge_sim.errors import FieldError
from rosbridge_sim.scenarios.scenario_reader import read_scenario
from tests.simulator.town import Crossroads

STATUS, INSIDE, ALL = "/GetTrafficLightStatus", "/InsnStatus", "/IntscnTL_topic"


def set_light(harness: Crossroads, index: str, status: int) -> None:
    harness.client.send(
        "/SetTrafficLight", "morai_msgs/SetTrafficLight", trafficLightIndex=index, trafficLightStatus=status
    )


def set_phase(harness: Crossroads, number: object, phase: int, seconds: float = 0.0) -> None:
    harness.client.send(
        "/InsnControl",
        "morai_msgs/IntersectionControl",
        intersection_index=number,
        intersection_status=phase,
        intersection_status_time=seconds,
    )


def ask(harness: Crossroads, index: str) -> tuple[str, int]:
    info = harness.client.ask("/Morai_TLSrv", idx=index)
    assert info["header"]["seq"] == harness.world.frame
    return info["idx"], info["status"]


# The light ahead


def test_light_ahead_is_published_every_frame() -> None:
    harness = Crossroads.tiny()
    harness.client.listen(STATUS)
    harness.run(0.1)
    heard = harness.client.messages(STATUS)
    assert [message["header"]["seq"] for message in heard] == [1, 2, 3, 4, 5]
    assert heard[0] == {
        "header": {"seq": 1, "stamp": {"secs": 0, "nsecs": 20_000_000}, "frame_id": "TrafficLightStatus"},
        "trafficLightIndex": "C1",
        "trafficLightType": 0,
        "trafficLightStatus": 16,
    }


@pytest.mark.parametrize(
    ("x", "y", "yaw_deg", "is_told"),
    [
        (0.0, 3.5, 0.0, True),
        (99.0, 0.0, 0.0, True),
        (101.0, 0.0, 0.0, False),  # it has been passed
        (50.0, 0.0, 180.0, False),  # on the wrong side of the road: no lane leads there
        (50.0, 30.0, 0.0, False),  # off the road
        (-6.0, 3.5, 0.0, False),  # before the road begins
    ],
)
def test_nothing_is_published_without_a_light_ahead(x: float, y: float, yaw_deg: float, is_told: bool) -> None:  # noqa: FBT001 - a column
    harness = Crossroads.tiny()
    harness.put(x, y, yaw_deg)
    harness.client.listen(STATUS)
    harness.run(0.04)
    assert (harness.last(STATUS) is not None) == is_told


def test_light_is_published_from_100_m_before_the_stop_line() -> None:
    town = Crossroads.built_in("town")
    town.client.listen(STATUS)
    town.put(-100.0, -5.25)  # inside of crossing 12, 86 m before the next line
    town.run(0.02)
    heard = town.last(STATUS)
    assert heard is not None
    assert (heard["trafficLightIndex"], heard["trafficLightType"]) == ("TL22W", 0)
    town.put(-119.0, -5.25)
    town.run(0.02)
    assert town.last(STATUS) is None


def test_motorway_gives_no_light_messages() -> None:
    loop = Crossroads.built_in("loop")
    loop.client.listen(STATUS, INSIDE, ALL)
    loop.run(0.02)
    assert (loop.last(STATUS), loop.last(INSIDE)) == (None, None)
    everything = loop.last(ALL)
    assert everything is not None
    assert (everything["idx"], everything["state"], everything["delta_time"]) == ([], [], [])


def test_the_light_ahead_changes_with_its_phase() -> None:
    harness = Crossroads.tiny()
    set_phase(harness, 13, 0, 8.0)
    harness.client.listen(STATUS)
    harness.run(14.0)
    seen = [message["trafficLightStatus"] for message in harness.client.messages(STATUS)]
    changes = [(i + 1, value) for i, value in enumerate(seen) if i == 0 or value != seen[i - 1]]
    # Frame 100: ten seconds of green are over; three of yellow; then the arrow for 5.5 and its two of yellow.
    assert changes == [(1, 16), (100, 4), (250, 1), (625, 16)]


def test_every_light_type_is_published() -> None:
    town = Crossroads.built_in("town")
    town.client.listen(STATUS)
    kinds = {}
    for x, y, yaw_deg in ((-50, -5.25, 0), (-50, -1.75, 0), (108.25, 60, -90), (221.75, 150, 90)):
        town.put(x, y, yaw_deg)
        town.run(0.02)
        heard = town.last(STATUS)
        assert heard is not None
        kinds[heard["trafficLightType"]] = (heard["trafficLightIndex"], heard["trafficLightStatus"])
    assert kinds.keys() == {0, 1, 2, 100}
    assert kinds[1][0] == "TL22WL"
    assert kinds[100] == ("TL44S", 4)


def test_each_ego_gets_its_own_light() -> None:
    harness = Crossroads.tiny()
    harness.client.send(
        "/ego_setting",
        "morai_msgs/MultiEgoSetting",
        number_of_ego_vehicle=1,
        camera_index=0,
        ego_index=[2],
        gear=[4],
        ctrl_mode=[16],
        global_position_x=[103.0],
        global_position_y=[0.0],
        global_position_z=[0.0],
        global_yaw=[0.0],
        global_roll=[0.0],
        global_pitch=[0.0],
        velocity=[0.0],
    )
    harness.client.listen(STATUS, INSIDE, "/Ego-2" + STATUS, "/Ego-2" + INSIDE)
    harness.run(0.02)
    assert harness.last(STATUS) is not None
    assert harness.last(INSIDE) is None
    assert harness.last("/Ego-2" + STATUS) is None
    assert harness.last("/Ego-2" + INSIDE) is not None


# Setting lights


def test_set_light_applies_to_its_group_until_the_next_phase() -> None:
    harness = Crossroads.tiny()
    harness.client.listen(STATUS)
    set_phase(harness, 13, 0, 10.0)
    harness.run(1.0)
    set_light(harness, "C2", 5)
    assert (ask(harness, "C1"), ask(harness, "C2"), ask(harness, "L1")) == (("C1", 5), ("C2", 5), ("L1", 1))
    harness.run(0.02)
    heard = harness.last(STATUS)
    assert heard is not None
    assert heard["trafficLightStatus"] == 5
    harness.run(1.96)
    assert ask(harness, "C1") == ("C1", 5)
    harness.run(0.02)
    assert (ask(harness, "C1"), ask(harness, "C2"), ask(harness, "L1")) == (("C1", 1), ("C2", 4), ("L1", 32))


def test_light_set_to_minus_one_returns_to_its_schedule() -> None:
    harness = Crossroads.tiny()
    set_light(harness, "C1", 0)
    assert ask(harness, "C1") == ("C1", 0)
    set_light(harness, "C1", -1)
    assert ask(harness, "C1") == ("C1", 16)
    set_light(harness, "P1", 16)
    assert (ask(harness, "P1"), ask(harness, "C1")) == (("P1", 16), ("C1", 16))


def test_repeated_setting_keeps_a_light() -> None:
    harness = Crossroads.tiny()
    set_phase(harness, 13, 0, 9.0)
    harness.client.start()
    for _ in range(100):  # the light alone turns yellow in frame 50
        harness.client.tick()
        set_light(harness, "C1", 16)
    assert ask(harness, "C1") == ("C1", 16)


@pytest.mark.parametrize(
    ("index", "status", "message"),
    [
        ("nobody", 1, "trafficLightIndex: the map has no traffic light 'nobody'"),
        ("C1", 2, "trafficLightStatus: expected a sum of lamps, or -1 to hand back, got 2"),
        ("C1", 8, "got 8"),
        ("C1", 48, r"'C1' and those of its group have the lamps 1 \+ 4 \+ 16; expected a sum of some of them, got 48"),
        ("P1", 32, "'P1' and those of its group have the lamps .* got 32"),
        ("C1", -2, "got -2"),
        ("C1", 4096, "got 4096"),
    ],
)
def test_impossible_light_value_is_refused(index: str, status: int, message: str) -> None:
    harness = Crossroads.tiny()
    with pytest.raises(FieldError, match=message):
        set_light(harness, index, status)
    assert ask(harness, "C1") == ("C1", 16)


def test_an_unknown_light_has_no_name_and_no_status() -> None:
    assert ask(Crossroads.tiny(), "nobody") == ("", -2)


# Intersections


def test_intersection_status_is_published_inside_the_intersection() -> None:
    harness = Crossroads.tiny()
    set_phase(harness, 13, 0, 12.0)
    harness.client.listen(INSIDE)
    harness.run(2.0)
    assert harness.client.messages(INSIDE) == []
    harness.put(104.0, 0.0)
    harness.run(0.02)
    assert harness.last(INSIDE) == {
        "header": {"seq": 101, "stamp": {"secs": 2, "nsecs": 20_000_000}, "frame_id": "IntersectionStatus"},
        "intersection_index": 13,
        "intersection_status": 1,
        "intersection_status_time": pytest.approx(1.02),
    }


@pytest.mark.parametrize("number", [13, "13", "IntTL13"])
def test_intersection_can_be_set_to_a_phase(number: object) -> None:
    harness = Crossroads.tiny()
    harness.client.listen(ALL)
    set_light(harness, "C1", 0)
    set_phase(harness, number, 1, 4.5)
    assert (ask(harness, "C1"), ask(harness, "L1")) == (("C1", 1), ("L1", 32))
    harness.run(0.02)
    heard = harness.last(ALL)
    assert heard is not None
    # The phase has 5.5 s and two of yellow.
    assert (heard["idx"], heard["state"], heard["delta_time"]) == (["IntTL13"], [1], [pytest.approx(2.98)])
    assert heard["header"]["frame_id"] == "IntscnTL"
    harness.run(1.0)
    assert ask(harness, "L1") == ("L1", 4)
    harness.run(2.0)
    assert ask(harness, "C1") == ("C1", 16)


@pytest.mark.parametrize(
    ("number", "phase", "seconds", "message"),
    [
        (5, 0, 0.0, "intersection_index: the map has no intersection 5"),
        (13, 2, 0.0, "intersection_status: intersection 13 has 2 phases, got 2"),
        (13, -1, 0.0, "intersection_status: intersection 13 has 2 phases, got -1"),
        (13, 1, 7.5, "intersection_status_time: phase 1 lasts 7.50 s, got 7.5"),
        (13, 1, -0.5, "intersection_status_time: phase 1 lasts 7.50 s, got -0.5"),
        (13, 1, math.nan, "intersection_status_time: phase 1 lasts 7.50 s, got nan"),
    ],
)
def test_unknown_phases_are_refused(number: int, phase: int, seconds: float, message: str) -> None:
    harness = Crossroads.tiny()
    before = harness.world.digest()
    with pytest.raises(FieldError, match=message):
        set_phase(harness, number, phase, seconds)
    assert harness.world.digest() == before


def test_an_intersection_without_a_schedule_has_no_phase() -> None:
    harness = Crossroads.tiny()
    with pytest.raises(FieldError, match="the map has no intersection 0"):
        Crossroads(read_scenario(b'{"mapInfo": {"mapName": "loop"}}', "x.json")).client.send(
            "/InsnControl", "morai_msgs/IntersectionControl", intersection_index=0
        )
    assert harness.world.signals.phase.tolist() == [0]


def test_all_intersections_are_published_in_one_message() -> None:
    town = Crossroads.built_in("town")
    town.client.listen(ALL)
    town.run(0.02)
    heard = town.last(ALL)
    assert heard is not None
    assert heard["idx"] == [f"IntTL{i}" for i in range(21)]
    assert heard["state"] == [i % 3 for i in range(21)], "as the scenario has them"
    assert all(0.0 < left <= 24.0 for left in heard["delta_time"])


# Determinism


def test_same_calls_give_the_same_bytes() -> None:
    def play() -> list[bytes]:
        town = Crossroads.built_in("town")
        town.client.listen(STATUS, INSIDE, ALL, "/Object_topic")
        town.run(0.2)
        set_light(town, "TL22W", 16)
        set_phase(town, 3, 1, 0.4)
        town.run(0.6)
        return town.client.raw

    first = play()
    assert len(first) == 40 * 3
    assert play() == first


def test_reset_restarts_the_lights() -> None:
    harness = Crossroads.tiny()
    before = harness.world.digest()
    set_phase(harness, 13, 0, 12.0)
    harness.run(2.0)
    set_light(harness, "C1", 0)
    harness.client.stop()
    harness.node.reset(None, 0.0)
    assert harness.world.digest() == before
