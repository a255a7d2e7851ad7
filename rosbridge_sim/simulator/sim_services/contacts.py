"""The component of `/sim/collisions`: one message for each pair of entities that has begun to touch.

`/CollisionData` tells with each frame what an ego touches. This topic tells of a collision once, so a program need not
compare frames to count them.
"""

from __future__ import annotations

import logging
import math
from typing import Final

import numpy as np

from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.bus.publisher_kinds import PeriodicPublisher
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.state.world import NO_CONTACTS, World

COLLISIONS: Final = "/sim/collisions"

MAX_AT_ONCE: Final = 100
"""Messages of one frame at most, the first ones by id: they take 1 ms. More at once is a heap that was spawned so."""

_log = logging.getLogger("rosbridge_sim.morai")


class Contacts(Component):
    """The component of new contacts. Its state is the contacts of the frame before, which are the world's."""

    def __init__(self, context: SimulatorContext) -> None:
        self._context = context
        self._publisher: PeriodicPublisher | None = None
        self._before: IntArray = NO_CONTACTS
        self._make = context.maker("rosbridge_sim_msgs/Contact", "header frame id kind name x y z relative_speed")
        context.hooks.after_frame.append(self._after_frame)
        context.bus.on_topic.append(self._note_subscriber)
        self._is_following = True
        context.world.on_heap = self._tell_of_heap
        for moments in (context.hooks.on_reset, context.hooks.on_restore):
            moments.append(self._follow)

    def publish(self, publishers: Publishers) -> None:
        """Publish the topic that exists once, not for each ego."""
        self._publisher = publishers.add(COLLISIONS, "rosbridge_sim_msgs/Contact", lambda: None)

    def _note_subscriber(self, _topic: Topic) -> None:
        """Look at the frames that follow, because the topic may have a subscriber now."""
        if not self._is_following:
            self._is_following = True
            self._follow()
            self._context.hooks.after_frame.wake(self._after_frame)

    def _follow(self) -> None:
        """Take the world's contacts for known ones."""
        self._before = self._context.world.contacts

    def _tell_of_heap(self) -> None:
        """Tell once that only a part of the contacts is found."""
        world = self._context.world
        world.on_heap = None
        _log.warning(
            "frame %d: thousands of entities lie on top of one another; a part of their contacts is found, and all "
            "contacts elsewhere. This is told once",
            world.frame + 1,
        )

    def _after_frame(self, now: float) -> None:
        world = self._context.world
        before, self._before = self._before, world.contacts
        topic = None if self._publisher is None else self._publisher.topic
        if topic is None or not topic.subscriptions:
            self._is_following = False
            self._context.hooks.after_frame.rest(self._after_frame)
            return
        if not len(world.contacts) or not topic.has_listener:
            return
        known = set(map(tuple, before.tolist()))
        begun = [pair for pair in map(tuple, world.contacts.tolist()) if pair not in known]
        for first, second in begun[:MAX_AT_ONCE]:
            # An entity may have gone since the step: a command or a listener of the frame has taken it away.
            if first in world and second in world:
                message = Message(topic.type, self._message(world, world.row(first), world.row(second)))
                self._context.bus.announce(self._context.participant, topic, message, now)

    def _message(self, world: World, first: int, second: int) -> Struct:
        rows = [first, second]
        x, y = _place(world, first, second)
        speed, yaw = world.speed[rows], world.yaw[rows]
        velocity = (speed + 1j * world.lateral_speed[rows]) * np.exp(1j * yaw)
        return self._make(
            self._context.convert.header(world.frame, "map"),
            world.frame,
            [self._context.egos.unique_id(row) for row in rows],
            bytes(world.kind[rows].tolist()),
            [world.names[row] for row in rows],
            x,
            y,
            float(world.z[rows].max()),
            abs(complex(velocity[1] - velocity[0])),
        )


def _place(world: World, first: int, second: int) -> tuple[float, float]:
    """Return about where two boxes touch, east and north [m]: between the points of each that are nearest to the other.

    Args:
        world: read only.
        first: row of the one.
        second: row of the other.
    """
    middles = [_middle(world, row) for row in (first, second)]
    nearest = [
        _nearest_in_box(world, row, other) for row, other in zip((first, second), reversed(middles), strict=True)
    ]
    place = 0.5 * (nearest[0] + nearest[1])
    return place.real, place.imag


def _middle(world: World, row: int) -> complex:
    """Return the middle of a box, east + i north [m]."""
    yaw, centre = world.yaw.item(row), world.centre.item(row)
    return complex(world.x.item(row) + centre * math.cos(yaw), world.y.item(row) + centre * math.sin(yaw))


def _nearest_in_box(world: World, row: int, point: complex) -> complex:
    """Return the point of a box that is nearest to a point, east + i north [m]."""
    yaw = world.yaw.item(row)
    heading = complex(math.cos(yaw), math.sin(yaw))
    middle = _middle(world, row)
    apart = (point - middle) * heading.conjugate()
    half_length, half_width = world.half_length.item(row), world.half_width.item(row)
    along = max(-half_length, min(half_length, apart.real))
    across = max(-half_width, min(half_width, apart.imag))
    return middle + complex(along, across) * heading
