"""`/sim/spawn`, `/sim/remove`, `/sim/set` and `/sim/catalogue`: wholly done or not at all, between two frames."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.graph.topics_services import Answer
from rosbridge_sim.scenarios.catalogue import BUILT_IN, CATALOGUE, Catalogue, Model
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.egos.ego import CtrlMode
from rosbridge_sim.simulator.scene.scene_limits import MAX_EGOS
from rosbridge_sim.simulator.sim_services.object_parsing import MAX_OBJECTS, MAX_PATHS, MAX_POINTS
from rosbridge_sim.world.state.world import Body, Gear, Kind
from tests.simulator.sim_harness import ALL, Client, ManualReader, SimHarness

CAR = "2015_Kia_K5"


def values_of(answer: Answer) -> dict[str, Any]:
    assert answer.is_ok, answer.values
    assert isinstance(answer.values, Message)
    values: dict[str, Any] = json.loads(answer.values.json)
    return values


def done(client: Client, service: str, **request: object) -> dict[str, Any]:
    values = values_of(client.call(service, request))
    assert (values.pop("result"), values.pop("message")) == (True, "")
    return values


def refused(client: Client, service: str, **request: object) -> str:
    values = values_of(client.call(service, request))
    assert values["result"] is False
    assert not values.get("unique_ids")
    message: str = values["message"]
    assert client.told[-1][1] == f"{service}: {message}"
    return message


def spawn(client: Client, *objects: dict[str, Any]) -> list[int]:
    ids: list[int] = done(client, "/sim/spawn", objects=objects)["unique_ids"]
    return ids


def at(x: float, y: float, **more: float) -> dict[str, Any]:
    return {"place": {"x": x, "y": y, **more}}


def on(link: str, distance: float = 0.0, **more: float) -> dict[str, Any]:
    return {"place": {"link": link, "distance": distance, **more}}


def points(*places: tuple[float, float]) -> list[dict[str, float]]:
    return [{"x": x, "y": y, "z": 0.0} for x, y in places]


@pytest.fixture
def harness() -> SimHarness:
    """The crossing `tiny`, which stands until the master ticks."""
    return SimHarness("crossing", start="sync")


@pytest.fixture
def client(harness: SimHarness) -> Client:
    client = harness.client()
    client.start()
    return client


def row_of(harness: SimHarness, uid: int) -> int:
    return harness.world.row(uid)


# Spawn


def test_object_stands_at_its_pose_with_the_model_that_was_named(harness: SimHarness, client: Client) -> None:
    uid, other = spawn(
        client,
        {"model": "kia k5", **at(10, 20, z=1.0, heading_deg=450)},
        {"data_id": 40100004, **at(1, 2)},
    )
    world, row = harness.world, row_of(harness, uid)
    assert (world.names[row], Kind(world.kind[row])) == (CAR, Kind.VEHICLE)
    assert (world.x[row], world.y[row], world.z[row], world.speed[row]) == (10.0, 20.0, 1.0, 0.0)
    assert world.yaw[row] == pytest.approx(math.pi / 2)
    assert world.names[row_of(harness, other)] == "Barrel"
    client.tick()
    assert world.x[row] == 10.0


def test_object_on_a_link_stands_at_the_distance_along_it(harness: SimHarness, client: Client) -> None:
    roads = harness.world.roads
    link = roads.ids[0]
    uid, turned = spawn(
        client,
        {"model": "Box", **on(link, 12.0, lateral=2.0)},
        {"model": "Box", **on(link, 12.0, heading_deg=180)},
    )
    (near_point,), (yaw,) = roads.at(0, 12.0)
    world, row = harness.world, row_of(harness, uid)
    beside = (near_point[0] - 2.0 * math.sin(yaw), near_point[1] + 2.0 * math.cos(yaw))
    assert (world.x[row], world.y[row]) == pytest.approx(beside)
    assert world.yaw[row] == pytest.approx(float(yaw))
    assert math.cos(world.yaw[row_of(harness, turned)] - float(yaw)) == pytest.approx(-1.0)


def test_straight_path_and_lane_move_with_the_next_tick(harness: SimHarness, client: Client) -> None:
    link = harness.world.roads.ids[0]
    straight, walker, driver = spawn(
        client,
        {"model": CAR, **at(0, -50), "speed": 10.0},
        {"model": "Child", **at(0, 60), "speed": 1.0, "path": points((0, 60), (0, 70)), "loop": True},
        {"model": "Bus", **on(link, 20.0), "behaviour": "lane", "speed": 8.0, "desired_speed": 8.0},
    )
    world = harness.world
    assert world.has_lane[row_of(harness, driver)]
    before = float(world.arc[row_of(harness, driver)])
    client.tick()
    assert world.x[row_of(harness, straight)] == pytest.approx(0.2)
    assert world.y[row_of(harness, walker)] == pytest.approx(60.02)
    assert world.arc[row_of(harness, driver)] == pytest.approx(before + 0.16, abs=0.01)


def test_driver_follows_the_route_that_the_simulator_has_found(harness: SimHarness, client: Client) -> None:
    roads = harness.world.roads
    link = next(i for i in range(len(roads)) if len(roads.successors(i)) > 1)
    goal = roads.ids[int(roads.successors(link)[-1])]
    route = done(client, "/sim/route", start={"link": roads.ids[link]}, goal={"link": goal})["links"]
    assert route == [roads.ids[link], goal]
    (uid,) = spawn(client, {"model": CAR, **on(route[0], 5.0), "route": route})
    row = row_of(harness, uid)
    assert (harness.world.lane[row], harness.world.ahead_1[row]) == (link, roads.row(goal))
    assert harness.world.desired_speed[row] == math.inf


def test_pedestrian_stands_until_an_ego_is_near(harness: SimHarness, client: Client) -> None:
    (uid,) = spawn(client, {"model": "Man", **at(0, 500), "speed": 1.5, "start_within": 30.0})
    client.tick()
    assert harness.world.speed[row_of(harness, uid)] == 0.0
    done(client, "/sim/set", objects=[{"unique_id": 0, "set_place": True, "place": {"x": 10, "y": 500}}])
    client.tick()
    assert harness.world.speed[row_of(harness, uid)] == 1.5


def test_further_ego_has_its_model_its_topics_and_its_own_number(harness: SimHarness, client: Client) -> None:
    link = harness.world.roads.ids[0]
    index, named, uid = spawn(
        client,
        {"model": "Bus", "is_ego": True, **on(link, 10.0), "behaviour": "lane", "speed": 3.0},
        {"is_ego": True, "ego_index": 7, **at(-20, 40), "speed": 2.0},
        {"model": "Box", **at(5, 5)},
    )
    egos = harness.node.egos
    assert [ego.index for ego in egos] == [0, index, 7]
    assert harness.world.names[egos[1].row] == "Bus"
    assert harness.world.names[egos[2].row] == harness.world.names[egos.first.row]
    assert (egos[1].ctrl_mode, named) == (CtrlMode.AUTONOMOUS, 7)
    assert f"/Ego-{index}/ctrl_cmd" in harness.bus.topics
    assert uid not in {index, 7}
    before = float(harness.world.y[egos[2].row]), float(harness.world.x[egos[1].row])
    client.tick()
    assert harness.world.speed[egos[1].row] > 2.0
    assert (float(harness.world.y[egos[2].row]), float(harness.world.x[egos[1].row])) != before


def test_no_later_object_gets_the_number_of_an_ego(client: Client) -> None:
    (index,) = spawn(client, {"is_ego": True, "ego_index": 50, **at(0, 99)})
    assert index == 50
    assert min(spawn(client, *[{"model": "Box", **at(i, 0)} for i in range(3)])) > 50


def test_self_driving_ego_takes_its_route(harness: SimHarness, client: Client) -> None:
    roads = harness.world.roads
    lane = next(i for i in range(len(roads)) if len(roads.successors(i)) > 1)
    for following in roads.successors(lane).tolist():
        route = [roads.ids[lane], roads.ids[following]]
        change = {"set_place": True, **on(route[0], 3.0), "set_behaviour": True, "behaviour": "lane", "route": route}
        done(client, "/sim/set", objects=[{"unique_id": -1, **change}])
        ego = harness.node.egos.first
        assert ego.ctrl_mode is CtrlMode.AUTONOMOUS
        assert (harness.world.lane[ego.row], harness.world.ahead_1[ego.row]) == (lane, following)


BAD_SPAWNS: list[tuple[dict[str, Any], str]] = [
    ({"model": "kia k55", **at(0, 0)}, "objects[1].model: the catalogue has no model 'kia k55'"),
    ({**at(0, 0)}, "objects[1].model: expected a name of the catalogue, or a data_id"),
    ({"data_id": 12, **at(0, 0)}, "objects[1].data_id: the catalogue has no model 12"),
    ({"model": CAR, **at(2e9, 0)}, "objects[1].place.x: expected -1e+09..1e+09 m, got 2e+09"),
    ({"model": CAR, "place": {"x": None}}, "objects[1].place.x: expected -1e+09..1e+09 m, got nan"),
    ({"model": CAR, **on("nowhere")}, "objects[1].place.link: the map has no link 'nowhere'"),
    ({"model": CAR, **on("A1B1", 1e4)}, "objects[1].place.distance: expected 0.."),
    ({"model": CAR, **on("A1B1", -1)}, "objects[1].place.distance: expected 0.."),
    ({"model": CAR, **at(0, 0), "speed": 1e4}, "objects[1].speed: expected -1000..1000 m/s, got 10000"),
    (
        {"model": CAR, **at(0, 0), "behaviour": "fly"},
        "objects[1].behaviour: expected one of stand, straight, path, lane",
    ),
    ({"model": CAR, **at(0, 0), "behaviour": "stand", "speed": 1}, "objects[1].speed: expected 0 m/s with behaviour"),
    ({"model": CAR, **at(0, 0), "behaviour": "lane", "speed": -1}, "objects[1].speed: expected 0 m/s or more"),
    ({"model": "Man", **on("A1B1"), "behaviour": "lane"}, "objects[1].behaviour: only vehicles keep to lanes"),
    ({"model": CAR, **at(900, 900), "behaviour": "lane"}, "objects[1].place: expected a place within 3 m of a lane"),
    ({"model": CAR, **on("A1B1", 1, heading_deg=90), "behaviour": "lane"}, "objects[1].place.heading_deg: expected at"),
    ({"model": CAR, **on("A1B1", 1, lateral=9), "behaviour": "lane"}, "objects[1].place: expected a place within 3 m"),
    ({"model": CAR, **at(0, 0), "behaviour": "path"}, "objects[1].path: expected 2 points or more, got 0"),
    ({"model": CAR, **at(0, 0), "path": points((1, 1), (1, 1))}, "objects[1]: path: expected at least two different"),
    ({"model": CAR, **at(0, 0), "path": points((1, 1), (1e300, 1))}, "objects[1].path[1]: expected numbers within"),
    ({"model": CAR, **at(0, 0), "path": points((1, 1), (9e8, 1))}, "objects[1]: path: expected at most 1e+06 m"),
    ({"model": CAR, **on("A1B1"), "route": ["A1B1", "A1B1"]}, "objects[1].route[1]: 'A1B1' does not follow 'A1B1'"),
    ({"model": CAR, **on("A1B1"), "route": ["nope"]}, "objects[1].route[0]: the map has no link 'nope'"),
    ({"model": CAR, **at(0, 0), "loop": True}, "objects[1].loop: behaviour stand has no use for it"),
    ({"model": CAR, **at(0, 0), "desired_speed": 3}, "objects[1].desired_speed: behaviour stand has no use for it"),
    ({"model": CAR, **at(0, 0), "start_within": 3}, "objects[1].start_within: expected 0 m but for straight and path"),
    ({"model": "Box", "is_ego": True, **at(0, 0)}, "objects[1].model: expected a vehicle with an engine for an ego"),
    ({"is_ego": True, "ego_index": 1, **at(0, 0)}, "objects[1].ego_index: expected 2..1073741824 or 0, got 1"),
    ({"model": CAR, "ego_index": 5, **at(0, 0)}, "objects[1].ego_index: expected 0 without is_ego, got 5"),
    ({"is_ego": True, "ego_index": 2, **at(0, 0)}, "objects[1].ego_index: 2 is an object's number"),
    ({"is_ego": True, **at(0, 0), "path": points((0, 0), (1, 1))}, "objects[1].behaviour: an ego follows no path"),
    ({"is_ego": True, **at(900, 0), "behaviour": "lane"}, "objects[1].place: expected a place within 3 m of a lane"),
]


@pytest.mark.parametrize(("bad", "why"), BAD_SPAWNS, ids=[why for _, why in BAD_SPAWNS])
def test_one_bad_object_refuses_all_and_changes_nothing(
    harness: SimHarness, client: Client, bad: dict[str, Any], why: str
) -> None:
    before, services = harness.world.digest(), set(harness.bus.services)
    good = {"model": CAR, **on("A1B1", 2.0), "behaviour": "lane"}
    assert refused(client, "/sim/spawn", objects=[good, bad, {"is_ego": True, **at(1, 1)}]).startswith(why)
    assert (harness.world.digest(), len(harness.node.egos), set(harness.bus.services)) == (before, 1, services)
    assert spawn(client, good) == [3]  # the next number is the same, too


def test_ego_that_cannot_come_takes_away_those_that_came_before_it(harness: SimHarness, client: Client) -> None:
    before = harness.world.digest()
    egos = [{"is_ego": True, **at(30.0 * i, 0)} for i in range(MAX_EGOS)]
    assert "there are 32 egos at most" in refused(client, "/sim/spawn", objects=egos)
    assert (harness.world.digest(), [ego.index for ego in harness.node.egos]) == (before, [0])
    assert not [name for name in harness.bus.services if name.startswith("/Ego-")]


def test_sizes_of_a_call_are_bounded(harness: SimHarness, client: Client) -> None:
    box = {"model": "Box", **at(0, 0)}
    walk = {**box, "path": points((0, 0), (1, 1)), "speed": 1.0}
    long = {**box, "path": points(*((i, 0) for i in range(MAX_POINTS + 1)))}
    before = harness.world.digest()
    assert "at most 100 in one call" in refused(client, "/sim/spawn", objects=[box] * (MAX_OBJECTS + 1))
    assert "at most 20 with a path" in refused(client, "/sim/spawn", objects=[walk] * (MAX_PATHS + 1))
    assert "at most 2,000 points" in refused(client, "/sim/spawn", objects=[long])
    assert "at most 500" in refused(client, "/sim/remove", unique_ids=[1] * 501)
    assert harness.world.digest() == before
    assert len(spawn(client, *[box] * MAX_OBJECTS)) == MAX_OBJECTS
    assert spawn(client) == []


# Remove


def test_removed_objects_and_egos_are_gone_with_their_topics(harness: SimHarness, client: Client) -> None:
    index, uid = spawn(client, {"is_ego": True, **at(0, 99)}, {"model": "Box", **at(0, 0)})
    control = {"steering": 0.1}
    client.ask(f"/Ego-{index}/SyncModeCtrlCmd", frame=5, command=control)
    assert done(client, "/sim/remove", unique_ids=[uid, index]) == {}
    assert len(harness.node.egos) == 1
    assert uid not in harness.world
    assert f"/Ego-{index}/SyncModeCmd" not in harness.bus.services
    for _ in range(6):
        client.tick()
    again = spawn(client, {"is_ego": True, "ego_index": index, **at(0, 99)}, {"model": "Box", **at(0, 0)})
    assert again[0] == index
    assert again[1] > uid


@pytest.mark.parametrize(
    ("ids", "why"),
    [
        ([1, 0], "unique_ids[1]: the first ego cannot be removed"),
        ([1, -1], "unique_ids[1]: the first ego cannot be removed"),
        ([1, 99], "unique_ids[1]: there is no object 99"),
        ([1, 1], "unique_ids: an object is named twice"),
    ],
)
def test_removal_is_for_all_or_none(harness: SimHarness, client: Client, ids: list[int], why: str) -> None:
    before = harness.world.digest()
    assert refused(client, "/sim/remove", unique_ids=ids) == why
    assert harness.world.digest() == before


def test_ego_is_known_by_its_number_alone(harness: SimHarness, client: Client) -> None:
    (index,) = spawn(client, {"is_ego": True, "ego_index": 40, **at(0, 99)})
    inner = harness.node.egos[1].uid
    assert inner != index
    assert refused(client, "/sim/remove", unique_ids=[inner]) == f"unique_ids[0]: there is no object {inner}"


# Set


def change(uid: int, **fields: object) -> dict[str, object]:
    return {"unique_id": uid, **fields}


def test_change_without_flags_changes_nothing(harness: SimHarness, client: Client) -> None:
    before = harness.world.digest()
    done(client, "/sim/set", objects=[change(1, speed=9.0, behaviour="stand", gear=1)])
    assert harness.world.digest() == before


def test_place_and_speed_of_an_object_are_set(harness: SimHarness, client: Client) -> None:
    (uid,) = spawn(client, {"model": CAR, **at(0, -50), "speed": 10.0})
    done(client, "/sim/set", objects=[change(uid, set_place=True, place={"x": 100, "y": 7, "heading_deg": 90})])
    world, row = harness.world, row_of(harness, uid)
    assert (world.x[row], world.y[row], world.speed[row]) == (100.0, 7.0, 10.0)
    client.tick()
    assert world.y[row] == pytest.approx(7.2)
    done(client, "/sim/set", objects=[change(uid, set_speed=True, speed=-5.0)])
    client.tick()
    assert world.y[row] == pytest.approx(7.1)


def test_behaviour_goes_from_each_to_each(harness: SimHarness, client: Client) -> None:
    (uid,) = spawn(client, {"model": CAR, **on("A1B1", 10.0), "speed": 2.0})
    ways: dict[str, dict[str, Any]] = {
        "stand": {},
        "straight": {"set_speed": True, "speed": 2.0},
        "path": {"path": points((0, 0), (50, 0)), "set_speed": True, "speed": 2.0},
        "lane": {"set_place": True, **on("A1B1", 5.0), "set_speed": True, "speed": 2.0},
    }
    world = harness.world
    for first in ways:
        for second in ways:
            for behaviour in (first, second):
                words = {"set_behaviour": True, "behaviour": behaviour, **ways[behaviour]}
                done(client, "/sim/set", objects=[change(uid, **words)])
                row = row_of(harness, uid)
                is_so = (bool(world.has_path[row]), bool(world.has_lane[row]), float(world.speed[row]))
                speed = 0.0 if behaviour == "stand" else 2.0
                assert is_so == (behaviour == "path", behaviour == "lane", speed)
                client.tick()


def test_driver_keeps_its_lane_when_its_wish_alone_changes(harness: SimHarness, client: Client) -> None:
    (uid,) = spawn(client, {"model": CAR, **on("A1B1", 10.0), "behaviour": "lane", "speed": 5.0})
    row = row_of(harness, uid)
    before = harness.world.lane.item(row), harness.world.arc.item(row)
    done(client, "/sim/set", objects=[change(uid, set_behaviour=True, behaviour="lane", desired_speed=3.0)])
    assert (harness.world.lane.item(row), harness.world.arc.item(row)) == before
    assert (harness.world.desired_speed[row], harness.world.speed[row]) == (3.0, 5.0)


def test_ego_is_teleported_shifted_lit_and_handed_over(harness: SimHarness, client: Client) -> None:
    client.control(9, longlCmdType=1, accel=1.0)
    ego = harness.node.egos.first
    words = {"set_place": True, "place": {"x": 5, "y": 6, "heading_deg": 30}, "set_speed": True, "speed": 3.0}
    more = {"set_gear": True, "gear": 3, "set_ctrl_mode": True, "ctrl_mode": 1, "set_lamps": True, "turn_signal": 2}
    done(client, "/sim/set", objects=[change(0, **words, **more)])
    world = harness.world
    assert (world.x[ego.row], world.y[ego.row], world.speed[ego.row]) == (5.0, 6.0, 3.0)
    assert (ego.gear, ego.ctrl_mode, ego.lamps) == (Gear.NEUTRAL, CtrlMode.KEYBOARD, (2, 0))
    assert ego.status().position.x == 5.0
    for _ in range(10):
        client.tick()
    assert world.throttle[ego.row] == 0.0, "the command that waited is forgotten"


def test_ego_that_is_put_into_reverse_has_a_speed_backwards(harness: SimHarness, client: Client) -> None:
    place = {"set_place": True, "place": {"x": 10, "y": 500}, "set_gear": True, "gear": 2}
    done(client, "/sim/set", objects=[change(0, **place, set_speed=True, speed=5.0)])
    assert harness.world.speed[row_of(harness, 0)] == -5.0
    done(client, "/sim/set", objects=[change(0, set_speed=True, speed=3.0)])
    assert harness.world.speed[row_of(harness, 0)] == -3.0


BAD_CHANGES: list[tuple[dict[str, object], str]] = [
    (change(99), "objects[1].unique_id: there is no object 99"),
    (change(1, set_speed=True, speed=None), "objects[1].speed: expected -1000..1000 m/s, got nan"),
    (change(1, set_gear=True, gear=4), "objects[1]: only an ego has gear, ctrl_mode and lamps; 1 is none"),
    (change(1, set_behaviour=True), "objects[1].behaviour: expected one of stand, straight, path, lane, got none"),
    (change(1, set_speed=True, speed=-1), "objects[1]: speed: expected >= 0 on a path or a lane"),
    (change(0, set_gear=True, gear=9), "objects[1].gear: expected 1 (P), 2 (R), 3 (N) or 4 (D), got 9"),
    (change(0, set_gear=True, gear=-1), "objects[1].gear: expected 1 (P)"),
    (change(0, set_speed=True, speed=9, set_gear=True, gear=1), "objects[1].gear: gear PARK refused: the ego moves"),
    (change(0, set_speed=True, speed=-9), "objects[1]: speed: expected 0 or more in gear 4 (D), got -9 m/s"),
    (
        change(0, set_place=True, place={"x": 10, "y": 500}, set_speed=True, speed=-9),
        "objects[1]: speed: expected 0 or",
    ),
    (change(0, set_ctrl_mode=True, ctrl_mode=4), "objects[1].ctrl_mode: expected 1 (keyboard)"),
    (change(0, set_lamps=True, turn_signal=3), "objects[1].turn_signal: expected 0, 1 or 2, got 3"),
    (change(0, set_lamps=True, emergency_signal=2), "objects[1].emergency_signal: expected 0 or 1, got 2"),
    (change(0, set_behaviour=True, behaviour="stand"), "objects[1].behaviour: an ego drives by commands"),
    (
        change(0, set_behaviour=True, behaviour="lane", set_ctrl_mode=True, ctrl_mode=3),
        "objects[1].ctrl_mode: expected 6 with behaviour lane, got 3",
    ),
    (
        change(0, set_place=True, place={"x": 900}, set_ctrl_mode=True, ctrl_mode=6),
        "objects[1].ctrl_mode: ctrl_mode AUTONOMOUS refused: ego 0 stands on no lane",
    ),
    (change(2), "objects: an object is named twice"),
]


@pytest.mark.parametrize(("bad", "why"), BAD_CHANGES, ids=[why for _, why in BAD_CHANGES])
def test_one_bad_change_refuses_all_and_changes_nothing(
    harness: SimHarness, client: Client, bad: dict[str, object], why: str
) -> None:
    ego = harness.node.egos.first
    before = harness.world.digest(), ego.ctrl_mode, ego.lamps
    status = ego.status()
    good = [change(2, set_place=True, place={"x": 1}), change(0, set_lamps=True, turn_signal=1)]
    objects = [good[0], bad, good[1]][: 2 if bad["unique_id"] == 0 else 3]
    assert refused(client, "/sim/set", objects=objects).startswith(why)
    assert (harness.world.digest(), ego.ctrl_mode, ego.lamps) == before
    assert ego.status().position.x == status.position.x


# When


def test_call_within_a_frame_is_refused(harness: SimHarness, client: Client) -> None:
    answers = []

    class Listener(Client):
        def _hear(self, *_args: object) -> None:
            answers.append(values_of(self.call("/sim/spawn", {"objects": [{"model": "Box"}]})))

    Listener(harness.bus, "/listener").listen("/Ego_topic")
    num = len(harness.world)
    client.tick()
    message = "a frame is being computed; call between two ticks"
    assert [(values["result"], values["message"]) for values in answers] == [(False, message)]
    assert len(harness.world) == num


def test_call_while_a_tick_waits_for_a_scenario_is_refused() -> None:
    reader = ManualReader()
    harness = SimHarness("crossing", start="sync", reader=reader)
    client, other = harness.client(), harness.client()
    client.start()
    answers: list[Answer] = []
    load = {"request": {"file_name": "parked", "frame": 1, **ALL}}
    harness.bus.call(client, "/SyncModeScenarioLoad", load, answers.append, now=0.0)
    harness.bus.call(client, "/SyncModeWaitForTick", {"request": {"user_id": "me"}}, answers.append, now=0.0)
    assert "a tick or a /sim/step is under way" in refused(other, "/sim/remove", unique_ids=[1])
    reader.hand_over()
    assert len(answers) == 2


def test_calls_are_refused_while_a_recording_is_replayed(harness: SimHarness, client: Client) -> None:
    harness.node.scene.is_replaying = True
    before = harness.world.digest()
    for service in ("/sim/spawn", "/sim/remove", "/sim/set"):
        assert refused(client, service) == "a recording is replayed; stop it by /Morai_SimProc first"
    assert harness.world.digest() == before


def test_calls_act_at_once_in_real_time() -> None:
    harness = SimHarness()
    client = harness.client()
    harness.run(0.1)
    (uid,) = spawn(client, {"model": CAR, **at(0, -50), "speed": 10.0})
    harness.run(0.1)
    assert harness.world.x[row_of(harness, uid)] == pytest.approx(1.0)


# Catalogue


def test_catalogue_lists_all_models_with_their_figures(client: Client) -> None:
    models = values_of(client.call("/sim/catalogue", {}))["models"]
    assert [model["name"] for model in models] == [model.name for model in CATALOGUE]
    ioniq = models[0]
    assert (ioniq["kind"], ioniq["can_be_ego"], ioniq["is_own"]) == ("vehicle", True, False)
    assert (ioniq["length"], ioniq["wheelbase"], ioniq["max_steer_deg"]) == (4.47, 2.7, 36.25)
    assert next(model["data_ids"] for model in models if model["name"] == "Barrel") == [40100004]
    assert all(BUILT_IN.find(model["name"]) for model in models)


def test_models_of_the_user_come_first_and_replace_ours() -> None:
    own = Model("2015 Kia K5", Kind.VEHICLE, Body(), (20100001,), mass=1500.0)
    client = SimHarness(catalogue=Catalogue([own])).client()
    models = values_of(client.call("/sim/catalogue", {}))["models"]
    assert (models[0]["name"], models[0]["is_own"], models[0]["mass"]) == ("2015 Kia K5", True, 1500.0)
    assert CAR not in [model["name"] for model in models]
    assert len(models) == len(CATALOGUE)


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
def test_every_model_of_the_catalogue_can_be_placed(release: str) -> None:
    client = SimHarness(release=release).client()
    models = values_of(client.call("/sim/catalogue", {}))["models"]
    ids = spawn(client, *[{"model": model["name"], **at(10.0 * i, 0)} for i, model in enumerate(models)])
    egos = [{"model": model["name"], "is_ego": True, **at(0, 50)} for model in models if model["can_be_ego"]]
    assert len(ids) + len(spawn(client, *egos)) == len(models) + len(egos)


# Any calls


NUMBER = st.one_of(st.floats(-300, 300), st.sampled_from([0.0, -1.0, 1e12, None]))
PLACES = st.one_of(
    st.fixed_dictionaries({"x": NUMBER, "y": NUMBER, "heading_deg": NUMBER}),
    st.fixed_dictionaries({"link": st.sampled_from(["A1B1", "B1A1", "?"]), "distance": st.floats(-1, 60)}),
)
MOTIONS: dict[str, st.SearchStrategy[Any]] = {
    "speed": st.one_of(st.floats(-30, 30), st.sampled_from([0.0, None, 1e9])),
    "behaviour": st.sampled_from(["", "stand", "straight", "path", "lane"]),
    "path": st.lists(st.fixed_dictionaries({"x": NUMBER, "y": NUMBER, "z": st.just(0.0)}), max_size=4),
    "route": st.lists(st.sampled_from(["A1B1", "B1A1"]), max_size=2),
    "loop": st.booleans(),
    "desired_speed": st.sampled_from([0.0, 5.0, -1.0]),
}
SPAWNS = st.fixed_dictionaries(
    {"model": st.sampled_from([CAR, "Man", "Box", "?"]), "place": PLACES},
    optional={**MOTIONS, "is_ego": st.booleans(), "ego_index": st.sampled_from([0, 2, 5])},
)
FLAGS = {f"set_{name}": st.booleans() for name in ("place", "speed", "behaviour", "gear", "ctrl_mode", "lamps")}
OTHERS = {"gear": st.integers(-1, 5), "ctrl_mode": st.sampled_from([1, 3, 6, 9]), "turn_signal": st.integers(0, 3)}
CHANGES = st.fixed_dictionaries(
    {"unique_id": st.integers(-1, 8), "place": PLACES}, optional={**FLAGS, **MOTIONS, **OTHERS}
)
CALLS: st.SearchStrategy[tuple[str, dict[str, Any]]] = st.one_of(
    st.tuples(st.just("/sim/spawn"), st.fixed_dictionaries({"objects": st.lists(SPAWNS, max_size=3)})),
    st.tuples(st.just("/sim/set"), st.fixed_dictionaries({"objects": st.lists(CHANGES, max_size=3)})),
    st.tuples(st.just("/sim/remove"), st.fixed_dictionaries({"unique_ids": st.lists(st.integers(-1, 8), max_size=3)})),
    st.tuples(st.just("tick"), st.just({})),
)


def play(calls: list[tuple[str, dict[str, Any]]]) -> list[tuple[bool, str]]:
    """Whether each call was accepted, and the state of the world after it."""
    harness = SimHarness("crossing", start="sync")
    client = harness.client()
    client.start()
    story = []
    for service, request in calls:
        before = harness.world.digest()
        if service == "tick":
            client.tick()
            is_done = True
        else:
            is_done = values_of(client.call(service, request))["result"]
        after = harness.world.digest()
        assert is_done or after == before
        story.append((is_done, after))
    assert harness.node.context.failure.why is None
    assert harness.bus.guard.num_faults == 0
    return story


@pytest.mark.slow
@given(st.lists(CALLS, max_size=12))
def test_any_calls_never_break_the_world_and_repeat_to_the_bit(calls: list[tuple[str, dict[str, Any]]]) -> None:
    assert play(calls) == play(calls)


def test_egos_of_one_call_are_announced_by_one_message() -> None:
    harness = SimHarness()
    client = harness.client()
    client.listen("/tf_static")
    before = len(client.messages("/tf_static"))
    ids = spawn(client, *[{"is_ego": True, **at(30.0 * i, 0)} for i in range(5)])
    (message,) = client.messages("/tf_static")[before:]
    frames = {one["header"]["frame_id"] for one in message["transforms"]}
    assert {f"Ego-{index}/base_link" for index in ids} <= frames


def test_pedestrians_of_a_call_walk_their_paths_blindly(harness: SimHarness, client: Client) -> None:
    """So no crossings are looked for, which takes tenths of a second for long paths."""
    walk = {"model": "Man", **at(0, 0), "behaviour": "path", "path": points((0, 0), (9_000, 0), (0, 50)), "speed": 1.5}
    ids = spawn(client, *[walk] * MAX_PATHS)
    rows = [harness.world.row(uid) for uid in ids]
    assert harness.world.has_path[rows].all()
    assert not harness.world.yields[rows].any()
