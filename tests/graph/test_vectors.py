"""The vectors of the wire against bare sessions on a bus in memory."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.rosapi import Rosapi
from tests.graph.room import MemoryClients, make_bus
from tests.vector_player import load_vectors, play


@pytest.mark.parametrize("vector", load_vectors(), ids=lambda vector: vector["id"])
async def test_vector(vector: dict[str, Any]) -> None:
    bus = make_bus()
    Rosapi(bus)
    clients = MemoryClients(bus)
    await play(vector, clients)
    clients.leave_all()
    assert_nothing_is_left(bus)


def assert_nothing_is_left(bus: Bus) -> None:
    assert [owner.name for owner in bus.owners()] == ["/rosapi"]
    bus.expire(1e9)
    assert bus.topics == {}
    assert all(name.startswith("/rosapi/") for name in bus.services)


def test_every_vector_has_an_id_of_its_own() -> None:
    ids = [vector["id"] for vector in load_vectors()]
    assert len(ids) == len(set(ids)) > 100
