"""Other names of the simulator's topics and services, so that a client's patterns cover them (`graph/policy.py`).

One topic or service has several names for three reasons:

- MORAI has two names for it, or a topic and a service, or a topic in one release and a service in another.
- The network settings give it another name. A client that may load a scenario may bring such settings. Its default
  name stays in the table, so a pattern still holds.
- A further ego has it under its prefix. A pattern for `/ctrl_cmd` holds for `/Ego-2/ctrl_cmd` too, but not the
  reverse: a pattern with the prefix means only that ego.

A topic or service that only has the *same effect* is not another name, for example control by topic and by service.
Many patterns mean one of them on purpose. The log at the start lists which of them the patterns leave open.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Final

from rosbridge_sim.graph.ways import PolicyEffect, Use, Way
from rosbridge_sim.simulator.bus.interface_registry import InterfaceRegistry
from rosbridge_sim.simulator.bus.network_settings import DEFAULTS, InterfaceKind, NetworkSettings, split_prefix

_VERBS: Final = {"publish": Use.PUBLISH, "hear": Use.SUBSCRIBE, "call": Use.SERVICE}


def _ways(text: str) -> tuple[Way, ...]:
    """Return the ways in a text: each name is for the verb that stands before it."""
    found, use = [], Use.PUBLISH
    for word in text.split():
        use = _VERBS.get(word, use)
        if word not in _VERBS:
            found.append(Way(use, word))
    return tuple(found)


_LOADS: Final = "publish /ScenarioLoad call /Service_MoraiSL /SyncModeScenarioLoad"
_REPLAYS: Final = "publish /ReplayInfo_topic call /Morai_SimProc"
_RESET: Final = "publish /sim/reset call /sim/reset"
_RESTORE: Final = "call /sim/restore"
_EVENT: Final = "call /Service_MoraiEventCmd"
_SET: Final = "publish /ego_setting call /sim/set"
_TICK: Final = "call /SyncModeWaitForTick /sim/step"
_BARRIER: Final = "call /sim/barrier/join /sim/barrier/leave"
_SCENE: Final = "hear /sim/scene/state /sim/scene/view call /sim/describe"
_MARKERS: Final = f"hear /sim/scene/objects {_SCENE}"
_SEEN: Final = (
    "hear /image_jpeg/compressed /image_jpeg/boxes /image_jpeg/detections_2d /image_jpeg/detections_3d"
    " /lidar3D /lidar2D /radar"
)
_SEEN_WAYS: Final = _ways(_SEEN)

_SENSOR_TYPES: Final = frozenset(
    {
        *("sensor_msgs/CompressedImage", "sensor_msgs/Image", "sensor_msgs/PointCloud2", "sensor_msgs/LaserScan"),
        *("morai_msgs/RadarDetections", "rosbridge_sim_msgs/BoundingBoxes"),
        *("vision_msgs/Detection2DArray", "vision_msgs/Detection3DArray"),
    }
)
"""Types that say what cameras, lidars and radars see."""

_SAME: Final = (
    _ways("publish /ctrl_cmd /ctrl_cmd_0"),
    _ways("hear /ctrl_cmd /ctrl_cmd_0"),
    _ways(_LOADS),
    _ways("publish /SyncModeAddObj call /SyncModeAddObject"),
    _ways("publish /SyncModeRemoveObj call /SyncModeRemoveObject"),
    _ways(_RESET),
    _ways("hear /sim/score call /sim/score"),
    _ways("hear /sim/state_hash call /sim/state_hash"),
    _ways("hear /sim/scene/map call /sim/map /sim/scene/mesh"),
    _ways("hear /lidar3D /velodyne_points"),
)
"""Each row: default names of one topic or service."""

_SAME_AS: Final = {way: row for row in _SAME for way in row}


def _effect(what: str, ways: str, also: str = "") -> PolicyEffect:
    return PolicyEffect(what, _ways(ways), _ways(also))


_EFFECTS: Final = (
    _effect(
        "move an ego",
        "publish /ctrl_cmd /ctrl_cmd_0 /ghost_ctrl_cmd /cmd_vel /ackermann_cmd /ego_setting"
        " call /SyncModeCtrlCmd /sim/step /sim/set",
        f"{_EVENT} {_REPLAYS} {_LOADS} {_RESET} {_RESTORE}",  # the event service can make an ego drive itself
    ),
    _effect("shift an ego's gear", f"call /SyncModeSetGear {_EVENT}", _SET),
    _effect("choose who drives an ego", _EVENT, _SET),
    _effect("switch an ego's lamps", f"publish /lamps {_EVENT}", _SET),
    _effect(
        "add, move or remove others",
        "publish /NpcGhost_Topic /SyncModeAddObj /SyncModeRemoveObj"
        " call /SyncModeAddObject /SyncModeRemoveObject /sim/spawn /sim/remove /sim/set",
        f"publish /ego_setting {_REPLAYS} {_LOADS} {_RESET} {_RESTORE}",
    ),
    _effect("put another scene in place", f"{_LOADS} {_RESET} {_RESTORE}", _REPLAYS),
    _effect("replay a recording", _REPLAYS, _RESTORE),
    _effect("set traffic lights", "publish /SetTrafficLight /InsnControl", f"{_LOADS} {_RESET} {_RESTORE}"),
    _effect(
        "stop time or let it go on",
        f"{_EVENT} publish /sim/pause call /SyncModeCmd {_TICK} call /sim/real_time_factor {_BARRIER}",
        f"{_LOADS} call /Morai_SimProc",
    ),
    _effect("keep or remove snapshots", "call /sim/snapshot /sim/snapshots"),
    _effect("add, move or remove an ego's sensors", "publish /SensorPosControl call /sim/sensors"),
    # A sensor can be added on another topic, and a snapshot may bring one.
    _effect("see what cameras, lidars and radars see", _SEEN, f"call /sim/sensors {_RESTORE}"),
    _effect("set the weather", "call /sim/weather", f"{_RESET} {_RESTORE}"),
    _effect("save sensor data", "publish /SaveSensorData", "call /SyncModeCtrlCmd"),
    _effect(
        "learn where an ego is",
        "hear /Ego_topic /tf /gps /imu /odom /fix",
        f"{_MARKERS} hear /Object_topic /CollisionData /VehicleCollisionData /ReplayInfo_topic {_TICK}",
    ),
    _effect(
        "learn where others are",
        "hear /Object_topic",
        f"hear /CollisionData /VehicleCollisionData /ReplayInfo_topic {_MARKERS} {_SEEN} call /sim/step",
    ),
    _effect(
        "learn of collisions", "hear /CollisionData /VehicleCollisionData /sim/collisions", f"{_SCENE} call /sim/step"
    ),
    _effect(
        "learn what traffic lights show",
        "hear /GetTrafficLightStatus /InsnStatus /IntscnTL_topic call /Morai_TLSrv",
        _MARKERS,
    ),
    _effect(
        "learn the simulated time",
        "hear /clock call /rosapi/get_time",
        "hear /SyncModeInfo /sim/state_hash /sim/barrier /sim/collisions /sim/drivers"
        f" {_MARKERS} call /SyncModeCmd /sim/state_hash {_BARRIER} {_TICK}",
    ),
)
"""Effects, and knowledge, that several topics or services give; by default names."""

_KINDS: Final = {
    Use.PUBLISH: InterfaceKind.SUBSCRIBER,
    Use.SUBSCRIBE: InterfaceKind.PUBLISHER,
    Use.SERVICE: InterfaceKind.SERVICE,
}
"""The simulator's role for each use by a client."""


