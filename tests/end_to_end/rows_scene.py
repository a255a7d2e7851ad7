"""Rows: other objects, collisions and scenarios."""

from __future__ import annotations

from pathlib import Path

import pyproj
import pytest

from tests.end_to_end.table_rows import SceneClient, Table

__all__ = ["TABLE"]

TABLE = Table()

WHOLE = {
    "delete_all": True,
    "load_network_connection_data": False,
    "load_ego_vehicle_data": True,
    "load_surrounding_vehicle_data": True,
    "load_pedestrian_data": True,
    "load_obstacle_data": True,
    "set_pause": False,
}


def write_networks(data: Path) -> None:
    """Network settings for two scenarios: one renames a topic, the other leaves all as at the start."""
    folder = data / "Network"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "elsewhere.toml").write_text('[publishers]\n"/imu" = { name = "/inertia" }\n')
    (folder / "page.toml").write_text("")


async def _topics(play: SceneClient) -> set[str]:
    return set((await play.client.values("/rosapi/topics"))["topics"])


@TABLE.row(
    "/Object_topic",
    done="a second goes by: a car drives straight on at 36 km/h, somebody walks, a barrier stands",
    seen="all of them by kind, as many as the counts say, each moving as its velocity says, with sizes of their models",
)
async def _(play: SceneClient) -> None:
    await play.listen("/Object_topic")
    before = await play.objects()
    await play.tick(1.0)
    said = play.last("/Object_topic")
    lists = ("npc_list", "pedestrian_list", "obstacle_list")
    assert [len(said[name]) for name in lists] == [3, 1, 1]
    assert [said[f"num_of_{name}"] for name in ("npcs", "pedestrian", "obstacle")] == [3, 1, 1]
    assert [{one["type"] for one in said[name]} for name in lists] == [{1}, {0}, {2}]
    assert said["header"]["frame_id"] == "ObjectInfo"
    after = {one["unique_id"]: one for name in lists for one in said[name]}
    car, walker, barrier = after[7], after[12], after[15]
    assert (car["name"], car["velocity"]["x"], car["heading"]) == ("2015_Kia_K5", pytest.approx(36.0), 0.0)
    assert car["position"]["x"] - before[7]["position"]["x"] == pytest.approx(10.0)
    assert [car["size"][axis] for axis in "xyz"] == [1.835, 4.845, 1.475], "width, length, height in this profile"
    assert (walker["velocity"]["x"], walker["heading"]) == (pytest.approx(5.4), pytest.approx(90.0))
    assert walker["position"]["y"] - before[12]["position"]["y"] == pytest.approx(1.5)
    assert barrier["position"] == before[15]["position"]


@TABLE.row(
    "/VehicleCollisionData",
    done="a car drives into a bus that stands in its way",
    seen="nothing before; from then on the pair of them",
)
async def _(play: SceneClient) -> None:
    await play.lead(500)
    await play.listen("/VehicleCollisionData")
    await play.tick(2.0)
    assert all(data["collisions"] == [] for data in play.heard("/VehicleCollisionData"))
    await play.tick(2.0)
    (crash,) = play.last("/VehicleCollisionData")["collisions"]
    assert {car["unique_id"] for car in crash["crashed_vehicles"]} == {7, 8}
    assert {car["name"] for car in crash["crashed_vehicles"]} == {"2015_Kia_K5", "Bus"}
    assert play.last("/VehicleCollisionData")["header"]["frame_id"] == "VehicleCollisionData"


