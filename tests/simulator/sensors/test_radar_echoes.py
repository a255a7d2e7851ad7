from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from rosbridge_sim.simulator.sensors.radar import RadarSpec
from rosbridge_sim.simulator.sensors.radar_echoes import RadarEchoes, _Footprints, find_echoes, own_velocity
from rosbridge_sim.world.state.world import Body, Kind, World
from rosbridge_sim.world.vehicle.sensor_readings import Mounting

CAR = Body(length=4.0, width=2.0, height=1.5)
PERSON = Body(length=0.5, width=0.5, height=1.7)
BUS = Body(length=12.0, width=2.5, height=3.2)
FRONT = Mounting(x=4.0, z=0.75)

Entity = tuple[Kind, Body, float, float, float, float]


def scene(*others: Entity, speed: float = 0.0, yaw: float = 0.0) -> World:
    """An ego at the origin, and others (kind, body, x, y, yaw, speed)."""
    world = World()
    world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0, yaw=yaw, speed=speed)
    for kind, body, x, y, heading, other_speed in others:
        world.spawn(kind, body, name="other", x=x, y=y, yaw=heading, speed=other_speed)
    return world


def look(world: World, mounting: Mounting = FRONT, spec: RadarSpec | None = None) -> RadarEchoes:
    return find_echoes(world, 0, mounting, spec or RadarSpec())


def rear_of(distance: float, side: float = 0.0, speed: float = 0.0) -> Entity:
    """A car whose rear is so far ahead of the radar; its reference point is its rear axle."""
    return Kind.VEHICLE, CAR, FRONT.x + distance + 0.5 * CAR.length - CAR.centre, side, 0.0, speed


def test_car_ahead_is_one_echo_at_its_rear() -> None:
    echoes = look(scene(rear_of(30.0, speed=15.0), speed=20.0))
    assert len(echoes.rows) == 1
    assert echoes.distance[0] == pytest.approx(30.0, abs=1e-9)
    assert echoes.azimuth[0] == pytest.approx(0.0, abs=1e-9)
    assert echoes.position[0] == pytest.approx([30.0, 0.0, 0.0], abs=1e-9)
    assert echoes.range_rate[0] == pytest.approx(-5.0, abs=1e-9)


def test_azimuth_is_positive_to_the_left_and_follows_the_mounting() -> None:
    world = scene((Kind.PEDESTRIAN, PERSON, 4.0 - PERSON.centre, 10.0, 0.0, 0.0))
    echoes = look(world, Mounting(x=4.0, z=0.85, yaw=math.radians(90.0)))
    assert echoes.azimuth[0] == pytest.approx(0.0, abs=1e-9)
    assert echoes.distance[0] == pytest.approx(9.75, abs=1e-9)
    assert not len(look(world).rows)  # out of both beams of a radar that looks ahead


def test_turning_ego_turns_the_frame_of_the_radar() -> None:
    world = scene((Kind.VEHICLE, CAR, 0.0, 40.0, math.pi / 2.0, 0.0), yaw=math.pi / 2.0)
    assert look(world).position[0] == pytest.approx([40.0 + CAR.centre - 0.5 * CAR.length - 4.0, 0.0, 0.0], abs=1e-9)


def test_amplitude_falls_by_40_db_a_decade() -> None:
    near, far = (look(scene(rear_of(distance))).amplitude[0] for distance in (10.0, 100.0))
    assert near - far == pytest.approx(40.0, abs=0.2)  # the car looks a little less wide from 10 m


def test_car_is_seen_to_the_end_of_the_far_beam_and_a_pedestrian_is_not() -> None:
    assert len(look(scene(rear_of(173.0))).rows) == 1
    assert not len(look(scene(rear_of(175.0))).rows)
    assert not len(look(scene((Kind.PEDESTRIAN, PERSON, 120.0, 0.0, 0.0, 0.0))).rows)
    assert len(look(scene((Kind.PEDESTRIAN, PERSON, 40.0, 0.0, 0.0, 0.0))).rows) == 1


