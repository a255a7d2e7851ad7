"""Scenario files and a map in the shape that MORAI saves them in, made from numbers of our own.

What the shape is made of: objects in waypoint mode whose waypoint lists are empty, texts beside numbers, angles beyond
a turn, `gear` within `initPosition`, models of which only the number is known, `tlList` by position, generators and
areas that nothing here makes use of yet. Two forms are known: the full one, and one that was edited by hand, where keys
are missing and others are new.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tests.simulator.small_maps import ROADRUNNER, Files

__all__ = ["CONTROLLERS", "MAP", "MAP_NAME", "edited_scenario", "saved_scenario"]

Json = dict[str, Any]

MAP_NAME = "R_KR_OURS_Ring"

CONTROLLERS = ("IntTL1", "IntTL2", "IntTL4", "IntTL5")
"""The map's, with a gap in their numbers: a position is no number."""


def _text(value: float) -> str:
    return f"{value:,.3f}"


def _pos(x: float, y: float, z: float = 0.0) -> Json:
    return {"x": x, "y": y, "z": z, "_x": _text(x), "_y": _text(y), "_z": _text(z)}


def _rot(yaw: float, roll: float = 0.0, pitch: float = 0.0) -> Json:
    return {"roll": _text(roll), "pitch": _text(pitch), "yaw": _text(yaw)}


def _init(x: float, y: float, yaw: float, gear: int, *, roll: float = 0.0, pitch: float = 0.0) -> Json:
    return {
        "initPositionMode": "Absolute",
        "pos": _pos(x, y),
        "rot": _rot(yaw, roll, pitch),
        "initLink": "",
        "initLinkRatio": 0.0,
        "gear": gear,
    }


def _link(name: str, point: int = 0) -> Json:
    return {"linkIdx": name, "pointIdx": point}


def _ego() -> Json:
    return {
        "DataID": 20200003,
        "UNIQUEID": -1,
        "m_eobstacleObjType": 0,
        "initPosition": _init(20.0, 3.5, -358.491, 1, roll=0.25, pitch=-359.5),
        "vehicleSaveData": {
            "velocity": 0.0,
            "inputData": [0, 0, 0, 0],
            "vehicle": {"time": 3.5, "lastVelocity": {"x": 0.0, "y": 0.0, "z": 0.0}, "lastImpactTime": -1.0},
            "wheels": [{}, {}, {}, {}],
            "engine": {"rpm": 800.0},
            "gearbox": {"gear": 0},
        },
        "currentVelocity": 0.0,
        "desiredVelocityType": 1,
        "linkValue": 100.0,
        "customValue": 0.0,
        "beforeControlMode": 3,
        "currentControlMode": 3,
        "v2vUDPSessionInfo": {"myIPAddress": "127.0.0.1", "myPort": "7,000"},
    }


def _vehicle(uid: int, data_id: int, place: tuple[float, float], now_kmh: float, wish_kmh: float) -> Json:
    return {
        "DataID": data_id,
        "UNIQUEID": uid,
        "m_eobstacleObjType": 1,
        "initPosition": _init(*place, 0.0, 4),
        "velocityType": 2,
        "linkVelocity": 60.0,
        "constantVelocity": 0.0,
        "desiredVelocity": wish_kmh,
        "currentVelocity": now_kmh,
        "viewCurrentVelocity": now_kmh,
        "isCloseLoop": False,
        "isLaneChange": True,
        "isEgo": False,
        "spawnPointUniqueID": 60,
        "destinationUniqueID": 61,
        "startPointLinkInfo": _link("A1B1"),
        "endPointLinkInfo": _link("B1C1", 12),
        "currentLinkInfo": _link("A1B1", 7),
        "loopStartLinkInfo": _link(""),
        "latBiasMode": 2,
        "latBias": "-0.125",
        "isWaypointMode": False,
        "destinationMode": 1,
        "vehicleModelType": 257,
    }


def _objects(num: int) -> Iterator[Json]:
    """Things beside the road; two of three are in waypoint mode, and none of them has a waypoint."""
    for i in range(num):
        yield {
            "DataID": (40100003, 40100019, 40100005)[i % 3],
            "UNIQUEID": 10 + i + i // 7,  # with gaps
            "m_eobstacleObjType": 4,
            "pos": _pos(3.0 * i, -8.0 - 2.0 * (i % 2)),
            "rot": _rot(-400.0 - 37.5 * i, roll=90.0 if i == 2 else 0.0),
            "scale": {"x": 1.0, "y": 1.0, "z": 1.0} if i else {"x": 2.0, "y": 0.5, "z": 3.0},
            "initPos": _pos(3.0 * i, -8.0),
            "initRot": _rot(0.0),
            "isWaypointMode": i % 3 != 2,
            "moveSpeed": 0,
            "activeDistance": 0.0,
            "waypointEventList": [],
        }


def _pedestrian(uid: int, active_distance: float) -> Json:
    return {
        "DataID": 50100007,
        "UNIQUEID": uid,
        "m_eobstacleObjType": 2,
        "pos": _pos(60.0, -3.0),
        "rot": _rot(450.0),
        "initPos": _pos(60.0, -3.0),
        "initRot": _rot(450.0),
        "speed": 5.4,
        "active": False,
        "activeDistance": active_distance,
        "loop": False,
        "movingDistance": 9.0,
        "movingDistanceAmount": 0.0,
        "standardPos": _pos(60.0, -3.0),
        "pedestrianBehavior": 0,
        "pedestrianType": 0,
        "listObjIDForBehavior": [],
        "isWaypointMode": False,
        "waypointEventList": [],
    }


