"""The component of `/sim/scene/map` and `/sim/scene/objects`: the scene for viewers such as RViz and Lichtblick.

Both are made and sent only while a client subscribes to them by their names. The map is latched: it is made in a
thread when the first client subscribes, and again after another map was loaded. It is dropped when another map is
loaded and no client listens.

A viewer keeps a marker until it is deleted, and a slow viewer may miss messages. So a deletion is repeated for a
second, and all markers are deleted and sent again for a second after a load, a reset or a restore.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, Final

import numpy as np

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.simulator.bus.publisher_kinds import LatchedPublisher, PeriodicPublisher
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.egos.tf_publisher import MAP
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.markers.map_markers import lamp_height, make_map_markers
from rosbridge_sim.simulator.markers.markers import COLOURS, KIND_LOOKS, LAMPS, MARKER_ARRAY, MarkerMaker, MarkerShape
from rosbridge_sim.units import MPS_TO_KMH
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, Vector, quaternion, rotate
from rosbridge_sim.world.state.world import Kind, World

SCENE_MAP: Final = "/sim/scene/map"
SCENE_OBJECTS: Final = "/sim/scene/objects"

RATE: Final = 10.0
"""Messages a second of simulated time [Hz]: a viewer's picture moves smoothly enough, at a fifth of the cost."""

REPEATS: Final = 10
"""Messages that repeat a deletion: a second of them."""

MAX_BODIES: Final = 1_000
"""Entities in a message at most, the nearest to the first ego: 0.5 MB of JSON."""

MAX_LABELS: Final = 200
"""Entities with a label at most, the nearest to the first ego: more texts cannot be read on a screen."""

MAX_LAMPS: Final = 2_000
"""Lights in a message at most, the nearest to the first ego: 0.2 MB of JSON."""

LAMP_SIZE: Final = 0.5
"""Diameter of a lamp [m]: larger than a real one, to be seen from far."""

DARK: Final = (0.3, 0.3, 0.3, 1.0)
"""Colour of a light that shows nothing."""

LABEL_HEIGHT: Final = 0.8
"""Height of a letter of a label [m]."""

ARROW_SIZE: Final = (0.25, 0.6, 0.6)
"""Diameter of the shaft and of the head of an ego's arrow, and length of the head [m]."""

ARROW_SECONDS: Final = 1.0
"""The arrow of an ego is as long as its way of this time [s], and at least `MIN_ARROW`."""

MIN_ARROW: Final = 1.5
"""Shortest arrow [m]: it shows the front of a standing ego."""

_COLUMNS: Final = (
    *("kind", "x", "y", "z", "roll", "pitch", "yaw", "speed"),
    *("half_length", "half_width", "height", "centre"),
)
"""Columns of the world that a body is drawn from."""

_Key = tuple[str, int]
"""Namespace and id of a marker."""


