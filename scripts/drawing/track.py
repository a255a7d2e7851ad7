"""The test track map `track`: a closed loop of two lanes with one crosswalk, and the scenario `demo` on it."""

from __future__ import annotations

import math
from typing import Any

from rosbridge_sim.scenarios.catalogue import find_model
from scripts.drawing.mgeo import LANE, MapFiles, engine_waypoints, init, json_lines, pose
from scripts.drawing.section import Section, bend, lay, straight

INNER, OUTER = 0.5 * LANE, -0.5 * LANE  # the two lanes' lines, left of the reference line between them [m]
CROSSING = 11  # the section with the crosswalk
WALK = (3.0, 6.0)  # where it lies along that section [m]
STEP = 1.0  # between points of a lane [m]; on the tightest bend the chord leaves the arc by 3 mm


def track() -> list[Section]:
    """Return the sections of the loop, 1.19 km. At 40 km/h the lateral acceleration on a radius of 40 m is 3 m/s^2.

    Returns:
        The sections, in order.
    """
    way = [
        straight(300, 60),  # 0 start
        bend(60, 90, 40),
        straight(90, 60),
        bend(40, 90, 40),
        straight(60, 60),
        bend(45, -60, 40),  # 5 the S
        bend(45, 60, 40),
        straight(0, 60),  # 7 to the west
        bend(50, 90, 40),
        straight(0, 60),  # 9 to the south
        bend(60, 80, 40),
        bend(60, 10, 40),  # 11 with the crosswalk: a link of its own, as an intersection is
    ]
    return lay(way, to_west=7, to_south=9)


def track_files() -> dict[str, bytes]:
    """Return the map.

    Returns:
        File name -> content, in MGeo format.
    """
    sections = track()
    files = MapFiles(330000.0, 4120000.0)  # a place in zone 52 with round numbers
    for lane, offset in enumerate((INNER, OUTER), start=1):
        for i, section in enumerate(sections):
            files.node(_node(lane, i), section.at(0.0, offset), is_stop=i == CROSSING)
            other = f"L{3 - lane}_{i:02}"
            files.link(
                f"L{lane}_{i:02}",
                _node(lane, i),
                _node(lane, (i + 1) % len(sections)),
                section.points(offset, STEP),
                section.max_speed_kmh,
                left_lane_change_dst_link_idx=other if lane == 2 else None,
                right_lane_change_dst_link_idx=other if lane == 1 else None,
                road_id=str(i),
                ego_lane=lane,
                related_signal="straight" if i == CROSSING else None,
            )
    _crosswalk(files, sections[CROSSING])
    return files.files()


def _crosswalk(files: MapFiles, section: Section) -> None:
    """Add the crosswalk before the start straight, its lights, and those of the cars before it."""
    near, far = WALK
    links = [f"L{lane}_{CROSSING:02}" for lane in (1, 2)]
    heading = math.degrees(section.yaw)
    car = files.light("TL0", links, section.at(far + 2.0), heading + 180.0, ("red", "yellow", "straight"))
    middle = 0.5 * (near + far)
    walkers = [
        files.light(f"PS{i}", [], section.at(middle, side * (LANE + 0.7)), heading - 90.0 * side, None)
        for i, side in enumerate((1.0, -1.0), start=1)
    ]
    corners = [section.at(s, side * LANE) for s, side in ((near, -1), (far, -1), (far, 1), (near, 1))]
    files.crosswalk("CW0", corners, walkers)
    for lights in ([car], walkers):
        files.group("IntTL0", lights)
    files.controllers.append({"idx": "IntTL0", "TL": [[car], walkers]})
    green, red = ({"duration": time, "lightcolor": [colour, "R"]} for time, colour in ((20, "SG"), (14, "R")))
    walk = [1, 1, 1, 6, 6]  # phase, group, seconds before the green, green, flashing
    files.schedules.append({"idx": "IntTL0", "TLState": [green, red], "yelloduration": [3, 3], "PSState": [walk]})


def _node(lane: int, i: int) -> str:
    return f"N{lane}_{i:02}"


