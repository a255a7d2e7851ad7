"""`/robot_description` and the parameter of that name: an ego with its wheels and sensors, as URDF.

Links have the names of the frames on `/tf` and `/tf_static`, and joints their poses, because both are made from the
same mounts. So viewers such as RViz and Foxglove show the car without a `robot_state_publisher`. A wheel is a
`revolute` joint about z: the world's wheels are steered, and nothing says how far they have rolled. The description is
made anew if a sensor comes, goes or moves, and with another model.

The parameter is `/robot_description` in ROS 1, and `robot_description` of the simulator's node in ROS 2.
Source of the format: http://wiki.ros.org/urdf/XML
"""

from __future__ import annotations

import logging
import math
import re
from typing import Final

import orjson

from rosbridge_sim.errors import GraphError
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.scenery.moving.vehicle_shapes import TRACK, WHEELS
from rosbridge_sim.scenery.scene_frame import shape_of
from rosbridge_sim.simulator.bus.publisher_kinds import LatchedPublisher
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.egos.ego import Ego, ego_prefix
from rosbridge_sim.simulator.egos.tf_publisher import BASE, CENTER, WHEEL_FRAMES, Wheel
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.world.state.labels import usual_wheelbase
from rosbridge_sim.world.state.world import Kind, World
from rosbridge_sim.world.vehicle.sensor_readings import Mounting

NAME: Final = "robot_description"

SENSOR_SIZE: Final = 0.08
"""Edge of the cube that represents a sensor [m]: visible, and no larger than a camera."""

_UNUSED_LIMITS: Final = 'effort="1000" velocity="1"'
"""Limits that URDF requires of a `revolute` joint; nothing uses them here [N m, rad/s]."""

_MATERIALS: Final = tuple(
    f'  <material name="{name}"><color rgba="{rgba}"/></material>'
    for name, rgba in (("body", "0.20 0.35 0.60 1"), ("tyre", "0.05 0.05 0.05 1"), ("sensor", "0.85 0.35 0.10 1"))
)
_NOT_IN_XML: Final = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd]")

_log = logging.getLogger("rosbridge_sim.morai")


def find_wheels(world: World, ego: Ego) -> list[Wheel]:
    """Return the wheels of an ego, in the order of `WHEEL_FRAMES`; none for a two-wheeler."""
    body = world.bodies[ego.row]
    shares = WHEELS.get(shape_of(Kind.EGO, world.names[ego.row], body))
    if shares is None:
        return []
    radius, width, aside = shares[0] * body.height, shares[1] * body.width, 0.5 * TRACK * body.width
    axles = (usual_wheelbase(body), body.max_steer), (0.0, body.max_rear_steer)
    ends = [(x, y, steer) for x, steer in axles for y in (aside, -aside)]
    names = zip(WHEEL_FRAMES, ends, strict=True)
    return [Wheel(name, (x, y, radius), radius, width, steer) for name, (x, y, steer) in names]


