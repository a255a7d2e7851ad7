"""Units, orders and names of messages in both directions."""

from __future__ import annotations

import json
import math
from typing import Any, Literal

import numpy as np
import pytest

from rosbridge_sim.errors import FieldError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.maps.mgeo import NO_PROJECTION
from rosbridge_sim.maps.road_map import Projection, RoadMap
from rosbridge_sim.morai.messages.control import gear_of
from rosbridge_sim.morai.messages.convert import Converter, late_maker, maker, time_text
from rosbridge_sim.morai.messages.object_lists import LATE_FROM
from rosbridge_sim.morai.releases import FIELD, LENIENCY, MANUAL, RELEASES, Profile, choose_profile
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import LateMessageType, MessageType
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state import commands
from rosbridge_sim.world.state.world import Body, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.simulator.sim_harness import make_store

BOX = Body.box(2.0, 1.0, 0.5)


def a_world() -> World:
    world = World()
    world.spawn(Kind.EGO, Body(), name="car", x=1.0, y=2.0, z=3.0, yaw=math.radians(170.0), speed=5.0, uid=0)
    world.spawn(Kind.VEHICLE, Body(), name="other", x=50.0, y=0.0, yaw=math.radians(-90.0), speed=10.0)
    world.spawn(Kind.OBSTACLE, BOX, name="box", x=2.0, y=2.0)
    world.spawn(Kind.PEDESTRIAN, BOX, name="man", x=9.0, y=2.0, speed=1.0)
    world.spawn(Kind.VEHICLE, Body(), name="near", x=3.0, y=2.0)
    return world


def shown(type_name: str, value: object) -> dict[str, Any]:
    shown: dict[str, Any] = json.loads(make_store().message(f"morai_msgs/{type_name}").encode_json(value))
    return shown


def ego(world: World, profile: Profile = MANUAL) -> dict[str, Any]:
    return shown("EgoVehicleStatus", Converter(make_store(), profile).ego_vehicle_status(world, world.row(0), 0))


def objects(world: World, profile: Profile = MANUAL) -> dict[str, Any]:
    return shown("ObjectStatusList", Converter(make_store(), profile).object_status_list(world, world.row(0), int))


@pytest.mark.parametrize(("frame", "seq"), [(2**31, 2**31), (2**32 - 1, 2**32 - 1), (2**32 + 5, 5)])
def test_seq_counts_through_all_of_its_32_bits(frame: int, seq: int) -> None:
    """It is a uint32: a client that looks for lost messages takes any other jump for a loss."""
    assert Converter(make_store()).header(frame).seq == seq


def test_ego_status_is_in_metres_and_degrees_in_the_body_frame() -> None:
    world = a_world()
    commands.command(world, 0, mode=Mode.PEDALS, steer=0.01, throttle=0.25)
    for _ in range(60):
        step(world)
    status = ego(world)
    assert status["header"] == {"seq": 60, "stamp": {"secs": 1, "nsecs": 200_000_000}, "frame_id": "base_link"}
    assert status["unique_id"] == 0
    assert status["position"] == {"x": world.x[0], "y": world.y[0], "z": 3.0}
    assert status["velocity"] == {"x": world.speed[0], "y": 0.0, "z": 0.0}
    assert status["acceleration"] == {"x": world.accel[0], "y": world.lateral_accel[0], "z": 0.0}
    assert status["heading"] == pytest.approx(math.degrees(world.yaw[0]))
    assert (status["accel"], status["brake"], status["wheel_angle"]) == (0.25, 0.0, 0.01)


def test_headings_stay_within_half_a_turn() -> None:
    world = World()
    world.spawn(Kind.EGO, Body(), name="car", x=0.0, y=0.0, yaw=-math.pi, uid=0)
    assert ego(world)["heading"] == 180.0


def test_float32_fields_are_rounded_to_float32() -> None:
    world = a_world()
    commands.command(world, 0, mode=Mode.PEDALS, steer=0.0, throttle=1.0 / 3.0)
    step(world)
    assert ego(world)["accel"] == 0.33333334


