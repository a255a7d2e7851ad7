"""Scenarios for the soak: good ones of every kind, and bad ones of every kind."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

BUILT_IN = ("demo", "town", "loop", "hills")

MISSING = ("nowhere", "../secret", "a/b/c", "", "x" * 1_000, "nul\0byte")
"""Names without a file."""


def _place(x: float, y: float, yaw: float = 0.0) -> dict[str, Any]:
    return {"initPositionMode": "Absolute", "pos": {"x": x, "y": y, "z": 0.0}, "rot": {"yaw": str(yaw)}}


def _on(link: str, ratio: float = 0.5) -> dict[str, Any]:
    return {"initPositionMode": "Link", "initLink": link, "initLinkRatio": ratio}


def _path(name: str, *points: tuple[float, float]) -> dict[str, Any]:
    """Return a path with waypoints in the engine's axes."""
    return {"pathName": name, "waypointData": [{"pos": {"x": -x, "y": 0.0, "z": -y}} for x, y in points]}


_EGO = {"UNIQUEID": -1, "initPosition": _place(3.0, 4.0), "gear": 4}

GOOD: dict[str, dict[str, Any]] = {
    "busy": {
        "mapInfo": {"mapName": "track"},
        "egoVehicle": _EGO,
        "vehicleList": [
            {"UNIQUEID": 10 + i, "initPosition": _place(9.0 * i, 50.0), "isWaypointMode": i % 2 == 0} for i in range(60)
        ],
        "pedestrianList": [
            {"pos": {"x": i, "y": -20.0}, "speed": 5, "movingDistance": 9, "loop": True} for i in range(20)
        ],
        "objectList": [{"UNIQUEID": 500 + i, "DataID": 40100005, "pos": {"x": i, "y": -40.0}} for i in range(40)],
        "waypointDataList": [_path(f"ObstaclePath - {10 + i}", (9.0 * i, 50.0), (9.0 * i, 150.0)) for i in range(60)],
    },
    "saved": {  # as MORAI writes: numbers twice, paths without waypoints, keys that are not read
        "version": "1.0",
        "egoVehicle": {
            **_EGO,
            "DataID": 20200012,
            "initPosition": {"initPositionMode": "Absolute", "pos": {"_x": "1,043.5", "_y": "-20.25", "_z": "0"}},
            "vehicleSaveData": {"wheels": [{}, {}, {}, {}], "engine": None},
        },
        "vehicleList": [{"DataID": 30200001, "UNIQUEID": 7, "initPosition": _place(1, 2), "velocityType": 2}],
        "spawnPointList": [{"DataID": 90100001, "m_eobstacleObjType": 5}],
        "mapInfo": {"mapName": "track", "globalCoordinateSystem": "UTM52N"},
        "waypointDataList": [{"pathName": "ObstaclePath - 7", "waypointData": []}],
        "shadedAreaList": [],
    },
    "parked": {"egoVehicle": {**_EGO, "gear": 1}, "objectList": [{"pos": {"x": 1, "y": 1}}]},
    "things": {"objectList": [{"pos": {"x": i, "y": i}} for i in range(5)]},
    "junction": {  # on whichever map is in use, but with the phases of the town
        "mapInfo": {"mapName": "town"},
        "egoVehicle": _EGO,
        "tlList": [{"index": f"IntTL{i}", "state": 1, "deltaTime": 2.5} for i in range(40)],
    },
}


def _bad(key: str, value: object) -> bytes:
    return json.dumps({**GOOD["busy"], key: value}).encode()


BAD: dict[str, bytes] = {
    "torn": b'{"egoVehicle": {"initPosition"',
    "bytes": b'{"mapInfo": {"mapName": "\xff\xfe"}}',
    "deep": b"[" * 5_000,
    "nothing": b"",
    "list": b"[]",
    "other": b'{"openapi": "3.0"}',
    "number": _bad("vehicleList", [{"initPosition": _place(1, 2), "constantVelocity": "fast"}]),
    "last_one": _bad("objectList", [{"pos": {"x": 1, "y": 2}}] * 50 + [{"pos": {"x": 1}}]),
    "no_path": _bad("pedestrianList", [{"pos": {"x": 1, "y": 2}, "pathName": "no such path"}]),
    "no_model": _bad("objectList", [{"pos": {"x": 1, "y": 2}, "modelName": "Rocket"}]),
    "no_link": _bad("vehicleList", [{"initPosition": _on("no such link")}]),
    "no_link_elsewhere": json.dumps(  # found only once the other map has been read
        {"mapInfo": {"mapName": "town"}, "egoVehicle": {"initPosition": _on("no such link")}}
    ).encode(),
    "no_map": _bad("mapInfo", {"mapName": "R_KR_Somewhere"}),
    "far": _bad("egoVehicle", {"initPosition": _place(1e300, 0)}),
}


NETWORKS: dict[str, str] = {
    "busy": """
        [publishers]
        "/CollisionData" = { name = "/bumps", rate = 10 }
        "/tf" = { on = false }
        [subscribers]
        "/ctrl_cmd" = { name = "/drive" }
        [services]
        "/Morai_TLSrv" = { on = false }
        """,
    "parked": '[publishers]\n"/Ego_topic" = { name = "/car/state" }\n',
    "things": "[publishers]\n",  # all as at the start
    "demo": "[publishers]\n",
}
"""Network settings of some scenarios; the settings that the soak itself needs do not change."""

BAD_NETWORK = "junction"
"""A scenario whose network settings have a mistake, so that it cannot be loaded with them."""


def write_networks(folder: Path) -> None:
    """Write all network settings.

    Args:
        folder: of `--data-dir`.
    """
    (folder / "Network").mkdir(parents=True)
    for name, text in {**NETWORKS, BAD_NETWORK: "[publishers]\n'/Ego_topic' = { rate = 0 }\n"}.items():
        (folder / "Network" / f"{name}.toml").write_text(text, encoding="utf-8")


def write_scenes(folder: Path) -> None:
    """Write all scenarios.

    Args:
        folder: for `--scenario-path`.
    """
    for name, document in GOOD.items():
        (folder / f"{name}.json").write_text(json.dumps(document), encoding="utf-8")
    for name, text in BAD.items():
        (folder / f"{name}.json").write_bytes(text)