def test_wide_beam_ends_at_its_own_range() -> None:
    at = math.radians(30.0)
    for distance, num in ((50.0, 1), (70.0, 0)):
        place = 4.0 + distance * math.cos(at), distance * math.sin(at)
        assert len(look(scene((Kind.VEHICLE, CAR, *place, 0.0, 0.0))).rows) == num


def test_bus_hides_the_car_behind_it() -> None:
    hidden = rear_of(60.0)
    assert len(look(scene(hidden)).rows) == 1
    found = look(scene((Kind.VEHICLE, BUS, 30.0, 0.0, 0.0, 0.0), hidden))
    assert len(found.rows) == 1
    assert found.distance[0] < 40.0


def test_car_that_is_half_hidden_is_weaker() -> None:
    free = look(scene(rear_of(60.0, side=3.0))).amplitude[0]
    echoes = look(scene((Kind.VEHICLE, BUS, 30.0, 0.0, 0.0, 0.0), rear_of(60.0, side=3.0)))
    assert len(echoes.rows) == 2
    assert echoes.amplitude[1] < free - 1.0


def test_side_of_a_car_is_stronger_than_its_rear() -> None:
    side = look(scene((Kind.VEHICLE, CAR, 35.0, -CAR.centre, math.pi / 2.0, 0.0)))
    rear = look(scene(rear_of(side.distance.item(0))))
    assert side.amplitude[0] == pytest.approx(rear.amplitude[0] + 10.0 * math.log10(2.0), abs=0.5)


@pytest.mark.parametrize(
    ("kind", "body", "section"),
    [
        (Kind.VEHICLE, CAR, 10.0),
        (Kind.VEHICLE, Body(length=6.0, width=2.0, height=1.5), 10.0),
        (Kind.VEHICLE, Body(length=6.01, width=2.0, height=1.5), 20.0),
        (Kind.EGO, Body(length=6.01, width=2.0, height=1.5), 20.0),
        (Kind.VEHICLE, Body(length=2.0, width=0.98, height=1.5), -3.0),
        (Kind.VEHICLE, Body(length=2.0, width=1.0, height=1.5), 10.0),
        (Kind.PEDESTRIAN, PERSON, -8.0),
        (Kind.OBSTACLE, Body(length=8.0, width=0.5, height=1.5), 0.0),
    ],
)
def test_amplitude_is_the_cross_section_at_this_distance_over_that_of_a_car_at_the_end(
    kind: Kind, body: Body, section: float
) -> None:
    world = scene((kind, body, FRONT.x + 15.0 + 0.5 * body.length - body.centre, 0.0, 0.0, 0.0))
    world.z[1] = FRONT.z - 0.5 * body.height  # level with the radar
    (amplitude,) = look(world, spec=RadarSpec(near_range=50.0, far_range=100.0)).amplitude
    assert amplitude == pytest.approx(section + 40.0 * math.log10(100.0 / 15.0) - 10.0, abs=0.02)


def test_beams_are_as_high_as_the_specification_says() -> None:
    for up, num in ((0.85, 1), (0.90, 0), (-0.85, 1), (-0.90, 0)):  # 5 deg at 10 m are 0.875 m
        world = scene(rear_of(10.0))
        world.z[1] = FRONT.z - 0.5 * CAR.height + up
        assert len(look(world).rows) == num
    assert not len(look(scene(rear_of(10.0)), Mounting(x=4.0, z=0.75, pitch=0.09)).rows)


