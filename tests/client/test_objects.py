"""The client's methods for objects and roads, over a real socket."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from typing import Any

import pytest
import pytest_asyncio

from rosbridge_sim import Simulator
from rosbridge_sim.client import AsyncClient, Client, ServiceRefusedError
from rosbridge_sim.client.objects import change_request, place_request, spawn_request
from tests.support import PATIENCE


@pytest_asyncio.fixture
async def sim() -> AsyncIterator[Simulator]:
    async with Simulator(port=0, start="sync", scenario="town") as simulator:
        yield simulator


@pytest_asyncio.fixture
async def client(sim: Simulator) -> AsyncIterator[AsyncClient]:
    async with AsyncClient(sim.url, timeout=PATIENCE) as client:
        yield client


async def test_object_comes_drives_is_changed_and_goes(sim: Simulator, client: AsyncClient) -> None:
    await client.start_sync()
    route = await client.route("R0010L1", ("R2021L1", 30.0))
    assert route["links"][0] == "R0010L1"
    assert route["length_m"] > 100.0
    car = await client.spawn("kia k5", link="R0010L1", distance=30.0, route=route["links"], speed=5.0)
    walker = await client.spawn("Man", x=-206.0, y=-230.0, path=[(-206.0, -230.0), (-100.0, -230.0, 0.0)], speed=1.0)
    egos = await client.spawn_all([{"is_ego": True, "place": {"x": 0.0, "y": 0.0}}])
    await client.tick(10)
    assert sim.node is not None
    world = sim.node.world
    assert world.roads.ids[world.lane[world.row(car)]] == "R0010L1"
    assert world.x[world.row(walker)] == pytest.approx(-205.8)
    await client.set_object(car, x=1.0, y=2.0, heading_deg=90.0, speed=0.0)
    await client.set_object(0, gear=3, turn_signal=1, ctrl_mode=1)
    await client.set_objects([{"unique_id": walker, "set_behaviour": True, "behaviour": "stand"}])
    assert (world.x[world.row(car)], world.speed[world.row(walker)]) == (1.0, 0.0)
    await client.remove(car, walker, *egos)
    with pytest.raises(ServiceRefusedError, match=rf"/sim/remove: unique_ids\[0\]: there is no object {car}"):
        await client.remove(car)


async def test_entities_and_scenarios_are_described(client: AsyncClient) -> None:
    ego = await client.describe(0)
    assert (ego["kind"], ego["behaviour"]) == (0, "driven")
    with pytest.raises(ServiceRefusedError, match="there is no entity 4000"):
        await client.describe(4000)
    scenarios = {each["name"]: each for each in await client.scenarios()}
    assert {"demo", "loop", "town"} <= set(scenarios)
    assert [name for name, each in scenarios.items() if each["is_loaded"]] == ["town"]
    picture = await client.scenario_picture("town", width=64, height=64)
    assert picture.startswith(b"\x89PNG")
    with pytest.raises(ServiceRefusedError, match="no scenario 'nowhere'"):
        await client.scenario_picture("nowhere")


async def test_questions_about_map_and_models_are_answered(client: AsyncClient) -> None:
    lane = await client.nearest_lane(-165.0, -221.0)
    assert (lane["link"], lane["is_on_road"]) == ("R0010L1", True)
    assert (await client.nearest_lane(-165.0, -220.0, 180.0))["link"] != "R0010L1"
    assert any(model["name"] == "Bus" for model in await client.catalogue())
    town = await client.map()
    assert (town["name"], town["num_pages"], len(town["lanes"])) == ("town", 1, 284)
    with pytest.raises(ServiceRefusedError, match="expected a place within 100 m"):
        await client.route((1e4, 0.0, 90.0), {"link": "R0010L1"})


async def test_objects_come_and_go_behind_a_bridge(client: AsyncClient) -> None:
    async with (
        Simulator(port=0, world=False) as bridge,
        Simulator(listen=False, attach=(bridge.url,)) as sim,
        AsyncClient(bridge.url, timeout=PATIENCE) as far,
    ):
        await sim.attachments[0].attached
        uid = await far.spawn("Box", x=1.0, y=2.0)
        await far.remove(uid)
        assert (await far.map())["result"] is True
        with pytest.raises(ServiceRefusedError, match="there is no object"):
            await far.remove(uid)
    assert client.is_connected


@pytest.fixture
def blocking() -> Iterator[Client]:
    with Simulator(port=0, start="sync", scenario="town") as sim, Client(sim.url, timeout=PATIENCE) as client:
        yield client


def test_blocking_form_has_them_all(blocking: Client) -> None:
    uid = blocking.spawn("Box", x=1.0, y=2.0)
    blocking.set_object(uid, x=3.0, y=4.0)
    blocking.set_objects([])
    blocking.remove(uid, *blocking.spawn_all([]))
    assert blocking.catalogue()
    assert blocking.map()["lanes"]
    assert blocking.route("R0010L1", ("R0010L1", 9.0))["length_m"] == 9.0
    assert blocking.nearest_lane(0.0, 0.0)["link"]
    assert blocking.describe(0)["result"]
    assert len(blocking.scenarios()) >= 3
    assert blocking.scenario_picture("demo")


# Requests


def test_flags_say_what_was_given() -> None:
    assert change_request(3, speed=0.0) == {"unique_id": 3, "set_speed": True, "speed": 0.0}
    flags = {"set_place": True, "set_behaviour": True, "set_lamps": True}
    request = change_request(3, link="a", route=("a", "b"), turn_signal=1)
    assert request == {"unique_id": 3, **flags, "place": {"link": "a"}, "route": ["a", "b"], "turn_signal": 1}


def test_place_of_a_route_is_told_in_several_ways() -> None:
    assert place_request("a") == {"link": "a"}
    assert place_request(("a", 3.0)) == {"link": "a", "distance": 3.0}
    assert place_request((1.0, 2.0)) == {"x": 1.0, "y": 2.0}
    assert place_request((1.0, 2.0, 90.0)) == {"x": 1.0, "y": 2.0, "use_heading": True, "heading_deg": 90.0}


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"x": 1.0}, "spawn: expected x and y, or link, for the place; got x"),
        ({}, "got neither"),
        ({"x": 0.0, "y": 0.0, "velocity": 3.0}, "spawn: expected no argument 'velocity'; there are behaviour, "),
    ],
)
def test_mistaken_arguments_are_refused_before_anything_is_sent(options: dict[str, Any], why: str) -> None:
    with pytest.raises(TypeError, match=why):
        spawn_request("Box", **options)


def test_half_of_a_place_is_no_change() -> None:
    with pytest.raises(TypeError, match="set_object: expected x and y, or link"):
        change_request(3, heading_deg=90.0)
