"""Any calls in any order, with extreme values: all are answered, nothing is raised, the invariants hold."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from rosbridge_sim.errors import PeerError
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.simulator.sync.sync_table import MAX_WAITING_COMMANDS
from rosbridge_sim.world.state.world import Kind
from tests.mutations import examples
from tests.simulator.memory_recordings import MemoryRecordings
from tests.simulator.sim_harness import SCENARIOS, Client, SimHarness, make_store

SERVICES = {
    "/SyncModeCmd": "SyncModeCmd",
    "/SyncModeWaitForTick": "WaitForTick",
    "/SyncModeCtrlCmd": "SyncModeCtrlCmd",
    "/SyncModeSetGear": "SyncModeSetGear",
    "/SyncModeScenarioLoad": "SyncModeScenarioLoad",
    "/Service_MoraiSL": "ScenarioLoad",
    "/Service_MoraiEventCmd": "EventInfo",
    "/Service_MoraiVehicleSpec": "VehicleSpecIndex",
    "/Service_MoraiMapSpec": "MapSpecIndex",
    "/Morai_TLSrv": "MoraiTLIndex",
    "/Morai_SimProc": "MoraiSimProcHandle",
}
TOPICS = {
    "/ctrl_cmd": "CtrlCmd",
    "/ctrl_cmd_0": "CtrlCmd",
    "/SyncModeAddObj": "SyncModeAddObj",
    "/SyncModeRemoveObj": "SyncModeRemoveObj",
    "/ego_setting": "MultiEgoSetting",
    "/Ego-2/ctrl_cmd": "CtrlCmd",
    "/lamps": "Lamps",
    "/ghost_ctrl_cmd": "GhostMessage",
    "/NpcGhost_Topic": "NpcGhostCmd",
    "/SetTrafficLight": "SetTrafficLight",
    "/InsnControl": "IntersectionControl",
    "/ScenarioLoad": "ScenarioLoad",
    "/SensorPosControl": "SensorPosControl",
    "/SaveSensorData": "SaveSensorData",
    "/ReplayInfo_topic": "ReplayInfo",
}
VALUES: dict[str, st.SearchStrategy[Any]] = {
    "bool": st.booleans(),
    "int8": st.sampled_from([0, 1, 2, 3, 4, 8, 15, 16, 127, -1, -128]),
    "uint8": st.sampled_from([0, 1, 2, 16, 32, 255]),
    "int16": st.sampled_from([0, 1, 2, 3, 4, 5, 7, 9, 15, 16, 32, -1, -2, 2**15 - 1, -(2**15)]),
    "int32": st.sampled_from([0, 1, 2, 3, 4, 5, 7, 10, 13, 2**31 - 1, -1, -(2**31)]),
    "uint32": st.sampled_from([0, 20, 40, 1_000, 30, 2**32 - 1]),
    "uint64": st.sampled_from([0, 1, 2, 3, 10, 500, 2**64 - 1]),
    "float32": st.sampled_from([0.0, 1.0, -720.0, 3e38, math.nan]),
    "float64": st.sampled_from([0.0, 1.0, -1.0, 0.5, 90.0, 1e9, 1e300, -1e308, math.nan, math.inf, -0.0]),
    "string": st.sampled_from(["", "a", "b", "sync-1", "Bus", "Box", "C1", "L1", "P1", "x" * 300, *SCENARIOS]),
}


def bodies(message_type: MessageType, num: int = 2) -> st.SearchStrategy[dict[str, Any]]:
    """Bodies of a type, each field drawn from the worst that its type can hold; its lists have one length."""
    fields: dict[str, st.SearchStrategy[Any]] = {}
    lists: dict[str, st.SearchStrategy[Any]] = {}
    for field in message_type.definition.fields:
        if field.name == "header":
            continue
        nested = "/" in field.type
        value = bodies(make_store().message(field.type)) if nested else VALUES[field.type]
        if field.array is None:
            fields[field.name] = value
        else:
            lists[field.name] = st.lists(value, min_size=num, max_size=num)
    if lists and "number_of_ego_vehicle" in fields:
        del fields["number_of_ego_vehicle"]
        lists["number_of_ego_vehicle"] = st.just(num)
        lists["ego_index"] = st.sampled_from([[0, 2], [2, 3], [2, 2**31 - 1], [0, 1], [-1, 5], [7, 7]])
        for name, good in (("gear", 4), ("ctrl_mode", 16)):  # else hardly any would be right as a whole
            lists[name] = st.sampled_from([[good] * num, [0] * num, [9] * num])
        for name in ("global_roll", "global_pitch", "global_yaw", "velocity"):
            lists[name] = st.sampled_from([[0.0] * num, [-90.0] * num, [math.nan] * num])
    return st.fixed_dictionaries(lists, optional=fields)


@cache
def recordings() -> MemoryRecordings:
    """Recordings `a`, of a second in the crowd, and `b`, of nothing."""
    recordings, harness = MemoryRecordings(), SimHarness()
    recordings.record(harness.bus, "a", "/Ego_topic", "/Object_topic")
    harness.run(1.0)
    recordings.messages["b"] = []
    return recordings


def acts() -> st.SearchStrategy[tuple[str, dict[str, Any]]]:
    pairs = [
        st.tuples(st.just(name), bodies(make_store().message("morai_msgs/" + type_name)))
        for name, type_name in [*SERVICES.items(), *TOPICS.items()]
    ]
    rare: st.SearchStrategy[tuple[str, dict[str, Any]]] = st.tuples(
        st.sampled_from(["pass time", "leave", "reset"]), st.just({})
    )
    return st.one_of(*pairs, rare)


def act(harness: SimHarness, client: Client, name: str, body: dict[str, Any]) -> None:
    client.now = harness.now
    if name == "pass time":
        harness.run(0.1)
    elif name == "leave":
        client.leave()
    elif name == "reset":
        assert client.call("/sim/reset", {"seed": -1}).is_ok
    elif name in TOPICS:
        try:
            client.send(name, "morai_msgs/" + TOPICS[name], **body)
        except PeerError as error:
            assert str(error)  # noqa: PT017 - that it is raised is as well as that it is not
    else:
        client.call(name, {"request": body})  # answered at once, once, whatever the answer


@pytest.mark.slow
@examples(20)
@given(
    st.lists(st.tuples(st.integers(0, 1), acts()), max_size=25),
    st.sampled_from(["run", "sync"]),
    st.sampled_from(["crowd", "crossing"]),
)
def test_any_calls_in_any_order_keep_the_invariants(
    calls: list[tuple[int, tuple[str, dict[str, Any]]]], start: str, scene: str
) -> None:
    harness = SimHarness(scene, start=start, sync_on_loss="wait", sync_lease=0.5, recordings=recordings())
    clients = [harness.client(), harness.client()]
    clients[0].listen(*[name for name, topic in harness.bus.topics.items() if topic.publishers])
    for who, (name, body) in calls:
        act(harness, clients[who], name, body)
        sync, world = harness.node.sync, harness.world
        assert len(sync.waiting()) <= MAX_WAITING_COMMANDS
        assert 0 in world
        assert all(ego.is_there for ego in harness.node.egos)
        assert len(harness.node.egos) == np.count_nonzero(world.kind[world.alive] == Kind.EGO)
        assert all(uid in world for uid in world.contacts.ravel().tolist())
        assert all(np.isfinite(column).all() for column in (world.x, world.y, world.yaw, world.speed, world.steer))
        (info,) = harness.bus.topics["/SyncModeInfo"].latched
        assert (info.value.master_id, info.value.status) == (sync.master_id, sync.is_on)
        assert (info.value.frame, info.value.can_send_tick) == (world.frame, sync.can_send_tick)
        assert harness.bus.stamp_ns == world.frame * 20_000_000
        (process,) = harness.bus.topics["/sim/process/state/msg/MoraiSimProcStatus"].latched
        assert (process.value.current_mode == 16) == harness.node.scene.is_replaying
        assert (process.value.current_status == 1) != sync.is_paused
        assert harness.node.scene.is_replaying or not any(ego.moved_by for ego in harness.node.egos)
