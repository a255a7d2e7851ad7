"""The wire vectors with sessions on a bus in memory."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.doctor.check import Check
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from tests.graph.bus_fixture import MemoryClients, make_bus
from tests.vector_player import FOLDER, load_vectors, play


@pytest.mark.parametrize("vector", load_vectors(), ids=lambda vector: vector["id"])
async def test_session_answers_as_the_vector_says(vector: dict[str, Any]) -> None:
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


def test_vector_ids_are_unique() -> None:
    ids = [vector["id"] for vector in load_vectors()]
    assert len(ids) == len(set(ids)) > 100


def test_every_row_of_the_protocol_table_has_a_vector() -> None:
    """`rows.json` names each row of the protocol's tables by an id of ours: section, table, row -> vectors."""
    rows: dict[str, list[str]] = json.loads((FOLDER / "rows.json").read_text())
    sections = {vectors[0].partition("/")[0] for vectors in rows.values()}
    known = {vector["id"] for vector in load_vectors() if vector["id"].partition("/")[0] in sections}
    assert len(rows) > 170
    assert {row: ids for row, ids in rows.items() if not ids or not known.issuperset(ids)} == {}
    assert known - {id_ for ids in rows.values() for id_ in ids} == set(), "vectors that belong to no row"


def test_every_vector_names_its_source() -> None:
    for vector in load_vectors():
        assert {"id", "source", "says", "steps"} <= vector.keys() <= {*Check.__struct_fields__}, vector["id"]
        assert vector["source"], vector["id"]
        assert vector["says"], vector["id"]
        assert all(next(iter(step))[-1] in "<>-?" for step in vector["steps"]), vector["id"]
