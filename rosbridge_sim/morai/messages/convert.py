"""Conversion between the world's arrays and `morai_msgs`; the only file that applies unit factors.

The world uses SI units and radians. MORAI mixes units: the ego's velocity is in m/s, an object's in km/h, a commanded
speed in km/h. Headings are in degrees, a commanded wheel angle in radians. The reported wheel angle is in radians in
the manual and in degrees in client code. A `Profile` chooses between two such units. Fields that only some releases
have are filled if the type has them.

Headers carry simulated time, or the time of day if that is chosen. Their `seq` is the frame, so it does not depend on
the subscribers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from rosbridge_sim.errors import FieldError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.morai.messages.control import MODES, Control
from rosbridge_sim.morai.messages.ego_figures import (
    AXLE_OF,
    LANE_FIGURES,
    OFF_ROAD,
    LateralPlace,
    find_lane_place,
    front_steer_angle,
    rear_steer_angle,
    tyre_figure,
)
from rosbridge_sim.morai.messages.object_lists import (
    DEGREES,
    LATE_FROM,
    OBJECT_TYPES,
    ObjectLayout,
    UniqueId,
    choose_listed,
    in_lists,
)
from rosbridge_sim.morai.releases import MANUAL, Profile
from rosbridge_sim.schema.float32 import round32
from rosbridge_sim.schema.late_list import LateList
from rosbridge_sim.schema.store import Store
from rosbridge_sim.units import MPS_TO_KMH
from rosbridge_sim.world.followers.motion import motion
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import STEP_NS, Body, Dynamics, Kind, World

# Units


def time_text(frame: int) -> str:
    """Return simulated time as decimal seconds, exact: frame 617 is 12.34.

    Returns:
        Seconds with two decimals.
    """
    return f"{frame // 50}.{frame % 50 * 2:02d}"


class Converter:
    """Maker of messages and reader of commands, for one store and one profile.

    A method that makes a message returns a struct of the type that it is named after.

    Attributes:
        profile: the one in use.
        wall_ns: the time of day for all stamps of the current frame [ns]; None for simulated time.
        steering: field of a CtrlCmd that has the angle of the front wheels.
    """

    def __init__(self, store: Store, profile: Profile = MANUAL) -> None:
        self.profile = profile
        self.wall_ns: int | None = None
        self._store = store
        make, late = partial(maker, store), partial(late_maker, store)
        self._vector = make("geometry_msgs/Vector3", "x y z")
        self._header = make("std_msgs/Header", "seq stamp frame_id")
        self._clock = make("rosgraph_msgs/Clock", "clock")
        self._wheel_factor = DEGREES if profile.wheel_angle_unit == "deg" else 1.0
        figures = {
            "wheel_angle": self._wheel_angle,
            "front_steer_angle": front_steer_angle,
            **LANE_FIGURES,
            "rear_steer_angle": rear_steer_angle,
            **{
                f"{figure}_{wheel}": tyre_figure(figure, axle)
                for figure in ("tire_lateral_force", "side_slip_angle", "tire_cornering_stiffness")
                for wheel, axle in AXLE_OF.items()
            },
        }
        fields = store.message("morai_msgs/EgoVehicleStatus").struct_type.__struct_fields__
        known = [name for name in fields if name in figures]
        self._ego_figures = [figures[name] for name in known]
        self._has_lane_figures = any(name in LANE_FIGURES for name in fields)
        names = " ".join(["header unique_id acceleration position velocity heading accel brake", *known])
        self._ego = make("morai_msgs/EgoVehicleStatus", names)
        self._object = make(
            "morai_msgs/ObjectStatus", "unique_id type name heading velocity acceleration size position"
        )
        self._objects = make(
            "morai_msgs/ObjectStatusList",
            "header num_of_npcs num_of_pedestrian num_of_obstacle npc_list pedestrian_list obstacle_list",
        )
        self._collision = late(
            "morai_msgs/CollisionData",
            "header global_offset_x global_offset_y global_offset_z collision_object collision_objecta",
        )
        self._crash = late("morai_msgs/VehicleCollision", "crashed_vehicles")
        self._crashes = late("morai_msgs/VehicleCollisionData", "header collisions")
        self._map_spec = late(
            "morai_msgs/MapSpec",
            "plane_coordinate_system utm_num utm_offset ellipse central_latitude central_meridian "
            "scale_factor false_easting false_northing",
        )
        self._vehicle_spec = late("morai_msgs/VehicleSpec", "size wheel_base max_steering overhang rear_overhang")
        fields = store.message("morai_msgs/CtrlCmd").struct_type.__struct_fields__
        self.steering = "steering" if "steering" in fields else "front_steer"
        self._has_rear_steer = "rear_steer" in fields
        self._speed_factor = MPS_TO_KMH if profile.object_velocity_unit == "km/h" else 1.0
        self._is_width_first = profile.object_size_order == "width-length-height"
        self._at_rest = self._vector(0.0, 0.0, 0.0)

    # Out

    def header(self, frame: int, frame_id: str = "") -> Struct:
        """Return a header.

        Args:
            frame: the world's; it is `seq`, and it gives the stamp (`stamp_ns`).
            frame_id: tf frame of the message.
        """
        return self._header(frame & 0xFFFFFFFF, self._store.time_value(self.stamp_ns(frame)), frame_id)

    def clock(self, frame: int) -> Struct:
        """Return the time that the headers of a frame have, so that no header is ahead of the clock.

        Returns:
            A rosgraph_msgs/Clock.
        """
        return self._clock(self._store.time_value(self.stamp_ns(frame)))

    def stamp_ns(self, frame: int) -> int:
        """Return the stamp of all messages of the current frame.

        Returns:
            Simulated time, or the time of day if that is chosen [ns].
        """
        return frame * STEP_NS if self.wall_ns is None else self.wall_ns

    def ego_vehicle_status(self, world: World, row: int, unique_id: int, roads: Roads | None = None) -> Struct:
        """Return the state of an ego.

        Velocity and acceleration are in the frame of the body, x forward and y left, at the rear axle. That point moves
        sideways only if its tyres slip. On hills both have the part upwards, but not with the kinematic model, whose
        messages stay as they were.

        Args:
            world: read only.
            unique_id: its id on the wire.
            roads: lanes of the map, for releases with fields about lanes.

        Returns:
            A morai_msgs/EgoVehicleStatus.
        """
        vector = self._vector
        rises = world.dynamics == Dynamics.SINGLE_TRACK
        climb, climb_accel = (world.climb.item(row), world.climb_accel.item(row)) if rises else (0.0, 0.0)
        lane = find_lane_place(world, row, roads) if self._has_lane_figures and roads else OFF_ROAD
        return self._ego(
            self.header(world.frame, "base_link"),
            unique_id,
            vector(world.accel.item(row), world.lateral_accel.item(row), climb_accel),
            vector(world.x.item(row), world.y.item(row), world.z.item(row)),
            vector(world.speed.item(row), world.lateral_speed.item(row), climb),
            math.degrees(world.yaw.item(row)),
            round32(world.throttle.item(row)),
            round32(world.brake.item(row)),
            *[round32(figure(world, row, lane)) for figure in self._ego_figures],
        )

    def object_status_list(self, world: World, ego_row: int | None, unique_id: UniqueId) -> Struct:
        """Return all entities except one ego, in the order of their addition; other egos are the last of the vehicles.

        Args:
            world: read only.
            ego_row: row of the ego that the list is for. Where the profile limits the distance or the number, the
                nearest objects to it are listed. None lists all entities except egos.
            unique_id: returns an ego's id on the wire, by its row.

        Returns:
            A morai_msgs/ObjectStatusList.
        """
        layout = world.derived(self._lay_out)
        if ego_row is not None and layout.num_egos > 1:
            layout = ObjectLayout(world, self._size, (ego_row, unique_id))
        rows, ends = layout.rows, layout.ends
        chosen = None if ego_row is None else choose_listed(world, rows, ego_row, self.profile)
        if chosen is not None:
            rows, ends = rows[chosen], np.searchsorted(chosen, ends).tolist()
        fixed = layout.fixed if chosen is None else [layout.fixed[i] for i in chosen.tolist()]
        header = self.header(world.frame, "ObjectInfo")
        if len(rows) < LATE_FROM:
            return self._objects(header, *in_lists(self._object_statuses(world, rows, fixed), ends))
        figures = self._object_figures(world, rows)
        parts = list(pairwise([0, *ends[:2], len(rows)]))
        lists = [LateList(b - a, partial(self._statuses_of, figures[:, a:b], fixed, a)) for a, b in parts]
        return self._objects(header, *map(len, lists), *lists)

    def object_lists(self, world: World) -> tuple[Any, ...]:
        """Return all vehicles, pedestrians and obstacles.

        Args:
            world: read only.

        Returns:
            The three numbers, then the three lists of morai_msgs/ObjectStatus.
        """
        layout = world.derived(self._lay_out)
        return in_lists(self._object_statuses(world, layout.rows, layout.fixed), layout.ends)

    def collision_data(self, world: World, rows: IntArray, unique_id: UniqueId) -> Struct:
        """Return the objects that an ego touches, and the position of the first of them.

        Args:
            world: read only.
            rows: (k,) rows of the touched objects.
            unique_id: returns the id on the wire, by row.

        Returns:
            A morai_msgs/CollisionData.
        """
        touched = self._any_statuses(world, rows, unique_id)
        place = touched[0].position if touched else self._at_rest
        return self._collision(self.header(world.frame, "base_link"), place.x, place.y, place.z, touched, touched)

    def vehicle_collision_data(self, world: World, pairs: IntArray, unique_id: UniqueId) -> Struct:
        """Return the collisions between vehicles.

        Args:
            world: read only.
            pairs: (k, 2) rows of vehicles that touch each other.
            unique_id: returns the id on the wire, by row.

        Returns:
            A morai_msgs/VehicleCollisionData with a collision for each pair.
        """
        both = self._any_statuses(world, pairs.ravel(), unique_id)
        collisions = [self._crash(both[i : i + 2]) for i in range(0, len(both), 2)]
        return self._crashes(self.header(world.frame, "VehicleCollisionData"), collisions)

    def vehicle_spec(self, body: Body | None) -> Struct:
        """Return the size and steering limit of a vehicle. The size is (length, width, height) in any profile.

        Args:
            body: of the vehicle; None gives zeros.

        Returns:
            A morai_msgs/VehicleSpec.
        """
        if body is None:
            return self._vehicle_spec(self._vector(0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
        return self._vehicle_spec(
            self._vector(body.length, body.width, body.height),
            round32(body.wheelbase),
            math.degrees(body.max_steer),
            round32(body.front_overhang),
            round32(body.rear_overhang),
        )

    def map_spec(self, road_map: RoadMap) -> Struct:
        """Return the projection of a map.

        Returns:
            A morai_msgs/MapSpec.
        """
        projection = road_map.projection
        return self._map_spec(
            1 if projection.is_tm else 0,
            projection.zone,
            self._vector(*road_map.origin),
            projection.ellipse,
            projection.central_latitude,
            projection.central_meridian,
            projection.scale_factor,
            projection.false_easting,
            projection.false_northing,
        )

    # In

    def control(self, command: Struct) -> Control:
        """Read a CtrlCmd.

        Args:
            command: a generated struct.

        Returns:
            The control in the world's units.

        Raises:
            FieldError: an unknown `longlCmdType`, or a number that is not finite in any field.
        """
        mode = MODES.get(command.longlCmdType)
        if mode is None:
            raise FieldError(
                "morai_msgs/CtrlCmd.longlCmdType: expected 1 (throttle), 2 (velocity) or 3 (acceleration),"
                f" got {command.longlCmdType}"
            )
        steer = getattr(command, self.steering)
        rear_steer = command.rear_steer if self._has_rear_steer else 0.0
        throttle, brake, velocity, accel = command.accel, command.brake, command.velocity, command.acceleration
        if not math.isfinite(throttle + brake + steer + rear_steer + velocity + accel):  # or the sum is too large
            for name in ("accel", "brake", self.steering, "rear_steer", "velocity", "acceleration"):
                figure = getattr(command, name, 0.0)
                if not math.isfinite(figure):
                    raise FieldError(f"morai_msgs/CtrlCmd.{name}: expected a finite number, got {figure}")
        return Control(mode, steer, throttle, brake, velocity / MPS_TO_KMH, accel, rear_steer)

    # Inside

    def _wheel_angle(self, world: World, row: int, _lane: LateralPlace) -> float:
        return world.steer.item(row) * self._wheel_factor

    def _lay_out(self, world: World) -> ObjectLayout:
        return ObjectLayout(world, self._size)

    def _size(self, body: Body) -> Struct:
        first, second = (body.width, body.length) if self._is_width_first else (body.length, body.width)
        return self._vector(first, second, body.height)

    def _any_statuses(self, world: World, rows: IntArray, unique_id: UniqueId) -> list[Any]:
        """Return an ObjectStatus for each row, of any kind. The rows are few, so nothing is cached."""
        fixed = [
            (unique_id(row), OBJECT_TYPES[Kind(world.kind.item(row))], world.names[row], self._size(world.bodies[row]))
            for row in rows.tolist()
        ]
        return self._object_statuses(world, rows, fixed)

    def _object_statuses(self, world: World, rows: IntArray, fixed: list[tuple[int, int, str, Any]]) -> list[Any]:
        """Return an ObjectStatus for each row.

        Structs with equal content are shared, because messages are never changed. Velocity and acceleration are those
        of the point at `position`, in the object's own frame.
        """
        return self._statuses_of(self._object_figures(world, rows), fixed) if fixed else []

    def _object_figures(self, world: World, rows: IntArray) -> FloatArray:
        """Return heading, velocity, acceleration and place of rows in units of the wire, (10, k), as copies."""
        figures = np.empty((10, len(rows)))
        np.degrees(world.yaw[rows], out=figures[0])
        figures[1:7] = motion(world, rows)
        figures[1:4] *= self._speed_factor
        for i, column in enumerate((world.x, world.y, world.z), start=7):
            column.take(rows, out=figures[i])
        return figures

    def _statuses_of(
        self, figures: FloatArray, fixed: Sequence[tuple[int, int, str, Any]], first: int = 0
    ) -> list[Any]:
        """Return an ObjectStatus for each column of `_object_figures`; the constant parts begin at `fixed[first]`."""
        vector, status = self._vector, self._object
        at_rest = self._at_rest
        fixed = fixed[first : first + figures.shape[1]]
        return [
            status(
                *(uid, kind, name, heading),
                vector(u, v, w) if u or v or w else at_rest,
                vector(a, b, c) if a or b or c else at_rest,
                size,
                vector(x, y, z),
            )
            for (uid, kind, name, size), heading, u, v, w, a, b, c, x, y, z in zip(
                fixed, *figures.tolist(), strict=True
            )
        ]


def late_maker(store: Store, type_name: str, names: str) -> Callable[..., Any]:
    """Return the same as `maker`, but compile the type at the first call: most servers send no such message.

    A call costs 0.1 us more, so what is made for each object of each frame has `maker`.
    """
    made: list[Callable[..., Any]] = []

    def make(*values: object) -> object:
        if not made:
            made.append(maker(store, type_name, names))
        return made[0](*values)

    return make


def maker(store: Store, type_name: str, names: str) -> Callable[..., Any]:
    """Return a function that makes structs of a type from field values in a fixed order.

    The function is the struct class itself if the type begins with just these fields, as in the newest release that has
    them all. In an older release the last fields are left out. A user's own definitions may differ in any way: fields
    that
    the type lacks are left out, and other fields get their defaults.

    Args:
        store: has the type.
        type_name: package and type.
        names: the fields with blanks between them, in the order of the function's arguments.

    Returns:
        A function of as many positional arguments.
    """
    struct = store.message(type_name).struct_type
    fields = struct.__struct_fields__
    wanted = tuple(names.split())
    if fields[: len(wanted)] == wanted:
        return struct
    num = sum(name in fields for name in wanted)
    if fields[:num] == wanted[:num]:
        return lambda *values: struct(*values[:num])
    places = [(i, name) for i, name in enumerate(wanted) if name in fields]
    return lambda *values: struct(**{name: values[i] for i, name in places})
