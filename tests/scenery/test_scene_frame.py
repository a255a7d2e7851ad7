"""Copies of a world for those who draw it."""

from __future__ import annotations

import numpy as np

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
