"""The component of `/sim/scene/state` and `/sim/scene/view`: all entities and lights of a frame, for viewers.

The message has columns, not a struct for each entity: columns are copied from the world's arrays by a few calls of
numpy, and in CBOR they are typed arrays. What changes only when an entity comes, goes or is placed anew (numbers,
kinds, sizes) is kept from message to message.

The view has the same in a third of the bytes: the page and other programs that draw need no more.

While no frame moves the world (a pause, or the wait for a tick), a new subscriber gets the present scene at once, and
all subscribers get it after each change. So a viewer is never blank, and sees what was spawned.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.scenery.moving.looks import paints
from rosbridge_sim.scenery.scene_frame import SceneLayout
from rosbridge_sim.simulator.bus.publisher_kinds import PeriodicPublisher
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.egos.ego import Ego, lamps_of
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.sim_services.road_services import RoadServices
from rosbridge_sim.world.followers.lamps import find_lamps
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.roads.signals import NEVER_FRAME
from rosbridge_sim.world.state.world import DT, World

SCENE_STATE: Final = "/sim/scene/state"
SCENE_VIEW: Final = "/sim/scene/view"

Number = TypeVar("Number", np.int16, np.float32)

TOUCHES: Final = 1
"""Bit of `flags`."""

UNKNOWN_TIME: Final = -1.0
"""Time that is left to a light of which no change is known [s]."""

VIEW_ANGLE: Final = 1e-4
VIEW_SPEED: Final = 0.01
VIEW_TIME: Final = 0.1
"""Units of the view [rad, m/s, s]."""

MOST_LOOKS: Final = 65_536
"""Sizes times paints in a view: a look is a number of 16 bits."""

UNKNOWN_VIEW_TIME: Final = 65_535
"""`UNKNOWN_TIME` in the view."""


class SceneState(Component):
    """The component of the scene's topic. It holds no state of the simulator, only parts of the last message."""

    def __init__(self, context: SimulatorContext, road_services: RoadServices) -> None:
        """Publish nothing yet."""
        self._context = context
        self._road_services = road_services
        self._make = context.maker(
            "rosbridge_sim_msgs/SceneState",
            "header frame map_digest scenario id kind x y z roll pitch heading speed length width height "
            "center_x shape paint lamps flags light_state light_time_left",
        )
        self._make_view = context.maker(
            "rosbridge_sim_msgs/SceneView",
            "header frame map_digest scenario origin_x origin_y origin_z id kind x y z roll pitch heading "
            "speed look sizes shapes paints lamps flags light_state light_time_left",
        )
        self._view_publisher: PeriodicPublisher | None = None
        # What the lights show changes rarely: their columns are kept with the array that they were made from.
        self._shown: IntArray | None = None
        self._light_state: NDArray[np.int16] = np.empty(0, dtype=np.int16)
        self._light_ends: IntArray = np.empty(0, dtype=np.int64)
        self._is_endless: BoolArray = np.empty(0, dtype=bool)

    def publish(self, publishers: Publishers) -> None:
        """Publish the topics that exist once, not for each ego."""
        publishers.add(SCENE_STATE, "rosbridge_sim_msgs/SceneState", self._message, version=self._version)
        self._view_publisher = publishers.add(
            SCENE_VIEW, "rosbridge_sim_msgs/SceneView", self._view, version=self._view_version
        )

    def _view_version(self) -> _Version:
        version = self._version()
        version.numbers += (self._has_viewer(),)
        return version

    def _has_viewer(self) -> bool:
        """Return False while all subscribers of the view subscribe to everything: SCENE_STATE tells them the same."""
        topic = None if self._view_publisher is None else self._view_publisher.topic
        return topic is None or not topic.subscriptions or topic.is_asked_for

    def _version(self) -> _Version:
        """Return what is the same as long as the message is."""
        world, scene = self._context.world, self._context.scene
        layout = world.derived(self._lay_out)
        return _Version(
            (world.frame, *self._ego_lamps()),
            (layout, world.signals.shown, world.contacts, scene.road_map, scene.loaded),
        )

    def _ego_lamps(self) -> list[int]:
        """Return the lamps of all egos, in the order of the layout."""
        world = self._context.world
        return [lamps_of(ego, world) for _, ego in world.derived(self._lay_out).egos]

    def _lay_out(self, world: World) -> _Layout:
        return _Layout(world, list(self._context.egos))

    def _message(self) -> Struct:
        context = self._context
        world = context.world
        layout = world.derived(self._lay_out)
        rows = layout.rows
        motion = world.block("x", "z").take(rows, axis=1)
        x, y = motion[:2]
        yaw, speed, z = motion[2:].astype(np.float32)
        pitch, roll = world.block("pitch", "roll").take(rows, axis=1).astype(np.float32)
        ego_lamps = self._ego_lamps()
        return self._make(
            context.convert.header(world.frame, "map"),
            world.frame,
            self._road_services.drawing.digest,
            context.scene.loaded.name,
            layout.ids,
            layout.kinds,
            x,
            y,
            z,
            roll,
            pitch,
            yaw,
            speed,
            *layout.box,
            layout.shapes,
            layout.paints,
            self._lamps(layout, ego_lamps),
            self._flags(layout),
            *self._lights(),
        )

    def _view(self) -> Struct | None:
        """Make the message; None while it has no viewer."""
        if not self._has_viewer():
            return None
        context = self._context
        world = context.world
        layout = world.derived(self._lay_out)
        rows = layout.rows
        x, y, yaw, speed, z = world.block("x", "z").take(rows, axis=1)
        pitch, roll = world.block("pitch", "roll").take(rows, axis=1)
        origin = (float(x[0]), float(y[0]), float(z[0])) if len(rows) else (0.0, 0.0, 0.0)
        light_state, left = self._lights()
        tenths = np.where(left < 0.0, UNKNOWN_VIEW_TIME, np.minimum(np.ceil(left / VIEW_TIME), UNKNOWN_VIEW_TIME - 1))
        lamps, flags = self._lamps(layout, self._ego_lamps()), self._flags(layout)
        return self._make_view(
            context.convert.header(world.frame, "map"),
            world.frame,
            self._road_services.drawing.digest,
            context.scene.loaded.name,
            *origin,
            layout.ids,
            layout.kinds,
            (x - origin[0]).astype(np.float32),
            (y - origin[1]).astype(np.float32),
            _unless_zero((z - origin[2]).astype(np.float32)),
            _unless_zero(_rounded(_wrapped(roll), VIEW_ANGLE)),
            _unless_zero(_rounded(_wrapped(pitch), VIEW_ANGLE)),
            _rounded(_wrapped(yaw), VIEW_ANGLE),
            _rounded(speed, VIEW_SPEED),
            *layout.looks,
            lamps if any(lamps) else b"",
            flags if any(flags) else b"",
            light_state,
            tenths.astype(np.uint16),
        )

    def _lamps(self, layout: _Layout, ego_lamps: list[int]) -> bytes:
        """Return the lamps of each entity."""
        lamps = find_lamps(self._context.world, layout.rows)
        for (place, _), own in zip(layout.egos, ego_lamps, strict=True):
            lamps[place] = own
        return lamps.tobytes()

    def _flags(self, layout: _Layout) -> bytes:
        """Return the flags of each entity."""
        world = self._context.world
        if not len(world.contacts):
            return layout.no_flags
        touches = np.isin(world.uid[layout.rows], world.contacts)
        return (touches.view(np.uint8) * TOUCHES).tobytes()

    def _lights(self) -> tuple[NDArray[np.int16], NDArray[np.float32]]:
        """Return what each light shows, and for how long [s]."""
        signals = self._context.world.signals
        if signals.shown is not self._shown:
            self._shown = signals.shown
            self._light_state = signals.shown.astype(np.int16)
            self._light_ends = signals.next_changes()
            self._is_endless = self._light_ends == NEVER_FRAME
        left = ((self._light_ends - signals.frame) * DT).astype(np.float32)
        left[self._is_endless] = UNKNOWN_TIME
        return self._light_state, left


