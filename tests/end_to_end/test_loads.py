"""Scenario loads over real sockets: later messages of the client act on the new scene; other clients do not wait."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Any

import pytest

from rosbridge_sim.loose_types import JsonValue
from tests.conftest import Connect, Simulate
from tests.support import PATIENCE, Client

pytestmark = pytest.mark.slow

Op = dict[str, Any]

ALL = {
    "delete_all": True,
    "load_ego_vehicle_data": True,
    "load_surrounding_vehicle_data": True,
    "load_pedestrian_data": True,
    "load_obstacle_data": True,
}


def call(service: str, op_id: str, **request: object) -> Op:
    return {"op": "call_service", "service": service, "id": op_id, "args": {"request": request}}


def start() -> Op:
    return call("/SyncModeCmd", "start", user_id="me", start_sync_mode=True, time_step=20)


def tick(op_id: str) -> Op:
    return call("/SyncModeWaitForTick", op_id, user_id="me", frame=0)


def by_topic(name: str) -> Op:
    return {
        "op": "publish",
        "topic": "/ScenarioLoad",
        "type": "morai_msgs/ScenarioLoad",
        "msg": {"file_name": name, **ALL},
    }


def by_service(name: str) -> Op:
    return call("/Service_MoraiSL", "load", file_name=name, **ALL)


def at_next_frame(name: str) -> Op:
    return call("/SyncModeScenarioLoad", "load", file_name=name, frame=0, **ALL)


WAYS: dict[str, Callable[[str], Op]] = {"topic": by_topic, "service": by_service, "frame": at_next_frame}

SCENES = ("town", "loop", "demo", "town")


async def burst(client: Client, ops: list[Op]) -> None:
    for op in ops:
        await client.send_raw(json.dumps(op))


async def answers(client: Client, last: str) -> dict[str, Any]:
    """The responses by their ids, in order, up to the last one."""
    found: dict[str, Any] = {}
    while last not in found:
        frame = await client.take_where(lambda frame: frame["op"] == "service_response", "an answer")
        assert frame["result"] is True, frame
        found[frame["id"]] = frame["values"]["response"]
    return found


async def ego_place(client: Client) -> JsonValue:
    """Where the ego is: a tick of somebody who is not the master moves nothing and tells it."""
    await burst(client, [call("/SyncModeWaitForTick", "look", user_id="nobody")])
    return (await answers(client, "look"))["look"]["vehicle_status"]["position"]


def drive(way: str) -> list[Op]:
    """One scene after the other, each with a tick behind it."""
    ops = [start()]
    for i, name in enumerate(SCENES):
        ops += [{**WAYS[way](name), "id": f"load {i}"}, tick(f"tick {i}")]
    return ops


async def step_by_step(client: Client, way: str) -> list[Any]:
    """What the ticks answer where the client waits for each answer."""
    seen = []
    for op in drive(way):
        await burst(client, [op])
        if op["op"] == "call_service":
            seen.append((await answers(client, op["id"]))[op["id"]])
    return [answer for answer in seen if "tick_status" in answer]


@pytest.mark.parametrize("way", WAYS)
async def test_tick_after_a_load_in_one_burst_sees_the_new_scene(
    simulate: Simulate, connect: Connect, way: str
) -> None:
    waiting = await connect(simulate("--start", "sync").url)
    wanted = await step_by_step(waiting, way)
    assert [answer["frame"] for answer in wanted] == [1, 2, 3, 4]
    places = [answer["vehicle_status"]["position"]["x"] for answer in wanted]
    assert len(set(places)) == len(set(SCENES))
    client = await connect(simulate("--start", "sync").url)
    ops = drive(way)
    await burst(client, ops)
    found = await answers(client, "tick 3")
    assert list(found) == [op["id"] for op in ops if op["op"] == "call_service"]
    assert [found[f"tick {i}"] for i in range(len(SCENES))] == wanted


@pytest.mark.parametrize("simulate", ["serve"], indirect=True)
async def test_ops_glued_behind_a_load_wait_for_it(simulate: Simulate, connect: Connect) -> None:
    client = await connect(simulate("--start", "sync").url)
    ops = drive("topic")
    await client.send_raw("".join(map(json.dumps, ops)))
    found = await answers(client, "tick 3")
    await client.send("call_service", service="/sim/reset", id="reset")
    await client.take_where(lambda frame: frame.get("id") == "reset", "the reset")
    assert [found[f"tick {i}"] for i in range(4)] == await step_by_step(client, "topic")


async def test_other_clients_are_served_during_repeated_loads(simulate: Simulate, connect: Connect) -> None:
    url = simulate().url
    loader, other = await connect(url), await connect(url)
    ops = [{**by_service(SCENES[i % 3]), "id": f"load {i}"} for i in range(4)]
    await burst(loader, ops)
    num_served = 0

    async def load() -> dict[str, Any]:
        return await answers(loader, "load 3")

    loading = asyncio.create_task(load())
    while not loading.done():
        await other.ask("/Service_MoraiEventCmd", option=0)
        num_served += 1
    assert list(await loading) == [op["id"] for op in ops]
    assert num_served > 0


@pytest.mark.parametrize("way", ["topic", "service"])
async def test_load_of_a_client_that_disconnects_at_once_takes_effect(
    simulate: Simulate, connect: Connect, way: str
) -> None:
    url = simulate("--start", "sync").url
    watcher, client = await connect(url), await connect(url)
    await burst(watcher, [by_service("town")])
    await answers(watcher, "load")
    wanted = await ego_place(watcher)
    await burst(watcher, [by_service("demo")])
    await answers(watcher, "load")
    assert await ego_place(watcher) != wanted
    await burst(client, [WAYS[way]("town")])
    await client.close()
    async with asyncio.timeout(PATIENCE):
        while await ego_place(watcher) != wanted:
            pass


@pytest.mark.parametrize("simulate", ["serve"], indirect=True)
async def test_ticks_go_on_while_another_client_loads_scenes_for_later_frames(
    simulate: Simulate, connect: Connect
) -> None:
    url = simulate("--start", "sync").url
    master, loader = await connect(url), await connect(url)
    await burst(master, [start()])
    await answers(master, "start")
    for i, name in enumerate(SCENES):
        await burst(loader, [at_next_frame(name)])
        await burst(master, [tick(f"tick {i}")])
        assert (await answers(loader, "load"))["load"] == {"result": True}
        answer = (await answers(master, f"tick {i}"))[f"tick {i}"]
        assert (answer["tick_status"], answer["frame"]) == (True, i + 1)
