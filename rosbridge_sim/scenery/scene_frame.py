"""A copy of all that is seen of a world at one frame: plain arrays, for a thread that draws while the world goes on.

`take_frame` copies the state. What changes only when an entity comes, goes or is placed anew (shapes, sizes, looks) is
kept from frame to frame and shared by the copies, which never change it.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.records import Record
from rosbridge_sim.world.followers.lamps import find_lamps
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.state.chance import salt_of
from rosbridge_sim.world.state.entity_types import Body
from rosbridge_sim.world.state.labels import usual_wheelbase
from rosbridge_sim.world.state.world import Kind, World


class Shape(IntEnum):
    """Shape that an entity is drawn with."""

    CAR = 0
    VAN = 1
    TRUCK = 2
    BUS = 3
    MOTORCYCLE = 4
    BICYCLE = 5
    PERSON = 6
    BOX = 7
    CONE = 8
    BARREL = 9
    BARRIER = 10


class EgoLook(NamedTuple):
    """Facts about an ego that the world does not have.

    Attributes:
        row: in the world.
        number: the id that clients know it by.
        lamps: that are lit, a sum of the bits of `world.followers.lamps`.
    """

    row: int
    number: int
    lamps: int


class SceneFrame(Record, eq=False):
    """All entities and lights of a frame; `n` entities in order of spawning, (n,) each unless told otherwise.

    Attributes:
        ids: int64, id of each entity on the wire.
        shapes: uint8, see `Shape`.
        is_ego: bool.
        looks: uint64, chance for colours; the same for an entity as long as it lives.
        sizes: (n, 3) length, width and height of its box [m].
        centres: from the reference point forward to the middle of the box [m].
        wheelbases: from the rear axle to the front axle [m]; 0 for what has none. The rear axle is the reference point.
        poses: (n, 6) x, y, z of the reference point on the ground [m], roll, pitch (nose down positive), yaw [rad].
        speeds: along the heading [m/s].
        steers: angle of the front wheels, left positive [rad].
        lamps: uint8, that are lit, a sum of the bits of `world.followers.lamps`.
        strides: distance walked, for the legs of people [m].
        signals: (lights,) int64, lit lamps of each traffic light of the map; -1 where it shows none.
        plan: the traffic lights of the map, never changed.
    """

    frame: int
    ids: IntArray
    shapes: NDArray[np.uint8]
    is_ego: NDArray[np.bool_]
    looks: NDArray[np.uint64]
    sizes: FloatArray
    centres: FloatArray
    wheelbases: FloatArray
    poses: FloatArray
    speeds: FloatArray
    steers: FloatArray
    lamps: NDArray[np.uint8]
    strides: FloatArray
    signals: IntArray
    plan: SignalPlan

    def __len__(self) -> int:
        return len(self.ids)


class SceneLayout:
    """Columns that stay the same until an entity is added, removed, stopped, started or placed; see `SceneFrame`."""

    def __init__(self, world: World) -> None:
        rows = self.rows = np.fromiter(world.placed(), dtype=np.int64, count=len(world))
        self.ids = world.uid[rows].astype(np.int64)
        bodies = [world.bodies[row] for row in rows.tolist()]
        kinds = [Kind(kind) for kind in world.kind[rows].tolist()]
        names = [world.names[row] for row in rows.tolist()]
        self.shapes = np.array(list(map(shape_of, kinds, names, bodies)), dtype=np.uint8)
        self.is_ego = np.array([kind == Kind.EGO for kind in kinds], dtype=bool)
        self.looks = salt_of(world.seed, world.uid[rows])
        self.sizes = np.array([(body.length, body.width, body.height) for body in bodies]).reshape(-1, 3)
        self.centres = np.array([body.centre for body in bodies], dtype=np.float64)
        has_axles = self.shapes < Shape.PERSON
        self.wheelbases = np.array([usual_wheelbase(body) for body in bodies], dtype=np.float64) * has_axles


def take_frame(world: World, egos: Sequence[EgoLook] = ()) -> SceneFrame:
    """Return a copy of what can be seen of a world now.

    Args:
        world: read only.
        egos: numbers and lamps of egos; without them an ego has its id in the world, and lamps that follow from its
            motion.
    """
    layout = world.derived(SceneLayout)
    rows = layout.rows
    ids, lamps = layout.ids, find_lamps(world, rows)
    if egos:
        ids = ids.copy()
        place_of = {row: place for place, row in enumerate(rows.tolist())}
        for ego in egos:
            ids[place_of[ego.row]], lamps[place_of[ego.row]] = ego.number, ego.lamps
    yaw, speed = world.yaw.take(rows), world.speed.take(rows)
    poses = np.column_stack([column.take(rows) for column in (world.x, world.y, world.z, world.roll, world.pitch)])
    along = poses[:, 0] * np.cos(yaw) + poses[:, 1] * np.sin(yaw)
    bend = layout.wheelbases * world.yaw_rate.take(rows) / np.maximum(np.abs(speed), LEAST_SPEED)
    return SceneFrame(
        frame=world.frame,
        ids=ids,
        shapes=layout.shapes,
        is_ego=layout.is_ego,
        looks=layout.looks,
        sizes=layout.sizes,
        centres=layout.centres,
        wheelbases=layout.wheelbases,
        poses=np.column_stack([poses, yaw]),
        speeds=speed,
        steers=np.where(layout.is_ego, world.steer.take(rows), np.arctan(bend)),
        lamps=lamps,
        strides=np.where(world.has_path.take(rows), world.arc.take(rows), along),
        signals=world.signals.shown.copy(),
        plan=world.signals.plan,
    )


LEAST_SPEED: Final = 1.0
"""Speed from which a yaw rate tells how far the wheels of a vehicle are turned [m/s]."""

_WORDS: Final = {
    "motorcycle": Shape.MOTORCYCLE,
    "bicycle": Shape.BICYCLE,
    "truck": Shape.TRUCK,
    "bus": Shape.BUS,
    "van": Shape.VAN,
    "cone": Shape.CONE,
    "barrel": Shape.BARREL,
    "drum": Shape.BARREL,
    "barrier": Shape.BARRIER,
    "box": Shape.BOX,
}
"""Words in the names of models, the first that fits counts."""

TWO_WHEELER_WIDTH: Final = 1.0
"""A vehicle that is narrower has two wheels [m]."""

BICYCLE_MASS: Final = 120.0
"""A vehicle with two wheels that is lighter is a bicycle; the rider counts [kg]."""

BUS_LENGTH: Final = 7.5
"""A vehicle that is longer is a bus [m]: light trucks and vans end at 7 m."""

VAN_HEIGHT: Final = 1.75
"""A vehicle that is higher is a van [m]: tall passenger cars end at 1.7 m."""


def shape_of(kind: Kind, name: str, body: Body) -> Shape:
    """Return the shape of an entity: by its model's name, else by its size."""
    if kind == Kind.PEDESTRIAN:
        return Shape.PERSON
    is_obstacle = kind == Kind.OBSTACLE
    low = name.lower()
    shape = next((shape for word, shape in _WORDS.items() if word in low), None)
    if shape is not None and (shape > Shape.PERSON) == is_obstacle:
        return shape
    if is_obstacle:
        return Shape.BOX
    if body.width < TWO_WHEELER_WIDTH:
        return Shape.BICYCLE if body.mass < BICYCLE_MASS else Shape.MOTORCYCLE
    if body.length > BUS_LENGTH:
        return Shape.BUS
    return Shape.VAN if body.height > VAN_HEIGHT else Shape.CAR