class _Version:
    """A state of the scene.

    Attributes:
        numbers: are equal for equal scenes.
        objects: are the same for equal scenes, so nothing of them need be copied or compared.
    """

    __slots__ = ("numbers", "objects")
    __hash__ = None  # type: ignore[assignment] # it is compared alone

    def __init__(self, numbers: tuple[int, ...], objects: tuple[object, ...]) -> None:
        self.numbers = numbers
        self.objects = objects

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, _Version) or self.numbers != other.numbers:
            return False
        return all(one is another for one, another in zip(self.objects, other.objects, strict=True))


class _Layout:
    """Columns that stay the same until an entity is added, removed, stopped, started or placed.

    Attributes:
        rows: (n,) rows in the world, in order of spawning.
        ids: (n,) uint32, numbers of the entities on the wire.
        kinds: a byte for each.
        box: length, width, height and `center_x` of each, (n,) float32 [m].
        shapes: a byte for each, see `scenery.scene_frame.Shape`.
        paints: (n,) uint32, see `scenery.moving.looks.paints`.
        egos: those of the simulator, each with its place in `rows`.
        no_flags: the flags while nothing touches anything.
        looks: the parts `look`, `sizes`, `shapes` and `paints` of the view.
    """

    __slots__ = ("box", "egos", "ids", "kinds", "looks", "no_flags", "paints", "rows", "shapes")

    def __init__(self, world: World, egos: Sequence[Ego]) -> None:
        rows = self.rows = np.fromiter(world.placed(), dtype=np.int64, count=len(world))
        places = {row: place for place, row in enumerate(rows.tolist())}
        self.egos = [(places[ego.row], ego) for ego in egos if ego.is_there]
        self.ids = world.uid[rows].astype(np.uint32)
        for place, ego in self.egos:
            self.ids[place] = ego.index
        kinds = world.kind[rows].astype(np.uint8)
        self.kinds = kinds.tobytes()
        sizes = (2.0 * world.half_length, 2.0 * world.half_width, world.height, world.centre)
        self.box = tuple([size[rows].astype(np.float32) for size in sizes])
        looks = world.derived(SceneLayout)
        self.shapes = looks.shapes.tobytes()
        self.paints = paints(looks)
        self.no_flags = bytes(len(rows))
        self.looks = _looks_of(self.box, looks.shapes, self.paints)


