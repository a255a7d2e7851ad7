"""Frames of a client that fills the world, or changes all of it: for the attacks of `hostile.py`."""

from __future__ import annotations

from typing import Any

import orjson

from scripts.soak.soak_client import masked

PARTS = {
    f"load_{part}_data": True for part in ("network_connection", "ego_vehicle", "surrounding_vehicle", "pedestrian")
}
"""Flags of a load: the parts that it brings."""

AT_ONCE = 100
"""Objects of one call of /sim/spawn."""


def call(service: str, **args: object) -> bytes:
    """Return a call of a service.

    Args:
        args: of the call.

    Returns:
        A frame.
    """
    return masked(orjson.dumps({"op": "call_service", "service": service, "args": args}))


def loads(*names: str) -> list[bytes]:
    """Return loads of scenarios, one behind another.

    Args:
        names: of the scenarios.

    Returns:
        The frames.
    """
    return [
        call("/Service_MoraiSL", request={"file_name": name, "delete_all": True, "load_obstacle_data": True, **PARTS})
        for name in names
    ]


def load_flood() -> list[bytes]:
    """Return forty loads of five scenarios, each on another map.

    Returns:
        The frames.
    """
    return loads(*("town", "rush_hour", "loop", "roundabout", "hills") * 8)


def _spawns(num: int, spacing: float, fields: dict[str, Any]) -> list[bytes]:
    """Return calls that place objects on a grid, each this far from its neighbours [m]."""
    side = int(num**0.5) + 1
    places = [{"x": spacing * (i % side), "y": spacing * (i // side) - 2_000.0} for i in range(num)]
    objects = [{**fields, "place": place} for place in places]
    return [call("/sim/spawn", objects=objects[i : i + AT_ONCE]) for i in range(0, num, AT_ONCE)]


def egos(num: int) -> list[bytes]:
    """Return a call that adds egos, and one that resets the world.

    Args:
        num: of egos.

    Returns:
        The frames.
    """
    return [*_spawns(num, 10.0, {"is_ego": True}), call("/sim/reset")]


def egos_at_once(num: int) -> dict[str, Any]:
    """Return a call that adds egos.

    Args:
        num: of egos, at most `AT_ONCE`.

    Returns:
        Its op.
    """
    objects = [{"is_ego": True, "place": {"x": 10.0 * i, "y": 8.0}} for i in range(num)]
    return {"op": "call_service", "service": "/sim/spawn", "args": {"objects": objects}}


def people(num: int) -> list[bytes]:
    """Return calls that place pedestrians that walk, a metre apart.

    Args:
        num: of pedestrians.

    Returns:
        The frames.
    """
    return _spawns(num, 1.0, {"model": "Pedestrian", "speed": 1.0})


def snapshots() -> list[bytes]:
    """Return calls that take a snapshot with its bytes, go back to it, and ask for its hash.

    Returns:
        The frames.
    """
    return [
        call("/sim/snapshot", id="all", with_data=True),
        call("/sim/restore", id="all"),
        call("/sim/state_hash"),
    ]


def ghosts(num: int, spacing: float = 0.0) -> dict[str, Any]:
    """Return a command that places vehicles.

    Args:
        num: of vehicles.
        spacing: from one to the next, on a grid [m]; 0 for all in one place.

    Returns:
        Its op.
    """
    side = int(num**0.5) + 1
    ghosts = [
        {
            "unique_id": 100 + i,
            "name": "2016_Hyundai_Ioniq",
            "position": {"x": 30.0 + spacing * (i % side), "y": 30.0 + spacing * (i // side), "z": 0.0},
        }
        for i in range(num)
    ]
    return {"op": "publish", "topic": "/NpcGhost_Topic", "type": "morai_msgs/NpcGhostCmd", "msg": {"npc_list": ghosts}}