def test_rate_is_the_change_of_the_distance_while_both_vehicles_turn() -> None:
    world = scene((Kind.VEHICLE, CAR, 20.0, 8.0, 2.0, 9.0), speed=12.0, yaw=0.1)
    world.yaw_rate[:2] = 0.6, -0.9
    mounting = Mounting(x=3.0, y=0.8, z=0.75, yaw=0.3)
    echoes = look(world, mounting, RadarSpec(near_fov=170.0))
    dt = 1e-6

    def place(row: int, east: float, north: float) -> complex:
        """Where a place that is fixed to a vehicle is a moment later."""
        at = complex(world.x[row], world.y[row])
        turn, yaw = world.yaw_rate[row] * dt, world.yaw[row]
        gone = float(world.speed[row]) * dt * cmath.exp(1j * yaw)
        return at + gone + (complex(east, north) - at) * cmath.exp(1j * turn)

    here = cmath.exp(0.1j) * (3.0 + 0.8j)
    there = here + cmath.exp(1j * (0.1 + 0.3)) * complex(*echoes.position[0, :2])
    later = place(1, there.real, there.imag) - place(0, here.real, here.imag)
    flat = abs(there - here)
    rate = (abs(later) - flat) / dt
    assert echoes.range_rate[0] * echoes.distance[0] / flat == pytest.approx(rate, abs=1e-3)
    own = own_velocity(world, 0, mounting)
    expected = (place(0, here.real, here.imag) - here) / dt * cmath.exp(-0.4j)
    assert own == pytest.approx(np.array([expected.real, expected.imag, 0.0]), abs=1e-4)


def test_visible_share_is_that_of_the_directions_which_no_nearer_box_takes() -> None:
    rng = np.random.default_rng(2)
    world = World()
    for _ in range(14):
        away, at = rng.uniform(6.0, 25.0), rng.uniform(-math.pi, math.pi)
        body = Body.box(rng.uniform(2.0, 8.0), rng.uniform(1.0, 3.0), 1.5)
        x, y = away * math.cos(at), away * math.sin(at)
        world.spawn(Kind.OBSTACLE, body, name="box", x=x, y=y, yaw=rng.uniform(-3.0, 3.0))
    rows = np.arange(14)
    feet = _Footprints(world, rows, (1.0, -2.0, 0.0))
    distance = np.hypot(*feet.nearest_points())
    visible, shown = feet.sight(distance)
    sides = np.linspace(-1.0, 1.0, 101)
    outline = np.concatenate([sides + 1j, sides - 1j, 1j * sides + 1.0, 1j * sides - 1.0])
    taken = np.zeros(7_200, dtype=bool)
    for row in np.argsort(distance).tolist():
        turn, middle = cmath.exp(1j * world.yaw[row]), complex(world.x[row], world.y[row]) - (1.0 - 2.0j)
        size = outline.real * world.half_length[row] + 1j * outline.imag * world.half_width[row]
        corners = middle + size * turn
        assert distance[row] == pytest.approx(np.abs(corners).min(), abs=0.05)
        angles = np.angle(corners / middle)
        aside = (corners * np.conj(middle / abs(middle))).imag
        assert shown[row] == pytest.approx(aside.max() - aside.min())
        first, last = (round(math.degrees(edge + cmath.phase(middle)) * 20) for edge in (angles.min(), angles.max()))
        steps = np.arange(first, last + 1) % 7_200
        assert visible[row] == pytest.approx(1.0 - taken[steps].mean(), abs=0.06)
        taken[steps] = True
    assert ((visible > 0.1) & (visible < 0.9)).sum() >= 3
    assert visible.min() < 0.2


def test_nearest_echoes_are_kept() -> None:
    people = [(Kind.PEDESTRIAN, PERSON, 10.0 + i, 0.8 * i - 4.0, 0.0, 0.0) for i in range(10)]
    echoes = look(scene(*people), spec=RadarSpec(max_echoes=3))
    assert len(echoes.rows) == 3
    assert list(echoes.distance) == sorted(echoes.distance)


def test_passing_car_has_the_rate_along_the_line_of_sight() -> None:
    world = scene((Kind.VEHICLE, CAR, 24.0, 15.0, math.pi, 10.0))
    echoes = look(world)
    x, y, _ = echoes.position[0]
    assert echoes.range_rate[0] == pytest.approx(-10.0 * x / math.hypot(x, y), abs=0.1)


def test_empty_world_and_crowd_around_the_radar() -> None:
    assert not len(look(scene()).rows)
    around = [(Kind.PEDESTRIAN, PERSON, 4.0, 0.0, 0.0, 0.0)]
    assert len(look(scene(*around)).rows) <= 1  # the radar is within the box: no division by zero
