"""One step of the world, 20 ms, in a fixed order.

The order is part of what the world *is*: two runs agree to the bit only because nothing here depends on anything but
the arrays, and because everybody sees the same half-finished world at the same point. So it stands here alone:

1. *lights* (`Signals.advance`): they show what belongs to the frame that is being made.
2. *starts*: rows that wait at rest for an ego start (`waiting.start`), by where the egos were at the end of the last
   step, so that they move in this one.
3. *agents*: drivers who keep to the lanes (`traffic.drive_lanes`) first, since they look at others and shall judge the
   world as it was at the end of the last step, as everyone on a road judges by what he saw a moment ago; then those who
   go their own way and look at nobody (`walking.walk`).
4. *driven rows* (`dynamics.drive`): the commands in force are carried out for exactly one step. A command that came
   between two steps counts for the whole of the next one, and the state that a client reads after it already shows it.
5. *whoever is placed*: a caller that has recorded or foreign motion to show puts its rows where they stand at the end
   of this step. Here, so that whom they pass on the way there they have met.
6. *contacts* (`collisions.find`): when all stand where they stand at the end of the step, who has touched whom on the
   way there. It moves nobody.
7. *bookkeeping*: the frame counter, last, so that whoever finds frame f finds the world of frame f.

A step draws no random number, reads no clock and allocates nothing that stays.
"""

from __future__ import annotations

from collections.abc import Callable

from rosbridge_sim.world import collisions
from rosbridge_sim.world.dynamics import drive
from rosbridge_sim.world.lane_following import drive_lanes
from rosbridge_sim.world.path_following import walk
from rosbridge_sim.world.state import DT, World
from rosbridge_sim.world.waiting import start

__all__ = ["step"]


def step(world: World, place: Callable[[], None] | None = None) -> None:
    """Move the world from its frame to the next one: exactly 20 ms. Writes in place.

    Args:
        world: whose.
        place: called within the step to place rows; see above.
    """
    before = collisions.remember(world)
    world.signals.advance(world.frame + 1)
    start(world)
    drive_lanes(world, DT)
    walk(world, DT)
    drive(world, DT)
    if place is not None:
        place()
    collisions.find(world, before)
    world.frame += 1
