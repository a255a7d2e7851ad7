from __future__ import annotations

import math
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.records import replace
from rosbridge_sim.world.contacts import collisions
from rosbridge_sim.world.contacts.collisions import LIFE, MARGIN, MAX_PAIRWISE, TURN_MARGIN
from rosbridge_sim.world.geometry import near_pairs
from rosbridge_sim.world.geometry.planar import BoolArray, ComplexArray, do_boxes_meet, wrap_angle
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import DT, Body, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.mutations import examples

CAR = Body()
NOSE = CAR.length - CAR.rear_overhang  # from the reference point to the front [m]
POST = Body.box(0.05, 0.05, 1.0)
MAN = Body.box(0.45, 0.55, 1.7)
FAST = 250.0 / 3.6


def pairs(world: World) -> list[tuple[int, int]]:
    return [(int(a), int(b)) for a, b in world.contacts]


def meetings(world: World, num_steps: int) -> list[int]:
    """The frames in which anybody touches anybody."""
    frames = []
    for _ in range(num_steps):
        step(world)
        if len(world.contacts):
            frames.append(world.frame)
    return frames


# What touches


@pytest.mark.parametrize(
    ("x", "y", "yaw", "is_touching"),
    [
        (0.0, 0.0, 0.0, True),
        (4.46, 0.0, 0.0, True),
        (4.48, 0.0, 0.0, False),
        (4.47, 0.0, 0.0, False),  # edge to edge
        (0.0, 1.82, 0.0, False),
        (0.0, 1.81, 0.0, True),
        (0.0, -1.83, math.pi, False),
        (NOSE + 0.92, 1.3, math.pi / 2, False),  # across, the side before the nose
        (NOSE + 0.90, 1.3, math.pi / 2, True),
        (NOSE + 2.95, 2.95, math.radians(225.0), True),  # a corner alone, into a nose that comes askew
        (NOSE + 3.05, 3.05, math.radians(225.0), False),
    ],
)
def test_boxes_are_in_contact_if_they_overlap(x: float, y: float, yaw: float, *, is_touching: bool) -> None:
    world = World()
    world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0)
    world.spawn(Kind.VEHICLE, CAR, name="npc", x=x, y=y, yaw=yaw)
    step(world)
    assert pairs(world) == ([(1, 2)] if is_touching else [])


def test_entity_on_a_bridge_is_no_contact_and_a_low_object_is() -> None:
    world = World()
    world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0)
    world.spawn(Kind.VEHICLE, CAR, name="above", x=0.0, y=0.0, z=CAR.height + 0.01)
    world.spawn(Kind.OBSTACLE, POST, name="below", x=0.0, y=0.0, z=-1.01)
    world.spawn(Kind.OBSTACLE, POST, name="kerb", x=0.0, y=0.0, z=-0.99)
    step(world)
    assert pairs(world) == [(1, 4)]


def test_contacts_among_pedestrians_and_obstacles_are_not_reported() -> None:
    world = World()
    for kind in (Kind.PEDESTRIAN, Kind.OBSTACLE, Kind.PEDESTRIAN, Kind.VEHICLE):
        world.spawn(kind, MAN if kind != Kind.VEHICLE else CAR, name="x", x=0.0, y=0.0)
    step(world)
    assert pairs(world) == [(1, 4), (2, 4), (3, 4)]


def test_contact_moves_no_entity() -> None:
    alone, crowded = World(), World()
    for world in (alone, crowded):
        row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0))
        command(world, row, mode=Mode.SPEED, speed=20.0, steer=0.05)
    crowded.spawn(Kind.OBSTACLE, Body.box(30.0, 30.0, 3.0), name="house", x=20.0, y=0.0)
    for world in (alone, crowded):
        for _ in range(200):
            step(world)
    assert pairs(crowded) == [(1, 2)]
    assert [column[0] for column in alone.block("x", "z")] == [column[0] for column in crowded.block("x", "z")]


# What passes