def _looks_of(
    box: Sequence[NDArray[np.float32]], shapes: NDArray[np.uint8], paints: NDArray[np.uint32]
) -> tuple[NDArray[np.uint16], NDArray[np.float32], bytes, NDArray[np.uint32]]:
    """Return the look of each entity, (n,), the sizes (4 k,), the shapes, a byte for each size, and the paints (p,).

    Look i is size i // p with paint i % p. If there are too many for 16 bits, all entities have the first paint.

    Args:
        box: length, width, height and `center_x` of each entity [m].
    """
    table, which = np.unique(np.column_stack([*box, shapes.astype(np.float32)]), axis=0, return_inverse=True)
    hues, hue = np.unique(paints, return_inverse=True)
    if len(table) * len(hues) > MOST_LOOKS:
        hues, hue = hues[:1], np.zeros(len(paints), dtype=np.int64)
    look = which.reshape(-1) * len(hues) + hue
    shape_bytes = table[:, 4].astype(np.uint8).tobytes()
    return look.astype(np.uint16), table[:, :4].reshape(-1).astype(np.float32), shape_bytes, hues.astype(np.uint32)


def _rounded(values: FloatArray, unit: float) -> NDArray[np.int16]:
    """Return values in whole units, at most as large as 16 bits hold."""
    return np.clip(np.rint(values / unit), -32_767, 32_767).astype(np.int16)


def _wrapped(angles: FloatArray) -> FloatArray:
    """Return angles from -pi to pi [rad]."""
    return np.remainder(angles + np.pi, 2.0 * np.pi) - np.pi


def _unless_zero(values: NDArray[Number]) -> NDArray[Number]:
    """Return no values if all are 0."""
    return values if values.any() else values[:0]