def test_field_profile_uses_the_units_of_client_programs() -> None:
    world = a_world()
    commands.command(world, 0, mode=Mode.PEDALS, steer=0.01)
    step(world)
    assert ego(world, FIELD)["wheel_angle"] == pytest.approx(math.degrees(0.01), rel=1e-6)
    size = objects(world, FIELD)["obstacle_list"][0]["size"]
    assert size == {"x": 2.0, "y": 1.0, "z": 0.5}


def test_objects_are_listed_by_kind_in_order_of_spawning() -> None:
    listed = objects(a_world())
    assert listed["header"]["frame_id"] == "ObjectInfo"
    assert [listed[f"num_of_{kind}"] for kind in ("npcs", "pedestrian", "obstacle")] == [2, 1, 1]
    assert [one["name"] for one in listed["npc_list"]] == ["other", "near"]
    other, man, box = listed["npc_list"][0], listed["pedestrian_list"][0], listed["obstacle_list"][0]
    assert (other["type"], man["type"], box["type"]) == (1, 0, 2)
    assert (other["unique_id"], other["heading"]) == (1, -90.0)
    assert other["velocity"] == {"x": 36.0, "y": 0.0, "z": 0.0}
    assert other["position"] == {"x": 50.0, "y": 0.0, "z": 0.0}
    assert box["size"] == {"x": 1.0, "y": 2.0, "z": 0.5}
    assert box["velocity"] == box["acceleration"] == {"x": 0.0, "y": 0.0, "z": 0.0}


def test_object_velocity_can_be_in_metres_per_second() -> None:
    assert objects(a_world(), Profile(object_velocity_unit="m/s"))["npc_list"][0]["velocity"]["x"] == 10.0


def test_object_limit_lists_and_counts_the_nearest() -> None:
    listed = objects(a_world(), Profile(object_limit=2))
    assert [one["name"] for one in listed["npc_list"]] == ["near"]
    assert [one["name"] for one in listed["obstacle_list"]] == ["box"]
    assert listed["pedestrian_list"] == []
    assert [listed[f"num_of_{kind}"] for kind in ("npcs", "pedestrian", "obstacle")] == [1, 0, 1]
    assert len(objects(a_world(), Profile(object_limit=4))["npc_list"]) == 2


def test_object_range_leaves_out_what_is_far_from_the_ego() -> None:
    listed = objects(a_world(), Profile(object_range=8.0))
    assert [one["name"] for one in listed["npc_list"] + listed["pedestrian_list"]] == ["near", "man"]
    assert [listed[f"num_of_{kind}"] for kind in ("npcs", "pedestrian", "obstacle")] == [1, 1, 1]
    assert [one["name"] for one in objects(a_world(), Profile(object_range=8.0, object_limit=1))["obstacle_list"]] == [
        "box"
    ]


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("profile", [MANUAL, Profile(object_range=150.0), Profile(object_limit=250)])
def test_late_lists_have_the_bytes_of_lists_that_are_made_at_once(ros: Literal[1, 2], profile: Profile) -> None:
    store = Store(read_definitions("22.R2"), ros=ros, leniency=LENIENCY)
    world = World()
    world.spawn(Kind.EGO, Body(), name="car", x=0.0, y=0.0, uid=0)
    for i in range(LATE_FROM):
        kind = (Kind.VEHICLE, Kind.PEDESTRIAN, Kind.VEHICLE, Kind.OBSTACLE)[i % 4]
        world.spawn(kind, BOX, name=f"n\u00e4me {i}", x=i - 0.1, y=3.0 * i, yaw=i / 7.0, speed=1.0 * (i % 5))
        world.spawn(Kind.OBSTACLE, BOX, name="box", x=1e-7 * i, y=-1e8)
    converter, of_list = Converter(store, profile), store.message("morai_msgs/ObjectStatusList")
    message = Message(of_list, converter.object_status_list(world, world.row(0), int))
    at_once = converter.object_lists(world)[3:]
    if profile is not MANUAL:
        rows = np.concatenate([world.rows(each) for each in (Kind.VEHICLE, Kind.PEDESTRIAN, Kind.OBSTACLE)])
        away = np.hypot(world.x[rows], world.y[rows])
        near = away <= 150.0 if profile.object_range else np.argsort(np.argsort(away, kind="stable")) < 250
        kept = {int(uid) for uid in world.uid[rows[near]]}
        at_once = tuple([one for one in part if one.unique_id in kept] for part in at_once)
    plain = of_list.struct_type(
        header=converter.header(0, "ObjectInfo"),
        **dict(zip(("num_of_npcs", "num_of_pedestrian", "num_of_obstacle"), map(len, at_once), strict=True)),
        **dict(zip(("npc_list", "pedestrian_list", "obstacle_list"), at_once, strict=True)),
    )
    step(world)  # the message keeps the figures that it was made of
    assert message.num_bytes == Message(of_list, plain).num_bytes
    assert message.json == of_list.encode_json(plain)
    assert message.cbor == of_list.encode_cbor(plain)
    assert message.raw == of_list.encode_raw(plain)
    assert message.value == plain