@pytest.mark.parametrize("offset", np.linspace(0.0, FAST * DT, 4).tolist())
def test_thin_object_is_not_tunnelled_at_250_kmh(offset: float) -> None:
    world = World()
    row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=offset, y=0.0, speed=FAST))
    command(world, row, mode=Mode.SPEED, speed=FAST, steer=0.0)
    # The corner of the bumper goes over an edge of the post by a centimetre, and over its whole depth at once.
    world.spawn(Kind.OBSTACLE, POST, name="post", x=100.0, y=0.91 + 0.025 - 0.01)
    frames = meetings(world, 100)
    assert frames == list(range(frames[0], frames[-1] + 1))
    assert (CAR.length + 0.05) / (FAST * DT) <= len(frames) <= (CAR.length + 0.05) / (FAST * DT) + 2


@pytest.mark.parametrize("gap", np.linspace(200.0, 200.0 + 2 * FAST * DT, 4).tolist())
def test_two_thin_objects_head_on_at_250_kmh_collide(gap: float) -> None:
    plate = Body(0.05, 1.8, 1.4, wheelbase=0.0, front_overhang=0.025, rear_overhang=0.025)
    world = World()
    world.spawn(Kind.VEHICLE, plate, name="a", x=0.0, y=0.0, speed=FAST)
    world.spawn(Kind.VEHICLE, plate, name="b", x=gap, y=1.7, yaw=math.pi, speed=FAST)
    frames = meetings(world, 200)
    assert len(frames) in {1, 2}
    assert frames[0] == pytest.approx(gap / 2 / FAST / DT, abs=1.1)


def test_two_cars_head_on_at_250_kmh_collide_from_bumper_to_bumper() -> None:
    world = World()
    for x, yaw in ((0.0, 0.0), (300.0, math.pi)):
        world.spawn(Kind.VEHICLE, CAR, name="npc", x=x, y=0.0, yaw=yaw, speed=FAST)
    frames = meetings(world, 200)
    apart = 300.0 - 2 * NOSE
    assert frames[0] == math.ceil(apart / (2 * FAST * DT))
    assert frames[-1] == math.ceil((apart + 2 * CAR.length) / (2 * FAST * DT))


def test_crossing_within_a_step_is_a_contact_and_a_near_miss_is_not() -> None:
    thin = Body(0.4, 0.05, 1.0, wheelbase=0.0, front_overhang=0.2, rear_overhang=0.2)
    for delay, is_hit in ((0.0, True), (0.35, True), (0.5, False), (-0.5, False)):
        world = World()
        world.spawn(Kind.VEHICLE, thin, name="a", x=-25.5 * FAST * DT, y=0.0, speed=FAST)
        y = -25.5 * FAST * DT - delay
        world.spawn(Kind.VEHICLE, thin, name="b", x=0.0, y=y, yaw=math.pi / 2, speed=FAST)
        assert bool(meetings(world, 60)) == is_hit, delay


def test_swinging_tail_collides_between_two_frames() -> None:
    # A path with a corner, and axles so near to each other that the car turns by a right angle within one step.
    world = World()
    spinning = replace(CAR, wheelbase=0.1)
    corner = np.array([[-30.0, 0.0], [0.0, 0.0], [0.0, 30.0]])
    world.spawn(Kind.VEHICLE, spinning, name="npc", x=-30.0, y=0.0, speed=10.0, path=corner)
    world.spawn(Kind.OBSTACLE, POST, name="post", x=2.45, y=2.45)
    assert len(meetings(world, 200)) == 1


def test_teleport_collides_with_nothing_on_the_way() -> None:
    world = World()
    row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0))
    world.spawn(Kind.OBSTACLE, POST, name="post", x=50.0, y=0.0)
    for x in (0.0, 100.0, 49.0, 200.0):
        teleport(world, row, x=x, y=0.0, z=0.0, yaw=0.0)
        step(world)
        assert pairs(world) == ([(1, 2)] if x == 49.0 else []), x


def test_contact_is_found_after_a_long_time_without_neighbours() -> None:
    """Lists end when they are old, when somebody brakes, steers or is put elsewhere: never too late."""
    world = World()
    row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0))
    world.spawn(Kind.OBSTACLE, POST, name="post", x=60.0, y=0.0)
    assert meetings(world, 3 * LIFE + 1) == []
    command(world, row, mode=Mode.PEDALS, throttle=1.0, steer=0.0)
    before, first = 0.0, None
    for _ in range(600):
        step(world)
        if first is None and pairs(world):
            first = world.x[row]
            assert first + NOSE >= 60.0 - 0.025
            assert before + NOSE < 60.0 - 0.025
        before = world.x[row]
    assert first is not None