def _generator(uid: int) -> Json:
    return {
        "DataID": 90100001,
        "UNIQUEID": uid,
        "m_eobstacleObjType": 5,
        "pos": _pos(0.0, 0.0),
        "rot": _rot(0.0),
        "scale": {"x": 1.0, "y": 1.0, "z": 1.0},
        "spawnVehicleTypeID": 30200006,
        "listVehicleLengthType": [2, 3],
        "isCloseLoop": False,
        "isLaneChange": True,
        "maximumSpawnVehicle": 5,
        "minSpawnPeriod": 5.0,
        "maxSpawnPeriod": 10.0,
        "SpawnVelocityType": 2,
        "MinSpawnVelocity_Custom": 0.0,
        "MaxSpawnVelocity_Custom": 15.0,
        "DesiredVelocityType": 2,
        "MinDesiredVelocity_Custom": 40.0,
        "MaxDesiredVelocity_Custom": 60.0,
        "isSpawning": True,
        "waitSpawnTime": 2.25,
        "spawnedVehiclesCount": 1,
        "destinationObjUniqueID": uid + 1,
        "startLinkInfo": _link("A1B1"),
        "endLinkInfo": _link("B1C1"),
        "latBiasMode": 2,
        "MinLatBias": -0.25,
        "MaxLatBias": 0.25,
        "DestinationMode": 1,
        "NPCSpawnType": 1,
        "SafetyDist": 5.0,
        "TTC": 1.0,
        "sPAWNPOINT_SETTING_MODE": 0,
        "rANDOMPOINT_LIFE_MODE": 0,
    }


def saved_scenario(num_objects: int = 30) -> Json:
    """A scenario as it is saved: every list is there, every thing that ever had a path has an empty one."""
    objects = list(_objects(num_objects))
    vehicles = [
        _vehicle(80, 30200005, (40.0, 0.0), 36.0, 50.0),
        _vehicle(81, 30200006, (70.0, 0.0), 30.0, 50.0),
        _vehicle(82, 30200007, (60.0, 3.5), 0.0, 40.0),
    ]
    everybody = [*objects, *vehicles]
    return {
        "version": "1.0",
        "egoVehicle": _ego(),
        "vehicleList": vehicles,
        "pedestrianList": [_pedestrian(90, 30.0)],
        "objectList": objects,
        "spawnPointList": [_generator(60 + 2 * i) for i in range(5)],
        "tlList": [{"index": str(i), "state": i % 3, "deltaTime": 1.5} for i in range(len(CONTROLLERS))],
        "mapInfo": {
            "mapName": MAP_NAME,
            "eastOffset": 300000.0,
            "northOffset": 4000000.0,
            "globalCoordinateSystem": "UTM52N",
            "scenarioCoordinateSystem": "ENU",
        },
        "waypointDataList": [{"pathName": f"ObstaclePath - {one['UNIQUEID']}", "waypointData": []} for one in everybody]
        + [{"pathName": "ObstaclePath - 999", "waypointData": []}],
        "shadedAreaList": [{"UNIQUEID": 70, "pos": _pos(5.0, 5.0), "scale": {"x": 10.0, "y": 1.0, "z": 10.0}}],
        "frictionChangeMaterialList": [{"UNIQUEID": 71, "pos": _pos(9.0, 5.0), "friction": 0.25}],
        "v2IInfo": [],
        "pedspawnPointList": [],
        "aiPedstrianList": [],
    }


def edited_scenario() -> Json:
    """The other form: no waypoints at all, no word of waypoint mode, parking lots, positions of lights as numbers."""
    scenario = saved_scenario(6)
    for part in ("waypointDataList", "v2IInfo", "aiPedstrianList", "pedspawnPointList"):
        del scenario[part]
    for item in [*scenario["vehicleList"], *scenario["objectList"], *scenario["pedestrianList"]]:
        del item["isWaypointMode"]
    ego = scenario["egoVehicle"]
    ego["gear"] = ego["initPosition"].pop("gear")
    scenario["tlList"] = [{"index": i, "state": 0, "deltaTime": 0} for i in range(len(CONTROLLERS))]
    scenario["parkingLotStart"] = {"idx": 3}
    scenario["parkingLotGoal"] = {"idx": 4}
    scenario["somethingNew"] = [1, 2, 3]
    return scenario


def _schedule(name: str) -> Json:
    phases = [
        {"duration": 30, "lightcolor": ["SG", "R", "R"]},
        {"duration": 15, "lightcolor": ["R", "GLeft", "R"]},
        {"duration": 20, "lightcolor": ["R", "R", "R"]},
    ]
    return {"idx": name, "TLState": phases, "yelloduration": [5, 3, 3], "PSState": []}


MAP: Files = {
    **ROADRUNNER,
    "intersection_controller_set.json": [
        {"idx": CONTROLLERS[0], "TL": [["C1", "C2"], ["L1"], ["P1"]]},
        *({"idx": name, "TL": [[], [], []]} for name in CONTROLLERS[1:]),
    ],
    "intersection_controller_state.json": [_schedule(name) for name in CONTROLLERS],
}
"""A small map with as many intersections as the scenarios have states for."""
