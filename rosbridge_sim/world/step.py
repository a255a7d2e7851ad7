"""One step of the world, 20 ms, in a fixed order.

The order is part of the behaviour. Two runs agree to the bit because a step depends on the arrays alone, and because
each module sees the same half-finished world at the same point. So the order stands in this file alone:

1. *Lights* (`Signals.advance`) show what belongs to the frame that is being made.
2. *Starts* (`waiting.start`): rows that wait at rest for an ego start, by the positions of the egos at the end of the
   last step, so that they move in this one.
3. *Agents*: lane followers (`lane_following.drive_lanes`) come first, because they look at other entities and must see
   the world as it was at the end of the last step. Then the rows on paths that heed others decide
   (`careful_driving.mind_the_path`, `people.walk`), and all rows on paths and in constant motion move
   (`path_following.follow_paths`).
4. *Loose rows* (`impacts.slide`), which an impact has thrown off their lane, and
   *driven rows* (`dynamics.drive`): the present commands act for exactly one step. A command that came between two
   steps acts for the whole of the next one, and the state that a client reads after it already shows it.
5. *Ground* (`standing.stand`): what has moved is put onto the surface of the roads, if these are not flat.
6. *Placed rows*: a caller with recorded or foreign motion places its rows where they are at the end of this step. They
   are placed before collision detection, so swept contacts are found.
7. *Contacts* (`collisions.find`): all pairs that have touched within the step. It moves nothing.
   *Impacts* (`impacts.collide`), if they are wanted: the pairs that touched change their motion from that moment on.
8. *Scores* (`score.judge`) of the egos, while they are kept: they look at all of the above. They move nothing.
9. *Frame counter*: it comes last, so that a reader that finds frame f finds the world of frame f.

A step draws no random number, reads no clock and allocates no memory that stays.
"""

from __future__ import annotations

from collections.abc import Callable

from rosbridge_sim.world import scoring as score
from rosbridge_sim.world.contacts import collisions, impacts
from rosbridge_sim.world.followers.careful_driving import INTERVAL, PATH_OFFSET, mind_the_path
from rosbridge_sim.world.followers.lane_following import drive_lanes
from rosbridge_sim.world.followers.path_following import follow_paths
from rosbridge_sim.world.followers.waiting import start
from rosbridge_sim.world.people.people import WALK_OFFSET, walk
from rosbridge_sim.world.state.standing import stand
from rosbridge_sim.world.state.world import DT
from rosbridge_sim.world.state.world_rows import WorldRows
from rosbridge_sim.world.vehicle.dynamics import drive


def step(world: WorldRows, place: Callable[[], None] | None = None) -> None:
    """Move the world from its frame to the next one: exactly 20 ms. Writes in place.

    Args:
        world: written in place.
        place: called within the step to place rows; see the head of this file.
    """
    before = collisions.remember(world)
    unscored = score.remember(world) if world.is_scoring else None
    world.signals.advance(world.frame + 1)
    start(world)
    drive_lanes(world, DT)
    if world.frame % INTERVAL == PATH_OFFSET:
        mind_the_path(world)
    elif world.frame % INTERVAL == WALK_OFFSET:
        walk(world)
    follow_paths(world, DT)
    if world.has_impacts:
        impacts.slide(world, DT)
    drive(world, DT)
    if not world.roads.is_flat:
        stand(world, before.poses[0], DT)
    if place is not None:
        place()
    found = collisions.find(world, before)
    if world.has_impacts:
        impacts.collide(world, DT)
        collisions.keep_poses(world, found)
    if unscored is not None:
        score.judge(world, unscored)
    world.count_frame()