class SceneMarkers(Component):
    """The component of the scene for viewers.

    It holds what its subscribers have been shown. That is no part of a snapshot: after a restore all is shown anew.
    """

    def __init__(self, context: SimulatorContext) -> None:
        """Publish nothing yet."""
        self._context = context
        self._now = 0.0
        self._map: LatchedPublisher | None = None
        self._objects: PeriodicPublisher | None = None
        self._drawn: RoadMap | None = None  # the map that was published, or that is being made
        self._shown: set[_Key] = set()
        self._gone: dict[_Key, int] = {}  # -> messages that have yet to delete it
        self._num_clearing = REPEATS
        self._lamps = _Lamps()
        hooks = context.hooks
        context.bus.on_topic.append(self._note_subscriber)
        hooks.after_frame.append(self._follow_map)
        hooks.on_new_scene.append(self._follow_map)
        hooks.on_scene_change.append(lambda _now: self._clear())
        hooks.on_restore.append(self._restore)

    @cached_property
    def _make(self) -> MarkerMaker:
        return MarkerMaker(self._context.bus.store)

    def publish(self, publishers: Publishers) -> None:
        """Publish the topics that exist once, not for each ego."""
        self._map = publishers.keep(SCENE_MAP, MARKER_ARRAY)
        self._objects = publishers.add(
            SCENE_OBJECTS, MARKER_ARRAY, self._message, rate=RATE, is_sampled=True, is_shown_in_pause=True
        )

    # The map

    def _note_subscriber(self, topic: Topic) -> None:
        """Make the map if a client has subscribed to this topic."""
        self._context.hooks.after_frame.wake(self._follow_map)
        if self._map is not None and topic is self._map.topic:
            self._follow_map(max(self._now, self._context.stepper.now))

    def _restore(self) -> None:
        self._clear()
        self._follow_map(max(self._now, self._context.stepper.now))

    def _follow_map(self, now: float) -> None:
        """Publish the map in use if it was not published yet and a client listens."""
        self._now = now
        self._context.hooks.after_frame.rest(self._follow_map)
        road_map = self._context.scene.road_map
        if self._drawn is road_map:
            return
        if self._map is None or self._map.topic is None or not self._map.topic.is_asked_for:
            if self._drawn is not None and self._map is not None:
                self._drawn = None
                self._context.publishers.forget(self._map)
            return
        self._drawn = road_map
        make = self._make
        # Time 0 stands for any time. A viewer that knows only the last seconds of a frame can place the map, too.
        store = self._context.bus.store
        header = maker(store, "std_msgs/Header", "seq stamp frame_id")(0, store.time_value(0), MAP)
        self._context.reader.read(
            lambda: make.array(make_map_markers(make, header, road_map)),
            lambda made, now: self._put_map(road_map, made, now),
            now,
        )

    def _put_map(self, road_map: RoadMap, made: Struct | DocumentError, now: float) -> None:
        """Publish what the thread has made, unless there is another map by now."""
        if self._drawn is not road_map:
            return
        if isinstance(made, DocumentError):  # it took too long; the next frame tries again
            self._drawn = None
            self._context.hooks.after_frame.wake(self._follow_map)
            return
        assert self._map is not None
        self._context.publishers.update(self._map, made, now)

    # Objects

    def _clear(self) -> None:
        """Have the next messages delete everything, because the scene changes."""
        self._num_clearing = REPEATS
        self._shown.clear()
        self._gone.clear()

    def _message(self) -> Struct | None:
        """Make the message; None while only subscribers of all topics are there."""
        topic = None if self._objects is None else self._objects.topic
        if topic is not None and topic.subscriptions and not topic.is_asked_for:
            return None
        header = self._context.convert.header(self._context.world.frame, MAP)
        bodies = self._bodies(header)
        if topic is None or not topic.subscriptions:  # for a report: nobody has been shown this
            return self._make.array(bodies)
        return self._make.array([*self._deletions(header, bodies), *bodies])

    def _deletions(self, header: Struct, bodies: list[Struct]) -> list[Struct]:
        """Return the deletions that this message needs, and note what it shows."""
        shown = {(body.ns, body.id) for body in bodies}
        gone = {key: left - 1 for key, left in self._gone.items() if left > 1 and key not in shown}
        gone.update(dict.fromkeys(self._shown - shown, REPEATS))
        self._gone, self._shown = gone, shown
        if self._num_clearing:
            self._num_clearing -= 1
            return [self._make.delete_all(header)]
        return [self._make.delete(header, ns, number) for ns, number in sorted(gone)]

    def _bodies(self, header: Struct) -> list[Struct]:
        """Return the markers of all entities and lights."""
        context = self._context
        world, egos = context.world, context.egos
        numbers = {ego.uid: ego.index for ego in egos}
        rows = np.fromiter(world.placed(), dtype=np.int64, count=len(world))
        place = (world.x.item(egos.first.row), world.y.item(egos.first.row)) if egos.first.is_there else (0.0, 0.0)
        rows = rows[_nearest(world.x[rows], world.y[rows], place, MAX_BODIES)]
        has_label = set(rows[_nearest(world.x[rows], world.y[rows], place, MAX_LABELS)].tolist())
        # One call for each column: single values out of arrays would take most of the time.
        columns = (getattr(world, name)[rows].tolist() for name in _COLUMNS)
        markers: list[Struct] = []
        for row, uid, *figures in zip(rows.tolist(), world.uid[rows].tolist(), *columns, strict=True):
            markers += self._body(header, numbers.get(uid, uid), figures, has_label=row in has_label)
        lamps = self._lamps.marker(self._make, header, world, context.scene.road_map, place)
        return markers if lamps is None else [*markers, lamps]

    def _body(self, header: Struct, number: int, figures: list[Any], *, has_label: bool) -> list[Struct]:
        """Return the markers of one entity; `figures` are its values of `_COLUMNS`."""
        make = self._make
        kind, x, y, z, roll, pitch, yaw, speed, half_length, half_width, height, centre = figures
        ns, shape, colour = KIND_LOOKS[kind]
        axes = quaternion(roll, pitch, yaw)
        middle = _sum((x, y, z), rotate(axes, (centre, 0.0, 0.5 * height)))
        size = make.size(2.0 * half_length, 2.0 * half_width, height)
        markers = [
            make.solid(header, ns, number, shape, pose=make.pose(middle, axes), size=size, colour=make.colour(colour))
        ]
        if kind == Kind.EGO:
            nose = _sum(middle, rotate(axes, (half_length, 0.0, 0.5 * height)))
            tip = _sum(nose, rotate(axes, (max(MIN_ARROW, abs(speed) * ARROW_SECONDS), 0.0, 0.0)))
            points = make.points(np.array([nose, tip]))
            size, colour = make.size(*ARROW_SIZE), make.colour(COLOURS["arrow"])
            markers.append(
                make.group(header, "ego_arrows", number, MarkerShape.ARROW, size=size, colour=colour, points=points)
            )
        if has_label:
            pose = make.pose((middle[0], middle[1], middle[2] + 0.5 * height + LABEL_HEIGHT))
            text = f"{'ego ' if kind == Kind.EGO else ''}{number}"
            if kind != Kind.OBSTACLE:
                text += f"  {speed * MPS_TO_KMH:.0f} km/h"
            markers.append(make.text(header, f"{ns}_labels", number, text, pose=pose, height=LABEL_HEIGHT))
        return markers