# Who is who


def test_contacts_are_by_id_and_not_by_row() -> None:
    places = {5: 0.0, 3: 4.0, 9: 8.0, 1: 12.0}
    for order in ([5, 3, 9, 1], [1, 3, 5, 9], [9, 5, 1, 3]):
        world = World()
        for uid in order:
            world.spawn(Kind.VEHICLE, CAR, name="npc", x=places[uid], y=0.0, uid=uid)
        step(world)
        assert pairs(world) == [(1, 9), (3, 5), (3, 9)]


def test_removed_entity_has_no_contacts_and_its_reused_row_neither() -> None:
    world = World()
    for x in (0.0, 3.0, 6.0):
        world.spawn(Kind.VEHICLE, CAR, name="npc", x=x, y=0.0)
    step(world)
    assert pairs(world) == [(1, 2), (2, 3)]
    world.remove(2)
    assert pairs(world) == []
    world.spawn(Kind.VEHICLE, CAR, name="npc", x=90.0, y=0.0)
    step(world)
    assert pairs(world) == []


def test_entity_that_stops_within_a_step_is_swept() -> None:
    world = World()
    world.spawn(
        Kind.VEHICLE, CAR, name="npc", x=0.0, y=0.0, speed=FAST, path=np.array([[0.0, 0.0], [FAST * DT / 2, 0.0]])
    )
    world.spawn(Kind.OBSTACLE, Body.box(0.01, 0.01, 1.0), name="pin", x=NOSE + FAST * DT / 2 - 0.005, y=0.0)
    assert meetings(world, 1) == [1]


def test_empty_world_has_no_contacts() -> None:
    world = World()
    step(world)
    assert world.contacts.shape == (0, 2)
    uid = world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0)
    step(world)
    world.remove(uid)
    step(world)
    assert world.contacts.shape == (0, 2)


def test_contacts_are_part_of_the_digest_and_snapshot() -> None:
    world, other = World(), World()
    for x in (0.0, 3.0):
        world.spawn(Kind.VEHICLE, CAR, name="npc", x=x, y=0.0)
    before = world.digest()
    step(world)
    saved = world.snapshot()
    other.restore(saved)
    assert pairs(other) == [(1, 2)]
    assert other.digest() == world.digest() != before
    world.clear()
    assert pairs(world) == []
    assert pairs(other) == [(1, 2)]


# Against a slow twin


def corners(x: float, y: float, yaw: float, body: Body, extra: float) -> list[complex]:
    unit = complex(math.cos(yaw), math.sin(yaw))
    middle = complex(x, y) + unit * body.centre
    a, b = body.length / 2 + extra, body.width / 2 + extra
    return [middle + unit * complex(u * a, v * b) for u, v in ((1, 1), (-1, 1), (-1, -1), (1, -1))]


def are_apart(one: list[complex], other: list[complex]) -> bool:
    for corner, following in (
        *zip(one, one[1:] + one[:1], strict=True),
        *zip(other, other[1:] + other[:1], strict=True),
    ):
        normal = (following - corner) * -1j
        mine, theirs = ([(c * normal.conjugate()).real for c in box] for box in (one, other))
        if min(mine) > max(theirs) or min(theirs) > max(mine):
            return True
    return False


def slowly(poses: list[tuple[list[float], list[float]]], bodies: list[Body], extra: float) -> set[tuple[int, int]]:
    """Who overlaps at any of forty moments of a step, the boxes being larger by `extra` on each side."""
    found = set()
    for part in np.linspace(0.0, 1.0, 40):
        boxes = []
        for (start, end), body in zip(poses, bodies, strict=True):
            turn = math.remainder(end[2] - start[2], math.tau)
            x, y = (start[i] + part * (end[i] - start[i]) for i in (0, 1))
            boxes.append(corners(x, y, start[2] + part * turn, body, extra))
        found |= {(i, j) for i, j in combinations(range(len(boxes)), 2) if not are_apart(boxes[i], boxes[j])}
    return found


