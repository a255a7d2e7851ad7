"""Calls of the snapshot services on a simulator without sockets."""

from __future__ import annotations

from hashlib import blake2b
from typing import Any

from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.plain.plain_bytes import decode, encode
from rosbridge_sim.simulator.plain.snapshot_bytes import CHECKSUM_SIZE, SnapshotHead, pack, unpack
from tests.simulator.sim_harness import Client, SimHarness

__all__ = ["HEARD", "call", "forge", "hash_of", "hear", "restore", "snapshot"]

HEARD = (
    *("/clock", "/Ego_topic", "/Object_topic", "/CollisionData", "/VehicleCollisionData", "/SyncModeInfo", "/tf"),
    *("/tf_static", "/gps", "/imu", "/GetTrafficLightStatus", "/InsnStatus", "/IntscnTL_topic", "/sim/state_hash"),
    *("/ReplayInfo_topic", "/sim/process/state/msg/MoraiSimProcStatus", "/sim/scene/state", "/sim/scene/view"),
    *("/sim/drivers", "/sim/replay"),
)
"""All that the simulator publishes of the world and the first ego."""


def call(client: Client, service: str, **args: object) -> Any:  # noqa: ANN401 - a generated struct
    """The response of a service of ours."""
    answer = client.call(service, args)
    assert answer.is_ok, answer.values
    assert isinstance(answer.values, Message)
    return answer.values.value


def snapshot(client: Client, name: str = "") -> Any:  # noqa: ANN401 - a generated struct
    """Take a snapshot, with its bytes."""
    response = call(client, "/sim/snapshot", id=name, with_data=True)
    assert (response.result, response.message) == (True, "")
    return response


def restore(client: Client, saved: str | bytes, user_id: str = "me") -> Any:  # noqa: ANN401 - a generated struct
    """Restore by name or bytes; the response may be a refusal."""
    which = {"data": saved} if isinstance(saved, bytes) else {"id": saved}
    return call(client, "/sim/restore", user_id=user_id, **which)


def hash_of(client: Client) -> str:
    """The state hash."""
    found: str = call(client, "/sim/state_hash").hash
    return found


def hear(harness: SimHarness, *more: str) -> Client:
    """A client that listens to everything."""
    listener = harness.client()
    listener.listen(*HEARD, *more)
    return listener


def forge(data: bytes, change: Any) -> bytes:  # noqa: ANN401 - a function of (head, state) that changes the state
    """A snapshot whose state was changed, with a right checksum: what a hostile client would send."""
    head, packed = unpack(data)
    state = decode(packed)
    head = change(head, state) or head
    assert isinstance(head, SnapshotHead)
    forged = pack(head, state)
    assert blake2b(forged[:-CHECKSUM_SIZE], digest_size=CHECKSUM_SIZE).digest() == forged[-CHECKSUM_SIZE:]
    assert encode(state)
    return forged
