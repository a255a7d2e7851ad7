"""Message types, the package's maps, and what worlds compute of their roads: made once, before tests are forked.

All of it never changes. Each fork would make it for itself, in two seconds of CPU time.
"""

from __future__ import annotations

from rosbridge_sim.world.step import step
from tests.schema.strategies import all_types
from tests.simulator.sim_harness import make_store
from tests.world.lane_drives import world_of
from tests.world.road_factory import MAPS, built_in, car

__all__ = ["prepare"]


def prepare() -> None:
    """Make it in this process."""
    for release in ("22.R2", "26.R1"):
        make_store(release, 1)
        make_store(release, 2)
    for ros in (1, 2):
        all_types(ros)
    for folder in sorted(MAPS.iterdir()):
        road_map = built_in(folder.name)
        world = world_of(road_map.roads, road_map.plan)
        for lane in road_map.roads.ids[:2]:
            car(world, lane, 5.0)
        for _ in range(10):  # drivers decide in each fifth frame
            step(world)
