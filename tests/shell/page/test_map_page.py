"""The page `/map.json`: the values of `/sim/map`, with an ETag, for those who may have them."""

from __future__ import annotations

import asyncio
import json
from typing import Any, NamedTuple

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.client import AsyncClient
from rosbridge_sim.shell.page import map_page
from tests.support import PATIENCE

TOKEN = "s3cret"  # noqa: S105 - of these tests


class Page(NamedTuple):
    """An answer."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def json(self) -> Any:  # noqa: ANN401 - whatever the page has
        return json.loads(self.body)


async def get(sim: Simulator, *headers: str) -> Page:
    async with asyncio.timeout(PATIENCE):
        reader, writer = await asyncio.open_connection("127.0.0.1", sim.port)
        writer.write("\r\n".join(["GET /map.json?x=1 HTTP/1.1", "Host: localhost", *headers, "", ""]).encode())
        head, _, body = (await reader.read()).partition(b"\r\n\r\n")
        writer.close()
        await writer.wait_closed()
    first, *lines = head.decode().split("\r\n")
    return Page(int(first.split()[1]), dict(line.split(": ", 1) for line in lines), body)


@pytest.mark.parametrize("scenario", ["demo", "loop", "town", "hills", "motorway", "roundabout", "parking"])
async def test_page_has_the_values_of_the_service(scenario: str) -> None:
    async with Simulator(port=0, scenario=scenario) as sim, AsyncClient(sim.url, timeout=PATIENCE) as client:
        page, again = await asyncio.gather(get(sim), get(sim))
        assert page.json == await client.map()
        assert again == page
        assert (page.status, page.headers["Content-Type"]) == (200, "application/json")
        assert int(page.headers["Content-Length"]) == len(page.body)


async def test_program_that_has_the_map_gets_no_text_until_the_map_changes() -> None:
    async with Simulator(port=0) as sim, AsyncClient(sim.url, timeout=PATIENCE) as client:
        page = await get(sim)
        etag = page.headers["ETag"]
        for known in (etag, f'"other", W/{etag}', "*"):
            unchanged = await get(sim, f"If-None-Match: {known}")
            assert (unchanged.status, unchanged.body, unchanged.headers["ETag"]) == (304, b"", etag)
        assert (await get(sim, 'If-None-Match: "other"')).body == page.body
        await client.ask("/Service_MoraiSL", file_name="loop", delete_all=True, load_ego_vehicle_data=True)
        changed = await get(sim, f"If-None-Match: {etag}")
        assert (changed.status, changed.json["name"]) == (200, "loop")
        assert changed.headers["ETag"] != etag


async def test_page_wants_the_token_and_says_so() -> None:
    async with Simulator(port=0, token=TOKEN) as sim:
        page = await get(sim)
        assert (page.status, page.headers["WWW-Authenticate"]) == (401, "Bearer")
        assert (await get(sim, f"Authorization: Bearer {TOKEN}")).status == 200


async def test_page_follows_the_patterns_and_the_switch_of_the_service() -> None:
    async with Simulator(port=0, deny_service=("/sim/map",)) as sim:
        page = await get(sim)
        assert (page.status, page.body) == (403, b"Not allowed to call /sim/map, which tells the same\n")
    async with Simulator(port=0, deny_subscribe=("/sim/scene/map",)) as sim:
        assert (await get(sim)).status == 403, "the topic has the same map as markers"
    async with Simulator(port=0, services={"/sim/map": {"on": False}}) as sim:
        assert (await get(sim)).status == 404
    async with Simulator(port=0, world=False) as sim:
        assert (await get(sim)).status == 404


async def test_map_that_is_too_long_is_refused_with_the_way_to_read_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_page, "MAX_TEXT", 1_000)
    async with Simulator(port=0) as sim:
        page = await get(sim)
        assert page.status == 503
        assert b"page by page from /sim/map" in page.body


async def test_server_stops_while_the_text_is_being_written() -> None:
    async with Simulator(port=0, scenario="town") as sim:
        _, writer = await asyncio.open_connection("127.0.0.1", sim.port)
        writer.write(b"GET /map.json HTTP/1.1\r\nHost: localhost\r\n\r\n")
        await writer.drain()
        async with AsyncClient(sim.url, timeout=PATIENCE) as client:
            await client.confirm()
    writer.close()
