"""Arguments of the client's methods for objects and roads, as requests of `/sim/spawn`, `/sim/set` and `/sim/route`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, TypeAlias, TypedDict, Unpack

from rosbridge_sim.client.frames import Frame

PathPoint: TypeAlias = Sequence[float] | Mapping[str, float]
"""x, y and perhaps z in a sequence, or by name [m]."""

RoadPoint: TypeAlias = str | tuple[str, float] | tuple[float, float] | tuple[float, float, float] | Mapping[str, object]
"""A link, or a link and the distance along it [m], or x, y [m] and perhaps a heading [deg], or a `RoadPlace`."""


class _Place(TypedDict, total=False):
    """Place of an object: x and y, or a link."""

    x: float
    y: float
    z: float
    heading_deg: float
    link: str
    distance: float
    lateral: float


class _Motion(_Place, total=False):
    """Motion of an object."""

    speed: float
    behaviour: str
    desired_speed: float
    route: Sequence[str]
    path: Sequence[PathPoint]
    loop: bool


class ObjectOptions(_Motion, total=False):
    """Keyword arguments of `spawn`: the fields of `rosbridge_sim_msgs/SpawnObject` and of its place."""

    data_id: int
    is_ego: bool
    ego_index: int
    start_within: float


class ObjectChange(_Motion, total=False):
    """Keyword arguments of `set_object`: the fields of `rosbridge_sim_msgs/ObjectState` and of its place."""

    gear: int
    ctrl_mode: int
    turn_signal: int
    emergency_signal: int


_PLACE: Final = frozenset(_Place.__annotations__)
_BEHAVIOUR: Final = ("behaviour", "desired_speed", "route", "path", "loop")
_LAMPS: Final = ("turn_signal", "emergency_signal")


def spawn_request(model: str, **options: Unpack[ObjectOptions]) -> Frame:
    """Return a `SpawnObject`.

    Raises:
        TypeError: an argument that there is not, or no place.
    """
    fields: dict[str, Any] = dict(options)
    _check_names("spawn", fields, ObjectOptions)
    return {"model": model, "place": _take_place("spawn", fields), **_with_points(fields)}


def change_request(unique_id: int, **options: Unpack[ObjectChange]) -> Frame:
    """Return an `ObjectState` whose flags say what was given.

    Raises:
        TypeError: an argument that there is not, or half of a place.
    """
    fields: dict[str, Any] = dict(options)
    _check_names("set_object", fields, ObjectChange)
    request: Frame = {"unique_id": unique_id}
    if fields.keys() & _PLACE:
        request |= {"set_place": True, "place": _take_place("set_object", fields)}
    for flag, names in (
        ("set_speed", ("speed",)),
        ("set_behaviour", _BEHAVIOUR),
        ("set_gear", ("gear",)),
        ("set_ctrl_mode", ("ctrl_mode",)),
        ("set_lamps", _LAMPS),
    ):
        if fields.keys() & set(names):
            request[flag] = True
    return {**request, **_with_points(fields)}


def place_request(place: RoadPoint) -> Frame:
    """Return a `RoadPlace`."""
    if isinstance(place, str):
        return {"link": place}
    if isinstance(place, Mapping):
        return dict(place)
    if isinstance(place[0], str):
        return {"link": place[0], "distance": place[1]}
    request: Frame = {"x": place[0], "y": place[1]}
    if len(place) > len(request):
        request |= {"use_heading": True, "heading_deg": place[-1]}
    return request


def _check_names(method: str, fields: Mapping[str, object], kind: type) -> None:
    """Refuse an argument that there is not: the server would name a field of another level."""
    known = kind.__annotations__  # with those of its bases, as a TypedDict has them
    unknown = sorted(set(fields) - set(known))
    if unknown:
        raise TypeError(f"{method}: expected no argument {unknown[0]!r}; there are {', '.join(sorted(known))}")


def _take_place(method: str, fields: dict[str, Any]) -> Frame:
    """Take the place out of the fields."""
    place = {name: fields.pop(name) for name in sorted(_PLACE & fields.keys())}
    if not place.get("link") and not {"x", "y"} <= place.keys():
        raise TypeError(f"{method}: expected x and y, or link, for the place; got {', '.join(place) or 'neither'}")
    return place


def _with_points(fields: dict[str, Any]) -> dict[str, Any]:
    if "path" in fields:
        fields["path"] = [
            dict(point) if isinstance(point, Mapping) else dict(zip("xyz", map(float, point), strict=False))
            for point in fields["path"]
        ]
    if "route" in fields:
        fields["route"] = list(fields["route"])
    return fields