@TABLE.row(
    "/Service_MoraiSL",
    done="a scenario is loaded: its obstacles alone, all of it with a pause, its network settings; then none",
    seen="objects and ego are the new ones, nobody moves, /imu is renamed; a wrong name is false and does nothing",
)
async def _(play: SceneClient) -> None:
    await play.listen("/Object_topic")
    before = await play.objects()
    only = dict.fromkeys(WHOLE, False) | {"load_object_data": True}  # the manual's name of it
    del only["load_obstacle_data"]
    assert (await play.ask("/Service_MoraiSL", file_name="elsewhere", **only))["result"] is True
    after = await play.objects()
    (new,) = after.keys() - before.keys()
    assert (after[new]["type"], after[new]["position"]["x"], len(after)) == (2, 80.0, len(before) + 1)

    answer = await play.ask("/Service_MoraiSL", file_name="elsewhere", **(WHOLE | {"set_pause": True}))
    assert answer["result"] is True
    tick = await play.ask("/SyncModeWaitForTick", user_id="reader", frame=0)
    assert (tick["tick_status"], tick["pause_status"]) == (False, True)
    assert tick["vehicle_status"]["position"] == {"x": -5.25, "y": 60.0, "z": 0.0}
    event = await play.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    assert event["gear"] == 1
    kinds = [one["type"] for one in (await play.objects()).values()]
    assert sorted(kinds) == [0, 0, 1, 2]
    assert (await play.ask("/Service_MoraiVehicleSpec", unique_id=0))["wheel_base"] == 3.0, "the new ego's model"

    assert (await play.ask("/Service_MoraiSL", file_name="nowhere", **WHOLE))["result"] is False
    assert len(await play.objects()) == 4

    write_networks(play.data)
    only = dict.fromkeys(WHOLE, False) | {"load_network_connection_data": True}
    for name, topic, gone in (("elsewhere", "/inertia", "/imu"), ("page", "/imu", "/inertia")):
        assert (await play.ask("/Service_MoraiSL", file_name=name, **only))["result"] is True
        assert (topic in await _topics(play), gone in await _topics(play)) == (True, False)


@TABLE.row(
    "/Service_MoraiMapSpec",
    done="scenarios on two maps are loaded, one after the other",
    seen="zone and origin of either map: with them the fix of /gps is the place that /Ego_topic tells",
)
async def _(play: SceneClient) -> None:
    await play.listen("/gps", "/Ego_topic")
    origins = []
    for name in ("page", "motorway"):
        assert (await play.ask("/Service_MoraiSL", file_name=name, **WHOLE))["result"] is True
        await play.put(120.0, 340.0)
        await play.tick()
        spec = await play.ask("/Service_MoraiMapSpec", load_map_data=True)
        assert (spec["plane_coordinate_system"], spec["ellipse"]) == (0, "WGS84")
        project = pyproj.Proj(proj="utm", zone=spec["utm_num"], ellps=spec["ellipse"])
        fix, place, origin = play.last("/gps"), play.last("/Ego_topic")["position"], spec["utm_offset"]
        east, north = project(fix["longitude"], fix["latitude"])
        assert (east - origin["x"], north - origin["y"]) == pytest.approx((place["x"], place["y"]), abs=1e-3)
        origins.append(origin)
    assert origins[0] != origins[1]


@TABLE.row(
    "/ScenarioLoad",
    done="the same scenario is loaded by a topic: without its walkers, onto what is there; then all of it with a pause",
    seen="/Object_topic and the ego are the new ones, nobody moves; a wrong name is told and changes nothing",
)
async def _(play: SceneClient) -> None:
    await play.listen("/Object_topic")
    before = await play.objects()
    some = WHOLE | {"delete_all": False, "load_pedestrian_data": False, "load_ego_vehicle_data": False}
    await play.send("/ScenarioLoad", file_name="elsewhere", **some)
    new = {uid: one for uid, one in (await play.objects()).items() if uid not in before}
    assert sorted(one["type"] for one in new.values()) == [1, 2]
    assert (await play.tick())["position"]["x"] == -86.0

    await play.send("/ScenarioLoad", file_name="elsewhere", **(WHOLE | {"set_pause": True}))
    tick = await play.ask("/SyncModeWaitForTick", user_id="reader", frame=0)
    assert (tick["tick_status"], tick["pause_status"]) == (False, True)
    assert tick["vehicle_status"]["position"]["y"] == 60.0
    await play.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    assert sorted(one["type"] for one in (await play.objects()).values()) == [0, 0, 1, 2]
    await play.send_badly("/ScenarioLoad", "nowhere", file_name="nowhere", **WHOLE)
    assert len(await play.objects()) == 4