class _Lamps:
    """Maker of the one marker of all lights. Its parts are kept while no light changes."""

    def __init__(self) -> None:
        self._key: object = None
        self._points: list[Struct] = []
        self._colours: list[Struct] = []
        self._map: RoadMap | None = None
        self._heads = np.empty((0, 3))

    def marker(
        self, make: MarkerMaker, header: Struct, world: World, road_map: RoadMap, place: tuple[float, float]
    ) -> Struct | None:
        """Return the marker; None on a map without lights."""
        plan, shown = world.signals.plan, world.signals.shown
        if not plan.lights:
            return None
        if self._map is not road_map or len(self._heads) != len(plan.lights):
            roads = world.roads
            self._heads = np.array([(light.x, light.y, lamp_height(light, roads)) for light in plan.lights])
            self._map, self._key = road_map, None
        near = _nearest(self._heads[:, 0], self._heads[:, 1], place, MAX_LAMPS).tolist()
        key = (shown.tobytes(), near if len(near) < len(plan.lights) else None)
        if key != self._key:
            self._key = key
            self._points, self._colours = [], []
            points: list[tuple[float, float, float]] = []
            for light in near:
                x, y, z = self._heads[light].tolist()
                value = int(shown[light])
                lit = [(rise, colour) for lamps, rise, colour in LAMPS if value > 0 and value & lamps]
                for rise, colour in lit or [(0.0, DARK)]:
                    points.append((x, y, z + rise))
                    self._colours.append(make.colour(colour))
            self._points = make.points(np.array(points))
        size = make.size(LAMP_SIZE, LAMP_SIZE, LAMP_SIZE)
        return make.group(
            header,
            "lights",
            0,
            MarkerShape.SPHERE_LIST,
            size=size,
            colour=make.colour(DARK),
            points=self._points,
            colours=self._colours,
        )


def _nearest(x: FloatArray, y: FloatArray, place: tuple[float, float], most: int) -> IntArray:
    """Return the positions of the points nearest to a place, in the given order, at most so many."""
    if len(x) <= most:
        return np.arange(len(x))
    away = np.hypot(x - place[0], y - place[1])
    return np.asarray(np.sort(np.argsort(away, kind="stable")[:most]))


def _sum(place: Vector, way: Vector) -> Vector:
    return place[0] + way[0], place[1] + way[1], place[2] + way[2]
