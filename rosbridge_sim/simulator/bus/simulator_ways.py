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


def _publishing(*names: str) -> tuple[Way, ...]:
    return tuple(Way(Use.PUBLISH, name) for name in names)


def _hearing(*names: str) -> tuple[Way, ...]:
    return tuple(Way(Use.SUBSCRIBE, name) for name in names)


def _calling(*names: str) -> tuple[Way, ...]:
    return tuple(Way(Use.SERVICE, name) for name in names)


_LOADS: Final = (*_publishing("/ScenarioLoad"), *_calling("/Service_MoraiSL", "/SyncModeScenarioLoad"))
_REPLAYS: Final = (*_publishing("/ReplayInfo_topic"), *_calling("/Morai_SimProc"))
_RESET: Final = (*_publishing("/sim/reset"), *_calling("/sim/reset"))
_RESTORE: Final = _calling("/sim/restore")
_EVENT: Final = _calling("/Service_MoraiEventCmd")
_PLACE: Final = _publishing("/ego_setting")
_BARRIER: Final = _calling("/sim/barrier/join", "/sim/barrier/leave")
_SET: Final = _calling("/sim/set")
_COME_AND_GO: Final = _calling("/sim/spawn", "/sim/remove")
_TICK: Final = _calling("/SyncModeWaitForTick")
_STEP: Final = _calling("/sim/step")
_SCENE: Final = (*_hearing("/sim/scene/state", "/sim/scene/view"), *_calling("/sim/describe"))
_MARKERS: Final = _hearing("/sim/scene/objects")
_SEEN: Final = _hearing(
    *("/image_jpeg/compressed", "/image_jpeg/boxes", "/image_jpeg/detections_2d", "/image_jpeg/detections_3d"),
    *("/lidar3D", "/lidar2D", "/radar"),
)

_SENSOR_TYPES: Final = frozenset(
    {
        *("sensor_msgs/CompressedImage", "sensor_msgs/Image", "sensor_msgs/PointCloud2", "sensor_msgs/LaserScan"),
        *("morai_msgs/RadarDetections", "rosbridge_sim_msgs/BoundingBoxes"),
        *("vision_msgs/Detection2DArray", "vision_msgs/Detection3DArray"),
    }
)
"""Types that say what cameras, lidars and radars see."""

_SAME: Final = (
    _publishing("/ctrl_cmd", "/ctrl_cmd_0"),
    _hearing("/ctrl_cmd", "/ctrl_cmd_0"),
    _LOADS,
    (*_publishing("/SyncModeAddObj"), *_calling("/SyncModeAddObject")),
    (*_publishing("/SyncModeRemoveObj"), *_calling("/SyncModeRemoveObject")),
    _RESET,
    (*_hearing("/sim/score"), *_calling("/sim/score")),
    (*_hearing("/sim/state_hash"), *_calling("/sim/state_hash")),
    (*_hearing("/sim/scene/map"), *_calling("/sim/map", "/sim/scene/mesh")),
    _hearing("/lidar3D", "/velodyne_points"),
)
"""Each row: default names of one topic or service."""

_SAME_AS: Final = {way: row for row in _SAME for way in row}