MOVERS = st.lists(
    st.tuples(
        st.sampled_from([CAR, POST, MAN, Body(2.1, 0.8, 1.6, front_overhang=0.3, rear_overhang=0.3, wheelbase=1.5)]),
        st.floats(-12.0, 12.0),
        st.floats(-12.0, 12.0),
        st.floats(-math.pi, math.pi),
        st.floats(-80.0, 80.0),
        st.floats(-0.6, 0.6),
    ),
    min_size=2,
    max_size=5,
)


@examples(12)
@given(MOVERS)
def test_one_step_finds_the_contacts_of_many_small_steps(
    movers: list[tuple[Body, float, float, float, float, float]],
) -> None:
    world = World()
    for body, x, y, yaw, speed, steer in movers:
        is_car = body.wheelbase > 0.0
        kind = Kind.EGO if is_car else Kind.PEDESTRIAN
        row = world.row(world.spawn(kind, body, name="x", x=x, y=y, yaw=yaw, speed=speed if is_car else speed / 20))
        if is_car:
            command(world, row, mode=Mode.SPEED, speed=abs(speed), steer=steer)
            world.steer[row] = world.steer_cmd[row]  # the wheels are there already
    bodies = [body for body, *_ in movers]
    for _ in range(3):
        before = world.block("x", "yaw").T.tolist()
        step(world)
        poses = list(zip(before, world.block("x", "yaw").T.tolist(), strict=True))
        found = {(a - 1, b - 1) for a, b in pairs(world)}
        cars = {i for i, body in enumerate(bodies) if body.wheelbase > 0.0}
        # A fortieth of a step is 4 cm: what the twin sees for sure, and what it sees at best.
        surely, perhaps = (
            {pair for pair in slowly(poses, bodies, extra) if cars.intersection(pair)} for extra in (-0.021, 0.05)
        )
        assert surely <= found <= perhaps


def crowd(seed: int, num: int, size: float, world: World | None = None) -> World:
    world, rng = World() if world is None else world, np.random.default_rng(seed)
    bodies = {
        Kind.EGO: CAR,
        Kind.VEHICLE: Body(11.0, 2.5, 3.0, wheelbase=5.0, front_overhang=3.0, rear_overhang=3.0),
        Kind.PEDESTRIAN: MAN,
        Kind.OBSTACLE: Body.box(1.0, 1.0, 1.0),
    }
    for i in range(num):
        kind = Kind(int(rng.integers(1, 4))) if i % 40 else Kind.EGO
        body = Body.box(60.0, 0.3, 2.0) if i % 50 == 7 and kind == Kind.OBSTACLE else bodies[kind]
        x, y, yaw = rng.uniform(-size, size), rng.uniform(-size, size), rng.uniform(-math.pi, math.pi)
        world.spawn(kind, body, name="x", x=x, y=y, yaw=yaw, speed=rng.uniform(0.0, 40.0) * (kind == Kind.VEHICLE))
    return world


@pytest.mark.parametrize(
    ("num", "size"), [(MAX_PAIRWISE, 30.0), (MAX_PAIRWISE + 1, 30.0), pytest.param(400, 120.0, marks=pytest.mark.slow)]
)
def test_neighbour_lists_are_complete(num: int, size: float) -> None:
    fast, slow = crowd(3, num, size), crowd(3, num, size)
    num_seen = 0
    for _ in range(9 if num < 100 else 4):
        step(fast)
        watch = collisions.remember(slow)
        before = slow.block("x", "z").copy()
        fresh = collisions.CollisionDetector(slow)
        step(slow)
        rows = np.argsort(slow.uid)
        i, j = np.triu_indices(len(rows), 1)
        fresh.poses[0] = before
        fresh.poses[1] = slow.block("x", "z")
        everybody = np.stack([rows[i], rows[j]])
        is_car = slow.kind[everybody] <= Kind.VEHICLE
        fresh._list(everybody[:, is_car.any(axis=0)])
        assert fresh._judge().tolist() == fast.contacts.tolist() == slow.contacts.tolist()
        assert watch is slow.derived(collisions.CollisionDetector)
        num_seen += len(fast.contacts)
    assert num_seen > 100