class RobotDescription(Component):
    """Component of the descriptions, one for each ego. The texts derive from the egos, so it has no state."""

    def __init__(self, context: SimulatorContext) -> None:
        """Describe nothing before the frames of the egos are announced."""
        self._context = context
        self._topics: dict[int, LatchedPublisher] = {}  # by the egos' numbers
        self._texts: dict[int, str] = {}
        self._string = maker(context.bus.store, "std_msgs/String", "data")
        context.static_tf.on_announce.append(self._announce)

    def publish_ego(self, ego: Ego, prefix: str, publishers: Publishers) -> None:
        """Publish the description of an ego; others may publish there, as a `robot_state_publisher` does."""
        self._topics[ego.index] = publishers.keep(prefix + NAME, "std_msgs/String", is_exclusive=False)
        self._texts.pop(ego.index, None)

    def describe(self, ego: Ego) -> str:
        """Return the URDF of an ego."""
        context = self._context
        world = context.world
        body, prefix = world.bodies[ego.row], ego.frame_prefix
        parts = [f'  <link name="{_clean(prefix + BASE)}"/>']
        wheels = find_wheels(world, ego)
        clearance = wheels[0].radius if wheels else 0.0
        for mount in context.static_tf.mounts_of(ego):
            shapes = ""
            if mount.name == prefix + CENTER:
                seen = _box(body.length, body.width, body.height - clearance)
                shapes = _shape("visual", seen, Mounting(z=0.5 * clearance), "body")
                shapes += _shape("collision", _box(body.length, body.width, body.height), Mounting())
            elif mount.parent == prefix + BASE:
                shapes = _shape("visual", _box(*[SENSOR_SIZE] * 3), Mounting(), "sensor")
            parts += _joined(mount.parent, mount.name, mount.mounting, shapes)
        for wheel in wheels:
            tyre = f'<cylinder radius="{wheel.radius!r}" length="{wheel.width!r}"/>'
            on_its_side = Mounting(roll=0.5 * math.pi)  # a cylinder stands along z
            shapes = _shape("visual", tyre, on_its_side, "tyre") + _shape("collision", tyre, on_its_side)
            at = Mounting(*wheel.place)
            parts += _joined(prefix + BASE, prefix + wheel.name, at, shapes, max_steer=wheel.max_steer)
        robot = _clean(world.names[ego.row]) or "ego"
        lines = ['<?xml version="1.0"?>', f'<robot name="{robot}">', *_MATERIALS, *parts, "</robot>", ""]
        return "\n".join(lines)

    def _announce(self, now: float) -> None:
        """Publish the descriptions that have changed."""
        context, parameters = self._context, self._context.bus.parameters
        egos = {ego.index: ego for ego in context.egos}
        for index in sorted(self._topics.keys() - egos.keys()):
            del self._topics[index]
            self._texts.pop(index, None)
            if (name := self._parameter(index)) in parameters:
                parameters.remove([name])
        for index, ego in egos.items():
            text = self.describe(ego)
            if text == self._texts.get(index):
                continue
            self._texts[index] = text
            context.publishers.update(self._topics[index], self._string(text), now)
            try:
                parameters.put(self._parameter(index), orjson.dumps(text).decode(), context.participant)
            except GraphError as error:
                _log.warning("the parameter %s is not set: %s", self._parameter(index), error)

    def _parameter(self, index: int) -> str:
        """Return the name of the parameter for an ego, as rosapi has it."""
        name = ego_prefix(index) + NAME
        return name if self._context.bus.store.ros == 1 else f"{self._context.participant.name}:{name[1:]}"


def _joined(parent: str, name: str, at: Mounting, shapes: str, *, max_steer: float | None = None) -> tuple[str, str]:
    """Return a link and the joint that it hangs on, which turns about z up to an angle or is fixed."""
    name, parent = _clean(name), _clean(parent)
    kind, rest = "fixed", ""
    if max_steer is not None:
        bounds = f'lower="{-max_steer!r}" upper="{max_steer!r}" {_UNUSED_LIMITS}'
        kind, rest = "revolute", f'<axis xyz="0 0 1"/><limit {bounds}/>'
    ends = f'<parent link="{parent}"/><child link="{name}"/>'
    return (
        f'  <link name="{name}">{shapes}</link>',
        f'  <joint name="{name}_joint" type="{kind}">{ends}{_origin(at)}{rest}</joint>',
    )


def _shape(kind: str, geometry: str, at: Mounting, material: str = "") -> str:
    """Return the visual or the collision element of a link."""
    painted = f'<material name="{material}"/>' if material else ""
    return f"<{kind}>{_origin(at)}<geometry>{geometry}</geometry>{painted}</{kind}>"


def _box(length: float, width: float, height: float) -> str:
    return f'<box size="{length!r} {width!r} {height!r}"/>'


def _origin(at: Mounting) -> str:
    """Return a pose; URDF turns about fixed axes by roll, pitch and yaw, which is the order of a `Mounting`, too."""
    return f'<origin xyz="{at.x!r} {at.y!r} {at.z!r}" rpy="{at.roll!r} {at.pitch!r} {at.yaw!r}"/>'


def _clean(name: str) -> str:
    """Return a name as XML has it in quotes, without what XML cannot have; a snapshot may name sensors in any way."""
    from html import escape  # noqa: PLC0415 - a table of 2,000 names, imported for the first description

    return escape(_NOT_IN_XML.sub("_", name))