def test_added_and_removed_objects_are_listed_at_once() -> None:
    world = a_world()
    converter = Converter(make_store())

    def names() -> list[str]:
        listed = shown("ObjectStatusList", converter.object_status_list(world, 0, int))
        return [one["name"] for one in listed["npc_list"] + listed["obstacle_list"]]

    assert names() == ["other", "near", "box"]
    world.remove(1)
    world.spawn(Kind.OBSTACLE, BOX, name="new", x=0.0, y=0.0)
    assert names() == ["near", "box", "new"]


def test_world_without_objects_has_empty_lists() -> None:
    world = World()
    world.spawn(Kind.EGO, Body(), name="car", x=0.0, y=0.0, uid=0)
    assert objects(world, FIELD)["npc_list"] == []


def test_vehicle_specification_is_in_metres() -> None:
    converter = Converter(make_store())
    spec = shown("VehicleSpec", converter.vehicle_spec(Body()))
    assert spec["size"] == {"x": 4.47, "y": 1.82, "z": 1.45}
    assert spec["max_steering"] == pytest.approx(36.25)
    assert (spec["wheel_base"], spec["overhang"], spec["rear_overhang"]) == (2.7, 0.88, 0.89)
    nobody = shown("VehicleSpec", converter.vehicle_spec(None))
    assert nobody.pop("size") == {"x": 0.0, "y": 0.0, "z": 0.0}
    assert set(nobody.values()) == {0.0}
    utm = RoadMap("m", Projection(is_tm=False, zone=52), (1.0, 2.0, 3.0), Roads())
    spec = shown("MapSpec", converter.map_spec(utm))
    assert (spec["plane_coordinate_system"], spec["utm_num"], spec["ellipse"]) == (0, 52, "WGS84")
    assert spec["utm_offset"] == {"x": 1.0, "y": 2.0, "z": 3.0}
    tm = RoadMap("m", Projection(is_tm=True, central_latitude=38.0, scale_factor=0.9996), (0.0, 0.0, 0.0), Roads())
    spec = shown("MapSpec", converter.map_spec(tm))
    assert (spec["plane_coordinate_system"], spec["central_latitude"], spec["scale_factor"]) == (1, 38.0, 0.9996)
    spec = shown("MapSpec", converter.map_spec(RoadMap("m", NO_PROJECTION, (0.0, 0.0, 0.0), Roads())))
    assert (spec["utm_num"], spec["ellipse"], spec["scale_factor"]) == (0, "", 0.0)


def test_simulated_time_is_exact() -> None:
    assert [time_text(frame) for frame in (0, 1, 50, 617, 5_000_000)] == ["0.00", "0.02", "1.00", "12.34", "100000.00"]
    clock = Converter(make_store()).clock(75)
    assert make_store().message("rosgraph_msgs/Clock").encode_json(clock) == b'{"clock":{"secs":1,"nsecs":500000000}}'


def command(**fields: object) -> Struct:
    return make_store().message("morai_msgs/CtrlCmd").check(fields, 0)


@pytest.mark.parametrize(("number", "mode"), [(0, Mode.PEDALS), (1, Mode.PEDALS), (2, Mode.SPEED), (3, Mode.ACCEL)])
def test_control_command_is_converted_to_world_units(number: int, mode: Mode) -> None:
    control = Converter(make_store()).control(
        command(longlCmdType=number, accel=2.0, brake=-1.0, steering=0.5, velocity=36.0, acceleration=-1.5)
    )
    assert control.mode is mode
    assert (control.throttle, control.brake, control.steer) == (2.0, -1.0, 0.5)  # the world clamps
    assert (control.speed, control.accel) == (10.0, -1.5)