class SimulatorWays:
    """The simulator's other names, as the network settings in force have them."""

    def __init__(self, items: InterfaceRegistry | None) -> None:
        """Use the names of these items.

        Args:
            items: the simulator's topics and services; None for MORAI's default names, where a client is the simulator.
        """
        self._items = items
        self._indexed: NetworkSettings | None = None
        self._defaults: dict[tuple[bool, str], list[tuple[str, str]]] = {}

    def others(self, way: Way) -> Iterator[Way]:
        """Yield the other names of a topic, service or action; see `WayLookup`.

        Args:
            way: the use and the name that a client asks for.

        Yields:
            Each other name, with its use.
        """
        if way.use is Use.ACTION:
            return
        for prefix, default in self._defaults_of(way):
            here = Way(way.use, default)
            for use, same in _SAME_AS.get(here, (here,)):
                for where in dict.fromkeys(("/", prefix)):
                    yield Way(use, where + same[1:])
                    for kind in _kinds(use):
                        yield Way(use, self._settings.choice(kind, same, where).name or same)

    def effects(self) -> Iterator[PolicyEffect]:
        """Yield the effects that several topics or services have, under their current names.

        Yields:
            Each effect with its topics and services.
        """
        if self._items is None:
            return
        items = [item for item in self._items.listing() if item.is_on]
        names = {(item.kind, item.default): item.name for item in items}
        seen = [Way(Use.SUBSCRIBE, item.name) for item in items if item.type_name in _SENSOR_TYPES]

        def named(ways: tuple[Way, ...]) -> tuple[Way, ...]:
            found = [
                Way(use, names.get((_KINDS[use], default), default))
                for use, default in ways
                if (_KINDS[use], default) in names or default.startswith("/rosapi/")
            ]
            if ways == _SEEN_WAYS:  # a sensor may be added on these
                found = list(_SEEN_WAYS)
            sensors = seen if set(_SEEN_WAYS) <= set(ways) else ()  # they may have topics of any names
            return tuple(dict.fromkeys((*sensors, *found)))

        for effect in _EFFECTS:
            yield PolicyEffect(effect.what, named(effect.ways), named(effect.also))

    @property
    def _settings(self) -> NetworkSettings:
        return DEFAULTS if self._items is None else self._items.settings

    def _defaults_of(self, way: Way) -> list[tuple[str, str]]:
        """Return the prefixes and default names that a name may mean."""
        settings = self._settings
        if self._indexed is not settings:
            self._indexed, self._defaults = settings, _index(settings)
        is_service = way.use is Use.SERVICE
        prefix, bare = split_prefix(way.name)
        renamed = self._defaults.get((is_service, way.name), [])
        followed = [(prefix, default) for where, default in self._defaults.get((is_service, bare), []) if where == "/"]
        return [(prefix, bare), *renamed, *followed]


def _kinds(use: Use) -> tuple[InterfaceKind, ...]:
    """Return the kinds of items that may be behind a name.

    A client may publish where the simulator publishes, or subscribe to the simulator's input topics.
    """
    return (InterfaceKind.SERVICE,) if use is Use.SERVICE else (InterfaceKind.SUBSCRIBER, InterfaceKind.PUBLISHER)


def _index(settings: NetworkSettings) -> dict[tuple[bool, str], list[tuple[str, str]]]:
    """Return an index: (is a service, name) -> the prefixes and default names of all items with that name."""
    found: dict[tuple[bool, str], list[tuple[str, str]]] = defaultdict(list)
    for kind in InterfaceKind:
        for full_name in settings.choices(kind):
            prefix, default = split_prefix(full_name)
            name = settings.choice(kind, default, prefix).name
            if name is not None and name != full_name:
                found[kind is InterfaceKind.SERVICE, name].append((prefix, default))
    return dict(found)