def test_two_entities_that_use_up_their_margins_at_once_collide() -> None:
    """The margin holds each way, east and north: on the diagonal it is longer by the root of two."""
    blade = Body.box(10.0, 0.05, 1.0)
    reach = math.hypot(5.0, 0.025)
    aside, turn = 0.99 * MARGIN, 0.98 * TURN_MARGIN / reach
    widest = 2.0 * (math.sqrt(2.0) * aside + 5.0 * math.sin(turn))  # two tips that come towards each other
    gap = widest - 0.01
    heading = math.radians(45.0)
    world = World()
    left, right = (world.row(world.spawn(Kind.VEHICLE, blade, name="x", x=0.0, y=0.0)) for _ in range(2))
    world.x[left], world.y[left] = -(gap + 0.05) * math.sin(heading), (gap + 0.05) * math.cos(heading)
    world.yaw[[left, right]] = heading
    world.touch()
    for _ in range(2):
        collisions.find(world, collisions.remember(world))
        assert pairs(world) == []
    before = collisions.remember(world)
    for row, side in ((left, 1.0), (right, -1.0)):  # to the right and to the left of where they head
        world.x[row] += side * aside
        world.y[row] -= side * aside
        world.yaw[row] -= side * turn
    collisions.find(world, before)
    assert pairs(world) == [(1, 2)]