@pytest.mark.parametrize("number", [-1, 4, 100])
def test_an_unknown_control_type_is_refused(number: int) -> None:
    with pytest.raises(FieldError, match=f"longlCmdType: expected .*, got {number}"):
        Converter(make_store()).control(command(longlCmdType=number))


@pytest.mark.parametrize("field", ["accel", "brake", "steering", "velocity", "acceleration"])
@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_non_finite_number_is_refused_in_every_field(field: str, number: float) -> None:
    with pytest.raises(FieldError, match=rf"CtrlCmd\.{field}: expected a finite number"):
        Converter(make_store()).control(command(**{field: number}))


def test_gears_are_converted_both_ways() -> None:
    assert [gear_of(number) for number in (-1, 0, 1, 4)] == [None, None, Gear.PARK, Gear.DRIVE]
    with pytest.raises(FieldError, match="gear: expected"):
        gear_of(5)


def test_documented_field_names_are_aliases_of_wire_names() -> None:
    store = make_store()
    assert store.canonical("morai_msg/CtrlCmd") == "morai_msgs/CtrlCmd"
    assert store.canonical("morai_msg/msg/ObjectStatusList") == "morai_msgs/ObjectStatusList"
    assert store.canonical("morai_msgs/srv/SyncModeSLSrv") == "morai_msgs/MoraiSyncModeSLSrv"
    assert command(longCmdType=2, front_steer=0.25).steering == 0.25
    for name in ("ScenarioLoad", "SyncModeScenarioLoad"):
        load = store.message(f"morai_msgs/{name}").check({"load_object_data": True, "load_network_connection": True}, 0)
        assert load.load_obstacle_data
        assert load.load_network_connection_data
    pose = store.message("morai_msgs/SensorPosControl").check({"sensor_index": 1, "yaw": 0.5}, 0)
    assert (pose.sensor_index, pose.yaw) == ([1], [0.5])
    crossing = store.message("morai_msgs/IntersectionControl")
    assert crossing.check({"intersection_index": "IntTL13"}, 0).intersection_index == 13


def test_every_alias_names_an_existing_type() -> None:
    stores = [make_store(release) for release in RELEASES]
    known = {name for store in stores for kind in ("msg", "srv") for name in store.names(kind)}
    assert set(LENIENCY.types.values()) <= known
    assert {*LENIENCY.fields, *LENIENCY.scalars, *LENIENCY.numerals} <= known


def test_profile_settings_can_be_overridden_one_by_one() -> None:
    assert choose_profile("manual") == MANUAL
    assert choose_profile("field") == FIELD == Profile("deg", "length-width-height", 20, "km/h")
    mixed = choose_profile("field", wheel_angle_unit="rad", object_limit=0)
    assert mixed == Profile("rad", "length-width-height", 0, "km/h")


def test_user_definitions_may_have_other_fields() -> None:
    texts = {("x", "msg", "Pair"): "int32 extra\nint32 a\n"}
    make = maker(Store(texts), "x/Pair", "a b")
    value = make(1, 2)
    assert (value.a, value.extra) == (1, 0)


def test_late_maker_compiles_its_type_at_the_first_call() -> None:
    store = Store({("x", "msg", "Pair"): "int32 extra\nint32 a\n"}, is_checked=True)
    make = late_maker(store, "x/Pair", "a b")
    assert type(store.message("x/Pair")) is LateMessageType
    assert [(value.a, value.extra) for value in (make(1, 2), make(3, 4))] == [(1, 0), (3, 0)]
    assert type(store.message("x/Pair")) is MessageType


def test_newer_steering_field_is_read_where_the_type_has_it() -> None:
    texts = read_definitions("22.R2")
    old = texts["morai_msgs", "msg", "CtrlCmd"]
    texts["morai_msgs", "msg", "CtrlCmd"] = old.replace("steering", "front_steer")
    store = Store(texts, leniency=LENIENCY)
    value = store.message("morai_msgs/CtrlCmd").check({"steering": 0.125}, 0)
    assert Converter(store).control(value).steer == 0.125
