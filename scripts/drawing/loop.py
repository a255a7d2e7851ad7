"""The motorway map `loop`: three one-way lanes on a winding loop, and the scenario `loop` on it."""

from __future__ import annotations

import math
from typing import Any

from scripts.drawing.mgeo import LANE, MapFiles, init, json_lines
from scripts.drawing.section import Section, bend, lay, straight

OFFSETS = (LANE, 0.0, -LANE)  # lane 1 is the innermost, as everywhere [m]
STEP, STRAIGHT_STEP = 1.0, 50.0  # between points of a lane, in bends and on straights [m]
BORDER_STEP = 8.0  # of its edges [m]; on the tightest bend the chord leaves the arc by 3 cm
LIMIT = 100  # [km/h]


def loop() -> list[Section]:
    """Return the sections of the middle lane, 5.1 km.

    At 100 km/h the lateral acceleration on a radius of 350 m is 2.2 m/s^2.

    Returns:
        The sections, in order.
    """
    way = [
        straight(1000, LIMIT),  # 0 start
        bend(400, 90, LIMIT),
        straight(150, LIMIT),
        bend(350, 90, LIMIT),
        straight(120, LIMIT),
        bend(350, -50, LIMIT),  # 5 the S
        bend(350, 50, LIMIT),
        straight(0, LIMIT),  # 7 to the west
        bend(400, 90, LIMIT),
        straight(0, LIMIT),  # 9 to the south
        bend(400, 90, LIMIT),
    ]
    return lay(way, to_west=7, to_south=9)


def loop_files() -> dict[str, bytes]:
    """Return the map.

    Returns:
        File name -> content, in MGeo format.
    """
    sections = loop()
    files = MapFiles(350000.0, 4140000.0, digits=4)
    for i, section in enumerate(sections):
        for border, kind in enumerate(("edge", "lane", "lane", "edge")):
            offset = (1.5 - border) * LANE
            files.border(
                f"B{border}_{i:02}", kind, section.points(offset, BORDER_STEP if section.curvature else math.inf)
            )
        for lane, offset in enumerate(OFFSETS, start=1):
            files.node(f"N{lane}_{i:02}", section.at(0.0, offset))
            files.link(
                f"L{lane}_{i:02}",
                f"N{lane}_{i:02}",
                f"N{lane}_{(i + 1) % len(sections):02}",
                section.points(offset, STEP if section.curvature else STRAIGHT_STEP),
                section.max_speed_kmh,
                left_lane_change_dst_link_idx=f"L{lane - 1}_{i:02}" if lane > 1 else None,
                right_lane_change_dst_link_idx=f"L{lane + 1}_{i:02}" if lane < len(OFFSETS) else None,
                road_id=str(i),
                ego_lane=lane,
                lane_mark_left=[f"B{lane - 1}_{i:02}"],
                lane_mark_right=[f"B{lane}_{i:02}"],
            )
    return files.files()


NPCS: tuple[tuple[str, int, int, float, int | None], ...] = (  # model, lane, section, how far along it, km/h
    ("2020_Kia_Stinger", 1, 0, 0.55, None),
    ("2016_Genesis_DH", 1, 1, 0.40, None),
    ("2021_VW_Golf_GTI", 1, 3, 0.20, None),
    ("2015_Kia_K5", 1, 5, 0.50, None),
    ("2016_Hyundai_Ioniq", 1, 7, 0.30, None),
    ("2020_Kia_Stinger", 1, 9, 0.60, None),
    ("2016_Kia_Niro(HEV)", 2, 0, 0.45, 90),
    ("Hyundai_Ioniq_5", 2, 0, 0.75, 90),
    ("2014_Kia_K7", 2, 1, 0.60, 85),
    ("2015_Kia_K5", 2, 3, 0.70, 85),
    ("Van", 2, 6, 0.50, 80),
    ("2021_VW_Golf_GTI", 2, 7, 0.80, 90),
    ("2016_Hyundai_Ioniq", 2, 9, 0.20, 90),
    ("Truck", 3, 0, 0.40, 70),
    ("Bus", 3, 1, 0.20, 75),
    ("Truck", 3, 1, 0.70, 70),
    ("Van", 3, 3, 0.50, 75),
    ("Truck", 3, 5, 0.20, 70),
    ("Bus", 3, 7, 0.50, 75),
    ("Truck", 3, 9, 0.80, 70),
)


def loop_scenario() -> bytes:
    """Return the scenario: the ego on the right lane, faster traffic to its left, trucks in front and behind."""
    sections = loop()
    vehicles: list[dict[str, Any]] = []
    for uid, (model, lane, i, part, speed) in enumerate(NPCS, start=1):
        section = sections[i]
        x, y = section.at(section.length * part, OFFSETS[lane - 1])
        yaw = math.degrees(math.remainder(section.yaw + section.curvature * section.length * part, math.tau))
        at_link = {"initPositionMode": "Link", "initLink": f"L{lane}_{i:02}", "initLinkRatio": part}
        vehicles.append(
            {
                "UNIQUEID": uid,
                "modelName": model,
                "initPosition": {**init(x, y, yaw), **at_link},
                "velocityType": 1 if speed is None else 2,
                "constantVelocity": speed or LIMIT,
                "currentVelocity": 70,
                "isWaypointMode": False,
            }
        )
    document = {
        "mapInfo": {"mapName": "loop"},
        "egoVehicle": {
            "UNIQUEID": -1,
            "modelName": "2016_Hyundai_Ioniq",
            "initPosition": init(60.0, OFFSETS[2], 0.0),
            "gear": 4,
        },
        "vehicleList": vehicles,
    }
    return json_lines(document)