_EFFECTS: Final = (
    PolicyEffect(
        "move an ego",
        (
            *_publishing("/ctrl_cmd", "/ctrl_cmd_0", "/ghost_ctrl_cmd", "/cmd_vel", "/ackermann_cmd"),
            *_PLACE,
            *_calling("/SyncModeCtrlCmd"),
            *_STEP,
            *_SET,
        ),
        (*_EVENT, *_REPLAYS, *_LOADS, *_RESET, *_RESTORE),  # the event service can make an ego drive itself
    ),
    PolicyEffect("shift an ego's gear", (*_calling("/SyncModeSetGear"), *_EVENT), (*_PLACE, *_SET)),
    PolicyEffect("choose who drives an ego", _EVENT, (*_PLACE, *_SET)),
    PolicyEffect("switch an ego's lamps", (*_publishing("/lamps"), *_EVENT), (*_PLACE, *_SET)),
    PolicyEffect(
        "add, move or remove others",
        (
            *_publishing("/NpcGhost_Topic", "/SyncModeAddObj", "/SyncModeRemoveObj"),
            *_calling("/SyncModeAddObject", "/SyncModeRemoveObject"),
            *_COME_AND_GO,
            *_SET,
        ),
        (*_PLACE, *_REPLAYS, *_LOADS, *_RESET, *_RESTORE),
    ),
    PolicyEffect("put another scene in place", (*_LOADS, *_RESET, *_RESTORE), _REPLAYS),
    PolicyEffect("replay a recording", _REPLAYS, _RESTORE),
    PolicyEffect("set traffic lights", _publishing("/SetTrafficLight", "/InsnControl"), (*_LOADS, *_RESET, *_RESTORE)),
    PolicyEffect(
        "stop time or let it go on",
        (
            *_EVENT,
            *_publishing("/sim/pause"),
            *_calling("/SyncModeCmd"),
            *_TICK,
            *_STEP,
            *_calling("/sim/real_time_factor"),
            *_BARRIER,
        ),
        (*_LOADS, *_calling("/Morai_SimProc")),
    ),
    PolicyEffect("keep or remove snapshots", _calling("/sim/snapshot", "/sim/snapshots")),
    PolicyEffect(
        "add, move or remove an ego's sensors", (*_publishing("/SensorPosControl"), *_calling("/sim/sensors"))
    ),
    # A sensor can be added on another topic, and a snapshot may bring one.
    PolicyEffect("see what cameras, lidars and radars see", _SEEN, (*_calling("/sim/sensors"), *_RESTORE)),
    PolicyEffect("set the weather", _calling("/sim/weather"), (*_RESET, *_RESTORE)),
    PolicyEffect("save sensor data", _publishing("/SaveSensorData"), _calling("/SyncModeCtrlCmd")),
    PolicyEffect(
        "learn where an ego is",
        _hearing("/Ego_topic", "/tf", "/gps", "/imu", "/odom", "/fix"),
        (
            *_MARKERS,
            *_SCENE,
            *_hearing("/Object_topic", "/CollisionData", "/VehicleCollisionData", "/ReplayInfo_topic"),
            *_TICK,
            *_STEP,
        ),
    ),
    PolicyEffect(
        "learn where others are",
        _hearing("/Object_topic"),
        (*_hearing("/CollisionData", "/VehicleCollisionData", "/ReplayInfo_topic"), *_MARKERS, *_SCENE, *_SEEN, *_STEP),
    ),
    PolicyEffect(
        "learn of collisions",
        _hearing("/CollisionData", "/VehicleCollisionData", "/sim/collisions"),
        (*_SCENE, *_STEP),
    ),
    PolicyEffect(
        "learn what traffic lights show",
        (*_hearing("/GetTrafficLightStatus", "/InsnStatus", "/IntscnTL_topic"), *_calling("/Morai_TLSrv")),
        (*_MARKERS, *_SCENE),
    ),
    PolicyEffect(
        "learn the simulated time",
        (*_hearing("/clock"), *_calling("/rosapi/get_time")),
        (
            *_hearing("/SyncModeInfo", "/sim/state_hash", "/sim/barrier", "/sim/collisions", "/sim/drivers"),
            *_MARKERS,
            *_SCENE,
            *_calling("/SyncModeCmd", "/sim/state_hash"),
            *_BARRIER,
            *_TICK,
            *_STEP,
        ),
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
        seen = _hearing(*[item.name for item in items if item.type_name in _SENSOR_TYPES])

        def named(ways: tuple[Way, ...]) -> tuple[Way, ...]:
            found = [
                Way(use, names.get((_KINDS[use], default), default))
                for use, default in ways
                if (_KINDS[use], default) in names or default.startswith("/rosapi/")
            ]
            if ways == _SEEN:  # a sensor may be added on these
                found = list(_SEEN)
            sensors = seen if set(_SEEN) <= set(ways) else ()  # they may have topics of any names
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
