"""Copies of a world for those who draw it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.scenarios.catalogue import CATALOGUE
from rosbridge_sim.scenery.scene_frame import EgoLook, Shape, shape_of, take_frame
from rosbridge_sim.world.followers.lamps import BRAKE, LEFT
from rosbridge_sim.world.state.world import Body, Kind, World
from rosbridge_sim.world.step import step


def test_copy_stays_as_it_is_while_the_world_goes_on() -> None:
    world = World()
    world.spawn(Kind.VEHICLE, Body(), name="car", x=0.0, y=0.0, speed=10.0)
    frame = take_frame(world)
    before = frame.poses.copy()
    for _ in range(50):
        step(world)
    assert np.array_equal(frame.poses, before)
    assert take_frame(world).poses[0, 0] > 9.0


def test_egos_are_shown_with_number_and_lamps_of_their_clients() -> None:
    world = World()
    world.spawn(Kind.VEHICLE, Body(), name="car", x=20.0, y=0.0)
    uid = world.spawn(Kind.EGO, Body(), name="ego", x=0.0, y=0.0)
    frame = take_frame(world, [EgoLook(world.row(uid), 1234, LEFT | BRAKE)])
    assert frame.is_ego.tolist() == [False, True]
    assert frame.ids.tolist() == [1, 1234]
    assert frame.lamps.tolist() == [0, LEFT | BRAKE]
    assert take_frame(world).ids.tolist() == [1, uid]


def test_columns_of_a_frame_are_those_of_the_bodies_and_their_motion() -> None:
    world = World()
    body = Body(length=6.0, width=2.0, height=1.5, wheelbase=4.0, front_overhang=1.2, rear_overhang=0.8)
    uid = world.spawn(Kind.VEHICLE, body, name="car", x=3.0, y=4.0, z=5.0, yaw=0.3, pitch=0.1, roll=0.2, speed=10.0)
    world.spawn(Kind.PEDESTRIAN, Body.box(0.4, 0.6, 1.7), name="Man", x=1.0, y=2.0, yaw=1.2, speed=1.5)
    slow = world.spawn(Kind.VEHICLE, body, name="car", x=9.0, y=0.0, speed=-0.5)
    ego = world.spawn(Kind.EGO, body, name="ego", x=0.0, y=9.0, speed=10.0)
    for each in (uid, slow, ego):
        world.yaw_rate[world.row(each)] = 0.25
    world.steer[world.row(ego)] = 0.4
    frame = take_frame(world)
    assert frame.sizes.tolist() == [[6.0, 2.0, 1.5], [0.4, 0.6, 1.7], [6.0, 2.0, 1.5], [6.0, 2.0, 1.5]]
    assert frame.centres.tolist() == pytest.approx([2.2, 0.0, 2.2, 2.2])
    assert frame.wheelbases.tolist() == [4.0, 0.0, 4.0, 4.0]
    assert frame.poses[0].tolist() == pytest.approx([3.0, 4.0, 5.0, 0.2, 0.1, 0.3])
    assert frame.speeds.tolist() == [10.0, 1.5, -0.5, 10.0]
    assert frame.steers.tolist() == pytest.approx([math.atan(0.1), 0.0, math.atan(1.0), 0.4])
    assert frame.strides[:2].tolist() == pytest.approx(
        [3.0 * math.cos(0.3) + 4.0 * math.sin(0.3), math.cos(1.2) + 2.0 * math.sin(1.2)]
    )


def test_every_model_has_the_shape_of_its_name() -> None:
    shapes = {model.name: shape_of(model.kind, model.name, model.body) for model in CATALOGUE}
    assert shapes["Bus"] == Shape.BUS
    assert shapes["Bicycle"] == Shape.BICYCLE
    assert shapes["Traffic_Cone"] == Shape.CONE
    assert shapes["Woman"] == Shape.PERSON
    assert shapes["2015_Kia_K5"] == Shape.CAR
    assert shapes["Obstacle_40100019"] == Shape.BOX


def test_unknown_names_have_the_shape_of_their_size() -> None:
    for name in ("Bus", "Bicycle", "Motorcycle", "Van"):
        model = next(model for model in CATALOGUE if model.name == name)
        assert shape_of(model.kind, "?", model.body) == Shape[name.upper()]


def test_empty_world_has_an_empty_frame() -> None:
    frame = take_frame(World())
    assert len(frame) == 0
    assert frame.sizes.shape == (0, 3)
    assert frame.poses.shape == (0, 6)