@pytest.mark.parametrize("seed", range(4))
def test_pairs_that_are_not_judged_while_they_keep_their_gaps_do_not_touch(seed: int) -> None:
    """Boxes drift, turn past west and jump between the steps; each step is judged anew beside it."""
    rng, num = np.random.default_rng(seed), 6
    world = World()
    for i in range(num):
        yaw = rng.choice([math.pi, -math.pi])
        world.spawn(Kind.VEHICLE, CAR, name="x", x=6.0 * (i % 3), y=2.6 * (i // 3), yaw=yaw)
    pace, reach, home = (
        rng.uniform(0.02, 0.1, (3, num)),
        rng.uniform(0.1, 0.5, (3, num)),
        world.block("x", "yaw").copy(),
    )
    num_apart = num_touched = 0
    for k in range(200):
        if k % 40 == 39:  # between two steps
            world.x[k % num] += rng.uniform(-2.0, 2.0)
        detector = collisions.remember(world)
        world.x[:num] = home[0] + reach[0] * np.sin(pace[0] * k) + 0.2 * k
        world.y[:num] = home[1] + reach[1] * np.sin(pace[1] * k)
        world.yaw[:num] = wrap_angle(home[-1] + 0.2 * reach[2] * np.sin(pace[2] * k))
        detector = collisions.find(world, detector)
        found, kept = world.contacts.tolist(), (detector._gap, detector._judged)
        if detector._pairs.size:
            is_skipped = detector._are_still_apart()
            num_apart += is_skipped and not np.array_equal(kept[1], detector.poses[1, :3].take(detector._pairs, axis=1))
            detector._gap = np.zeros_like(kept[0])
            assert found == detector._judge().tolist()
            detector._gap, detector._judged = kept
        num_touched += len(found) > 0
    assert num_apart > 10
    assert num_touched > 0


@pytest.mark.parametrize(("between", "within", "turn"), [(0.1, -0.1, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.04)])
def test_pair_that_uses_up_its_gap_in_one_step_touches(between: float, within: float, turn: float) -> None:
    """Two cars side by side, 5 cm apart: one is aside only as a step begins, or as it ends, or turns."""
    world = World()
    for y in (0.0, CAR.width + 0.05):
        world.spawn(Kind.VEHICLE, CAR, name="x", x=0.0, y=y)
    for _ in range(3):
        collisions.find(world, collisions.remember(world))
        assert pairs(world) == []
    assert world.derived(collisions.CollisionDetector)._gap[0] == pytest.approx(0.05, abs=1e-5)
    world.y[0] += between
    before = collisions.remember(world)
    world.y[0] += within
    world.yaw[0] += turn
    collisions.find(world, before)
    assert pairs(world) == [(1, 2)]


def heap(num: int, *, ego: int = -1) -> World:
    """So many cars in one place."""
    world = World()

    def add(uids: range) -> None:
        world.spawn_all(Kind.VEHICLE, ["x"] * len(uids), [CAR] * len(uids), uids, speed=np.zeros(len(uids)))

    add(range(1, max(ego, 0) + 1))
    if ego >= 0:
        world.spawn(Kind.EGO, CAR, name="x", x=0.0, y=0.0, uid=ego + 1)
    add(range(ego + 2, num + 1))
    return world


def count_judged(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many pairs of boxes are judged, at each call from now on."""
    judged: list[int] = []

    def count(first: ComplexArray, *rest: Any) -> BoolArray:  # noqa: ANN401 - handed on
        judged.append(first.size)
        return do_boxes_meet(first, *rest)

    monkeypatch.setattr(collisions, "do_boxes_meet", count)
    return judged


@pytest.mark.slow
def test_heap_of_entities_costs_bounded_memory_and_keeps_all_egos() -> None:
    world = heap(1_200, ego=600)
    step(world)
    assert np.count_nonzero((world.contacts == 601).any(axis=1)) == 1_199
    assert len(world.contacts) <= 1_200 + near_pairs.MAX_HEAP // 2


def test_judged_pairs_of_a_heap_do_not_grow_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    judged = count_judged(monkeypatch)
    world = heap(9_000, ego=0)
    told: list[int] = []
    world.on_heap = lambda: told.append(world.frame)
    step(world)
    assert told, "the owner of the world hears of it"
    assert len(world.contacts) <= near_pairs.MAX_HEAP * 3 // 2
    assert max(judged) <= near_pairs.MAX_HEAP * 3 // 2

    def spin() -> None:
        world.yaw[:] = np.where(world.yaw > 0.0, 0.0, 3.0)

    step(world, spin)
    assert max(judged) <= collisions.MAX_SWEEPS


def test_ordinary_traffic_is_judged_completely() -> None:
    world = crowd(1, 120, 40.0)
    told: list[int] = []
    world.on_heap = lambda: told.append(world.frame)
    step(world)
    assert not told


def test_heap_of_entities_hides_no_contact_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(near_pairs, "MAX_BOX_PAIRS", 400)
    monkeypatch.setattr(near_pairs, "MAX_HEAP", 200)
    monkeypatch.setattr(near_pairs, "MAX_NEAR", 200)
    judged = count_judged(monkeypatch)
    world = heap(200)
    elsewhere = []
    for x, y in ((50.0, 0.0), (-50.0, 0.0), (0.0, 50.0), (0.0, -50.0)):
        uids = [world.spawn(Kind.VEHICLE, CAR, name="x", x=x + i, y=y) for i in range(2)]
        elsewhere.append((uids[0], uids[1]))
    other = World()
    other.restore(world.snapshot())
    for _ in range(LIFE + 2):
        step(world)
        step(other)
        assert set(elsewhere) <= set(pairs(world))
        assert len(world.contacts) > 50
        assert world.contacts.tolist() == other.contacts.tolist()
    assert max(judged) <= 208 // 2  # all pairs would be 19,904


def test_many_turning_entities_are_swept_in_coarser_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collisions, "MAX_SWEEPS", 1_000)
    judged = count_judged(monkeypatch)
    world = heap(20)

    def spin() -> None:
        world.yaw[:] = np.where(world.yaw > 0.0, 0.0, 3.0)

    step(world, spin)
    step(world, spin)
    assert len(world.contacts) == 190
    assert 190 < max(judged) <= 1_000  # each in 256 pieces would be 48,640


def test_bounded_pairs_keep_those_of_egos_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(near_pairs, "MAX_BOX_PAIRS", 400)
    monkeypatch.setattr(near_pairs, "MAX_HEAP", 200)
    monkeypatch.setattr(near_pairs, "MAX_NEAR", 200)
    world = heap(199, ego=150)
    for _ in range(2):
        step(world)
        assert np.count_nonzero((world.contacts == 151).any(axis=1)) == 198


def test_row_order_and_restores_change_no_contact() -> None:
    world = crowd(1, 120, 40.0)
    for _ in range(30):
        step(world)
    other = World()
    other.restore(world.snapshot())
    for _ in range(30):
        step(world)
        step(other)
        assert world.contacts.tolist() == other.contacts.tolist()
    assert world.digest() == other.digest()
