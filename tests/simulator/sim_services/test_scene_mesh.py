"""`/sim/scene/mesh`: what stands still of the scene, in pages, made while others are served."""

from __future__ import annotations

import json
from typing import Any

from rosbridge_sim.schema.message import Message
from tests.simulator.sim_harness import Client, ManualReader, SimHarness


def values_of(client: Client, page: int, service: str = "/sim/scene/mesh") -> dict[str, Any]:
    answer = client.call(service, {"page": page})
    assert isinstance(answer.values, Message), answer.values
    values: dict[str, Any] = json.loads(answer.values.json)
    return values


def test_all_pages_have_one_digest_and_that_of_the_map_and_a_page_behind_them_is_refused() -> None:
    client = SimHarness("crossing").client()
    first = values_of(client, 0)
    assert first["result"]
    assert first["num_triangles"] > 0
    pages = [values_of(client, number) for number in range(first["num_pages"])]
    assert {page["digest"] for page in pages} == {first["digest"]}
    assert first["map_digest"] == values_of(client, 0, "/sim/map")["digest"]
    behind = values_of(client, first["num_pages"])
    assert (behind["result"], behind["message"]) == (False, f"page: expected 0..{len(pages) - 1}, got {len(pages)}")


def test_mesh_is_made_by_the_reader_once_while_others_are_served() -> None:
    reader = ManualReader()
    harness = SimHarness("crossing", reader=reader)
    client = harness.client()
    meshes: list[Any] = []
    for _ in range(65):
        harness.bus.call(client, "/sim/scene/mesh", {"page": 0}, meshes.append, now=0.0)
    assert len(reader.waiting) == 1
    assert "64 calls wait for the mesh" in meshes.pop().values.value.message
    others: list[Any] = []
    harness.bus.call(client, "/sim/nearest_lane", {}, others.append, now=0.0)
    assert others.pop().values.value.result
    assert meshes == []
    reader.hand_over()
    assert [answer.values.value.result for answer in meshes] == [True] * 64
