"""The crossings of known paths: those of each path, found once, while others come and go."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.people import known_crossings
from rosbridge_sim.world.people.crossings import Crossings, find_crossings
from rosbridge_sim.world.people.known_crossings import FARTHEST, KnownCrossings
from rosbridge_sim.world.roads.paths import X
from rosbridge_sim.world.state.world import World
from tests.world.lane_drives import world_of
from tests.world.people.test_people import OVER, walker
from tests.world.road_factory import road

BESIDE = np.array([[40.0, 12.0], [60.0, 12.0]])


BACK = np.array([[50.0, -12.0], [50.0, 12.0], [55.0, 12.0], [55.0, -12.0]])


def walk(world: World, path: np.ndarray, east: float) -> int:
    """Return the id of a new pedestrian with a path that is moved to the east by so much [m]."""
    row = walker(world, path + np.array([east, 0.0]))
    return int(world.uid[row])


def walk_one_of(world: World, i: int) -> int:
    """Return the id of a new pedestrian whose path has no crossing, one or two."""
    return walk(world, (BESIDE, OVER, BACK)[i % 3], 0.1 * i)


def searched(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return where the paths begin that are searched for crossings from now on [m]."""
    begins: list[float] = []

    def find(segments: np.ndarray, *rest: object) -> Crossings:
        begins.append(float(segments[0, X]))
        return find_crossings(segments, *rest)  # type: ignore[arg-type] # passed on as they are

    monkeypatch.setattr(known_crossings, "find_crossings", find)
    return begins


def as_rows(found: Crossings) -> np.ndarray:
    return np.column_stack([found.start, found.end, found.light, found.ends])


def test_each_path_has_its_own_crossings_in_any_order_and_number() -> None:
    world = world_of(road())
    uids = [walk_one_of(world, i % 12) for i in range(24)]
    known = KnownCrossings(world.roads)
    chance = np.random.default_rng(0)
    for num in (1, 5, 0, 24, 24, 9):
        chosen = chance.permutation(uids)[:num].tolist()
        count, found = known.of([world] * num, chosen)
        wanted = [find_crossings(world.paths.of(uid), world.roads, world.plan, FARTHEST) for uid in chosen]
        assert count.tolist() == [len(each.start) for each in wanted]
        assert {len(each.start) for each in wanted} <= {0, 1, 2}
        assert np.array_equal(as_rows(found), np.concatenate([np.empty((0, 7)), *map(as_rows, wanted)]))


def test_path_is_searched_once_whoever_comes_goes_or_is_restored(monkeypatch: pytest.MonkeyPatch) -> None:
    begins = searched(monkeypatch)
    world = world_of(road())
    uids = [walk(world, OVER, i) for i in (0, 1, 1, 2)]
    known = KnownCrossings(world.roads)

    def ask(*uids: int) -> None:
        known.of([world] * len(uids), uids)

    ask(*uids)
    assert begins == [50.0, 51.0, 52.0]
    saved = world.snapshot()
    world.remove(uids[0])
    ask(*uids[1:])
    world.restore(saved)
    ask(*uids)
    other = World()
    other.lay_roads(world.roads)
    known.of([other], [walk(other, OVER, 2.0)])
    assert len(begins) == 3
    # An entity of the same number with another path is not taken for the one before.
    world.paths.remove(uids[3])
    moved = world.paths.of(uids[1]).copy()
    moved[:, X] += 7.0
    world.paths.add(uids[3], moved)
    ask(*uids)
    assert begins[3:] == [58.0]


def test_crossings_of_the_paths_in_use_stay_known_beside_any_number_of_others(monkeypatch: pytest.MonkeyPatch) -> None:
    begins = searched(monkeypatch)
    monkeypatch.setattr(known_crossings, "MAX_KNOWN", 16)
    world = world_of(road())
    uids = [walk_one_of(world, i) for i in range(10)]
    known = KnownCrossings(world.roads)
    for i in range(30):
        other = walk(world, OVER, 20.0 + 0.1 * i)
        count, _ = known.of([world] * 11, [*uids, other])
        assert count.tolist() == [0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1]
        assert len(known._table.numbers) <= 16
        world.remove(other)
    assert len(begins) == 10 + 30
