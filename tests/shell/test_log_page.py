"""The page `/log.json`: the last refusals and warnings, for those who may subscribe to `/sim/refusals`."""

from __future__ import annotations

import asyncio
import json
import logging
from typing import Any

from rosbridge_sim import Simulator
from rosbridge_sim.shell.monitoring.log_page import MAX_WARNINGS
from tests.support import PATIENCE, Client

TOKEN = "s3cret"  # noqa: S105 - of these tests


async def get(sim: Simulator, *headers: str) -> tuple[int, Any]:
    async with asyncio.timeout(PATIENCE):
        reader, writer = await asyncio.open_connection("127.0.0.1", sim.port)
        writer.write("\r\n".join(["GET /log.json HTTP/1.1", "Host: localhost", *headers, "", ""]).encode())
        head, _, body = (await reader.read()).partition(b"\r\n\r\n")
        writer.close()
    status = int(head.split()[1])
    return status, json.loads(body) if status == 200 else body.decode()


async def test_page_has_refusals_with_their_clients_and_warnings_without_them_within_bounds() -> None:
    async with Simulator(port=0) as sim, await Client.open(sim.url) as client:
        for number in range(300):
            await client.send("publish", topic=f"/t{number}", msg={"no": "x" * 10_000})
        await client.settle()
        logger = logging.getLogger("rosbridge_sim.test")
        for number in range(MAX_WARNINGS + 5):
            logger.warning("a warning %d %s", number, "x" * 10_000)
        status, page = await get(sim)
        assert (status, page["total_refusals"]) == (200, 300)
        last = page["refusals"][-1]
        assert (last["op"], last["subject"], last["frame"] >= 0) == ("publish", "/t299", True)
        assert last["client"].startswith("127.0.0.1:")
        assert "advertise" in last["text"]
        assert len(page["warnings"]) == MAX_WARNINGS
        assert not any("refused" in warning["text"] for warning in page["warnings"])
        assert page["warnings"][-1]["text"].startswith(f"a warning {MAX_WARNINGS + 4} ")
        assert len(json.dumps(page)) < 300_000


async def test_page_wants_the_token_and_follows_the_patterns_of_the_topic() -> None:
    async with Simulator(port=0, token=TOKEN) as sim:
        assert (await get(sim))[0] == 401
        assert (await get(sim, f"Authorization: Bearer {TOKEN}"))[0] == 200
    async with Simulator(port=0, deny_subscribe=("/sim/refusals",)) as sim:
        assert await get(sim) == (403, "Not allowed to subscribe to /sim/refusals, which tells the same\n")
    async with Simulator(port=0, deny_subscribe=("/rosout",)) as sim:
        logging.getLogger("rosbridge_sim.test").warning("only for those who may read the log")
        assert (await get(sim))[1].get("warnings", []) == []
