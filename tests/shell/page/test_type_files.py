"""TypeScript declarations at `/types/`: those of the server's release and generation, without a token."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim import Simulator
from tests.shell.page.test_web_page import TOKEN, get


@pytest.mark.parametrize(
    ("forms", "words"),
    [
        ({"release": "22.R2", "ros": 1}, ["steering", "secs"]),
        ({"release": "26.R1", "ros": 2}, ["front_steer", "nanosec"]),
    ],
)
async def test_file_has_the_forms_of_the_server(forms: dict[str, Any], words: list[str]) -> None:
    async with Simulator(port=0, token=TOKEN, **forms) as sim:
        answer = await get(sim, "/types/morai_msgs.d.ts")
        assert (answer.status, answer.headers["Content-Type"]) == (200, "application/typescript; charset=utf-8")
        assert all(word.encode() in answer.body for word in words)
        again = await get(sim, "/types/morai_msgs.d.ts", f"If-None-Match: {answer.headers['ETag']}")
        assert again.status == 304


async def test_list_names_all_files_and_other_names_are_not_found() -> None:
    async with Simulator(port=0) as sim:
        assert (await get(sim, "/types")).headers["Location"] == "types/"
        listed = (await get(sim, "/types/")).body.decode().split()
        assert {"morai_msgs.d.ts", "rosbridge_sim_msgs.d.ts", "std_msgs.d.ts"} <= set(listed)
        for name in ("morai_msgs", "nothing.d.ts", "../morai_msgs.d.ts", ".d.ts", "morai_msgs/msg/CtrlCmd.d.ts"):
            answer = await get(sim, f"/types/{name}")
            assert (answer.status, b"/types/ lists all" in answer.body) == (404, True)
        assert sim.num_bugs == 0