SPEED_KMH = 30  # that all NPCs want
NPCS = (  # model, metres along the inner lane
    ("2015_Kia_K5", 75.0),
    ("Van", 300.0),
    ("2021_VW_Golf_GTI", 525.0),
    ("Bus", 760.0),
    ("2016_Kia_Niro(HEV)", 1010.0),
)
WALKS = (  # model, km/h, where it turns on the outside and on the inside of the loop, metres along the start straight
    # The ego stands at 40 and the drives of the documentation leave the track to the left from 60 on.
    ("Man", 5.0, 34.0, 46.0),
    ("Woman", 4.6, 50.0, 28.0),
    ("Child", 4.0, 22.0, 52.0),
    ("Pedestrian", 5.4, 44.0, 20.0),
)
KERB = LANE + 2.2  # where people walk, from the middle of the road [m]
THINGS = (  # model, x, y, heading: none on a lane, whose edges lie at -3.5 and 3.5
    ("Traffic_Cone", 90.0, -4.2, 0.0),
    ("Traffic_Cone", 95.0, -4.2, 0.0),
    ("Traffic_Cone", 100.0, -4.2, 0.0),
    ("Barrel", 120.0, -4.6, 0.0),
    ("Barrel", 122.0, -4.6, 0.0),
    ("Wooden_Box", 170.0, -5.0, 20.0),
    ("Cargo_Box", 60.0, 5.0, 90.0),
    ("Box", 62.0, 4.8, 35.0),
)


def demo_scenario() -> bytes:
    """Return the scenario: an ego in the free outer lane, drivers in the inner one, people who cross, things beside it.

    Returns:
        The document.
    """
    sections = track()
    ids = iter(range(1, 1000))
    vehicles = []
    for model, s in NPCS:
        (x, y), yaw = _along(sections, s, INNER)
        vehicles.append(
            {
                "UNIQUEID": next(ids),
                "modelName": model,
                "initPosition": {**init(x, y, yaw), **_at_link(sections, s)},
                "velocityType": 2,
                "constantVelocity": SPEED_KMH,
                "currentVelocity": SPEED_KMH,
                "isWaypointMode": False,
                "isLaneChange": False,  # the outer lane is the ego's
            }
        )
    people, paths = [], []
    for i, (model, speed, outside, inside) in enumerate(WALKS):
        uid = next(ids)
        right, left = (sections[CROSSING].at(0.5 * sum(WALK), side * KERB) for side in (-1.0, 1.0))
        line = [(outside, -KERB), right, left, (inside, KERB), left, right]  # there and back
        start = ((0.5 * outside, -KERB), (3.0 * i, KERB))[i % 2]
        who = {"UNIQUEID": uid, "modelName": model, **pose(*start, 180.0)}
        people.append({**who, "speed": speed, "loop": True, "yields": True})
        paths.append({"pathName": f"PedPath - {uid}", "waypointData": list(engine_waypoints(line))})
    things = []
    for model, x, y, yaw in THINGS:
        entry = find_model(model)
        if entry is None or not entry.data_ids:
            raise AssertionError(f"{model} has no DataID")
        things.append({"UNIQUEID": next(ids), "DataID": entry.data_ids[0], **pose(x, y, yaw)})
    document = {
        "mapInfo": {"mapName": "track"},
        "egoVehicle": {
            "UNIQUEID": -1,
            "modelName": "2016_Hyundai_Ioniq",
            "initPosition": init(40.0, OUTER, 0.0),
            "gear": 4,
        },
        "vehicleList": vehicles,
        "pedestrianList": people,
        "objectList": things,
        "waypointDataList": paths,
    }
    return json_lines(document)


def _along(sections: list[Section], s: float, offset: float) -> tuple[tuple[float, float], float]:
    """Return the point at an arc length along a lane, and its heading [deg]."""
    for section in sections:
        scale = 1.0 - offset * section.curvature
        if s <= section.length * scale:
            yaw = section.yaw + section.curvature * s / scale
            return section.at(s / scale, offset), math.degrees(math.remainder(yaw, math.tau))
        s -= section.length * scale
    raise AssertionError("beyond the lane's end")


def _at_link(sections: list[Section], s: float) -> dict[str, Any]:
    """Return the place on a link of the inner lane, at an arc length along the lane."""
    for i, section in enumerate(sections):
        length = section.length * (1.0 - INNER * section.curvature)
        if s <= length:
            return {"initPositionMode": "Link", "initLink": f"L1_{i:02}", "initLinkRatio": round(s / length, 4)}
        s -= length
    raise AssertionError("beyond the lane's end")
