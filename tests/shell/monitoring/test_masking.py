"""The token is masked in what clients write."""

from __future__ import annotations

import json
import logging
from urllib.parse import quote

import pytest
from websockets.asyncio.client import connect

from rosbridge_sim import Simulator
from rosbridge_sim.shell.monitoring.masking import MIN_MASKED, mask_of
from tests.support import Client

TOKEN = "s3cret/+="  # noqa: S105 - a test's own


def test_token_is_masked_as_text_and_url_encoded() -> None:
    mask = mask_of(TOKEN)
    for spelling in (TOKEN, quote(TOKEN), quote(TOKEN, safe="")):
        assert mask(f"a {spelling} b {spelling}") == "a ... b ..."
    assert mask("s3cret") == "s3cret"


@pytest.mark.parametrize("token", [None, "", "x" * (MIN_MASKED - 1)])
def test_missing_or_short_token_masks_nothing(token: str | None) -> None:
    assert mask_of(token)("xxx a text") == "xxx a text"


async def test_token_written_by_a_client_is_masked_in_log_and_topics(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.DEBUG, "rosbridge_sim")
    async with Simulator(port=0, world=False, token=TOKEN) as sim:
        socket = await connect(f"{sim.url}/?token={quote(TOKEN)}", proxy=None)
        async with Client(socket) as client:
            for topic in ("/rosout", "/sim/refusals"):
                await client.send("subscribe", topic=topic)
            for frame in (
                {"op": "status", "level": "info", "msg": f"connected to ws://sim/?token={quote(TOKEN)}"},
                {"op": "auth", "token": [TOKEN]},
                {"op": "subscribe", "topic": f"/{TOKEN}"},
            ):
                await client.send_raw(json.dumps(frame))
            refusals = await client.message_where("/sim/refusals", lambda message: message["total"] == 2)
            topics = [frame for frame in await client.settle() if frame["op"] == "publish"]
    assert "connected to ws://sim/?token=..." in caplog.text
    assert "Invalid value: ['...']" in caplog.text
    assert [one["subject"] for one in refusals["refusals"]] == ["", "/..."]
    for text in (caplog.text, str(topics), str(refusals)):
        assert TOKEN not in text
        assert quote(TOKEN) not in text
