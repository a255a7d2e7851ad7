"""Loads and waiting commands as bytes: good ones come back as they were, and what no map could carry out is refused."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.road_map import Projection, RoadMap
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import BUILT_IN
from rosbridge_sim.scenarios.scenario import Driver, PhaseStart, Spawn
from rosbridge_sim.scenarios.spawn_points import MAX_AT_ONCE, SpawnPoint
from rosbridge_sim.simulator.bus.network_settings import InterfaceChoice, NetworkSettings
from rosbridge_sim.simulator.scene.load import Load
from rosbridge_sim.simulator.scene.scene_commands import AddObject, LoadScenario, RemoveObject, ShiftEgo
from rosbridge_sim.simulator.snapshots.saved_loads import pack_action, unpack_action, unpack_load
from rosbridge_sim.world.drivers.lane_position import MAX_LATERAL
from rosbridge_sim.world.state.entity_types import MAX_COORDINATE
from rosbridge_sim.world.state.world import Gear, Kind
from tests.world.road_factory import signalled

ROADS, PLAN = signalled()  # six lanes, of which the first is 190 m long; two phases of the intersection "I1"
MAP = RoadMap("made", Projection(is_tm=False, zone=52), (0.0, 0.0, 0.0), ROADS, PLAN)
CAR = next(model for model in BUILT_IN.models if model.name == "2016_Hyundai_Ioniq")
DRIVER = Driver(desired_speed=0.0, lane=0, s=0.0, route=(0, 5), lateral=-MAX_LATERAL)
SPAWN = Spawn(Kind.VEHICLE, CAR, CAR.name, None, 1.0, 2.0, 3.0, 0.5, driver=DRIVER, start_within=MAX_COORDINATE)
POINT = SpawnPoint(
    *("spawnPointList[0]", 1, "", 0, None, "", 0, -1, (CAR,)),
    num=MAX_AT_ONCE,
    period=(0.0, MAX_COORDINATE),
    wait=-1.0,
    speed=(0.0, math.inf),
    desired_speed=(3.0, 3.0),
    gap=0.0,
    time=0.0,
    lateral=(-MAX_LATERAL, MAX_LATERAL),
    lane=5,
    s=float(ROADS.length[5]),
    goal_lane=-1,
)
PHASE = PhaseStart("I1", 1, MAX_COORDINATE)


def load_of(
    driver: dict[str, Any] | None = None,
    spawn: dict[str, Any] | None = None,
    point: dict[str, Any] | None = None,
    phase: dict[str, Any] | None = None,
    road_map: RoadMap = MAP,
) -> Load:
    """A load at the bounds of all that is checked, with some fields changed."""
    one = replace(SPAWN, **{"driver": replace(DRIVER, **(driver or {})), **(spawn or {})})
    no_driver = replace(SPAWN, driver=None, start_within=0.0)
    points, phases = (replace(POINT, **(point or {})),), (replace(PHASE, **(phase or {})),)
    return Load("name", (no_driver,), (one,), True, "made", road_map, phases, points)  # noqa: FBT003 - it clears


def again(load: Load) -> Load:
    return unpack_load(tuple(load.packed), lambda _key: load.road_map)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"driver": {"s": float(ROADS.length[0]), "lateral": MAX_LATERAL, "desired_speed": math.inf, "route": ()}},
        {"spawn": {"driver": None, "start_within": 0.0}},
        {"point": {"lane": 0, "s": 0.0, "goal_lane": 5, "num": 0, "wait": MAX_COORDINATE, "period": (0.0, 0.0)}},
        {"phase": {"phase": 0, "elapsed": 0.0}},
    ],
)
def test_load_with_values_at_their_bounds_comes_back_as_it_was(changes: dict[str, Any]) -> None:
    load = load_of(**changes)
    read = again(load)
    assert read is not load
    assert read.packed == load.packed
    assert (read.name, read.is_clearing, read.map_name, read.road_map) == ("name", True, "made", MAP)
    assert (read.spawn_points, read.phases, read.others[0].driver) == (
        load.spawn_points,
        load.phases,
        load.others[0].driver,
    )


@pytest.mark.parametrize(
    ("part", "changes", "said"),
    [
        ("driver", [{"lane": -1}, {"lane": 6}, {"route": (0, 6)}, {"route": (-1,)}], "lanes of the map"),
        ("driver", [{"s": -0.1}, {"s": 190.1}, {"s": math.nan}, {"desired_speed": -0.1}], "lanes of the map"),
        (
            "driver",
            [{"lateral": math.nextafter(MAX_LATERAL, 9.0)}, {"lateral": -1.1 * MAX_LATERAL}],
            "lanes of the map",
        ),
        ("spawn", [{"start_within": -0.1}, {"start_within": 1.1 * MAX_COORDINATE}], "expected a distance"),
        ("spawn", [{"is_placed": False}, {"link": "L"}], "expected places"),
        ("point", [{"lane": -1}, {"lane": 6}, {"goal_lane": -2}, {"goal_lane": 6}], "within their bounds"),
        ("point", [{"s": -0.1}, {"s": 390.1}, {"models": ()}, {"num": -1}], "within their bounds"),
        ("point", [{"num": MAX_AT_ONCE + 1}, {"gap": -0.1}, {"time": -0.1}, {"time": math.nan}], "within their bounds"),
        ("point", [{"period": (-0.1, 1.0)}, {"period": (2.0, 1.0)}, {"speed": (2.0, 1.0)}], "within their bounds"),
        ("point", [{"period": (0.0, 1.1 * MAX_COORDINATE)}, {"desired_speed": (-1.0, 1.0)}], "within their bounds"),
        ("point", [{"wait": -1.1}, {"wait": 1.1 * MAX_COORDINATE}, {"gap": math.nan}], "within their bounds"),
        ("point", [{"lateral": (1.0, 0.0)}, {"lateral": (-1.1 * MAX_LATERAL, 0.0)}], "within their bounds"),
        ("point", [{"lateral": (0.0, 1.1 * MAX_LATERAL)}], "within their bounds"),
        ("phase", [{"phase": -1}, {"phase": 2}, {"controller": "I2"}, {"elapsed": -0.1}], "phases of the map"),
        ("phase", [{"elapsed": 1.1 * MAX_COORDINATE}, {"elapsed": math.nan}], "phases of the map"),
        ("phase", [{"controller": "I2", "phase": 0}], "phases of the map"),
    ],
)
def test_load_that_its_map_could_not_carry_out_is_refused(part: str, changes: list[dict[str, Any]], said: str) -> None:
    for change in changes:
        with pytest.raises(DocumentError, match=said):
            again(load_of(**{part: change}))  # type: ignore[arg-type] # the name of a part


def test_map_without_lights_has_no_phase() -> None:
    dark = replace(MAP, plan=None)
    with pytest.raises(DocumentError, match="phases of the map"):
        again(load_of(road_map=dark))


def test_load_with_another_digest_is_refused_and_a_known_one_is_not_read_again() -> None:
    load = load_of()
    data, digest = load.packed
    with pytest.raises(DocumentError, match="the digest is that of another one"):
        unpack_load((data, digest[::-1]), lambda _key: MAP)
    known = [load_of(phase={"phase": 0}), load]
    assert unpack_load((data, digest), lambda _key: MAP, known) is load
    other = replace(MAP, name="other")
    assert unpack_load((data, digest), lambda _key: other, known).road_map is other


@pytest.mark.parametrize(
    "action", [ShiftEgo(0, 7, Gear.REVERSE), ShiftEgo(1, 8, None), AddObject(CAR, 1.0, 2.0, 3.0, 0.5), RemoveObject(4)]
)
def test_waiting_command_comes_back_as_it_was(action: ShiftEgo | AddObject | RemoveObject) -> None:
    assert unpack_action(pack_action(action), lambda _key: MAP) == action


def test_waiting_load_comes_back_with_its_network_settings() -> None:
    network = NetworkSettings(
        publishers={"/Ego_topic": InterfaceChoice(name="/mine", is_on=True, rate=10.0)},
        services={"/Service_MoraiEventCmd": InterfaceChoice(is_on=False)},
    )
    for settings, is_pausing in ((network, True), (None, False)):
        action = LoadScenario(load_of(), settings, is_pausing)
        read = unpack_action(pack_action(action), lambda _key: MAP)
        assert isinstance(read, LoadScenario)
        assert read.load.packed == action.load.packed
        assert (read.network, read.is_pausing) == (settings, is_pausing)


@pytest.mark.parametrize("data", [(), ("control",), ("jump", {}), (1, {}), ("remove", {}, None), ("load", (), None)])
def test_data_of_no_command_is_refused(data: tuple[object, ...]) -> None:
    with pytest.raises(DocumentError, match="expected a kind and its fields"):
        unpack_action(data, lambda _key: MAP)


def test_command_with_a_number_that_is_none_is_refused() -> None:
    with pytest.raises(DocumentError, match="command"):
        unpack_action(pack_action(AddObject(CAR, math.nan, 2.0, 3.0, 0.5)), lambda _key: MAP)
