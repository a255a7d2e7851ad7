"""`score` shows what the driver of each ego is judged by."""

from __future__ import annotations

import json

import pytest

from rosbridge_sim import Simulator
from tests.cli.tool_fixture import answering, in_the_background, other_server
from tests.support import Client


async def test_score_shows_all_figures_of_each_ego() -> None:
    async with Simulator(port=0, start="sync", scenario="loop") as sim:
        first = await in_the_background("score", url=sim.url)
        assert (first.code, first.complaint) == (0, "scores are kept from now on, frame 0")
        async with await Client.open(sim.url) as client:
            await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=1_000)
            control = {"longlCmdType": 2, "velocity": 36.0}
            await client.ask("/SyncModeCtrlCmd", frame=0, command=control)
            await client.ask("/SyncModeWaitForTick", user_id="me", frame=50)
            shown = await in_the_background("score", url=sim.url)
            raw = await in_the_background("score", "--json", "--reset", url=sim.url)
    assert (shown.code, shown.err) == (0, "")
    assert shown.lines[0] == "ego 0, since frame 0"
    score = raw.json["scores"][0]
    assert f"  distance              {score['distance']:.3f} [m]" in shown.lines
    assert "  collisions            0" in shown.lines
    jerk = f"now {score['jerk']:.3f}, most {score['max_jerk']:.3f}, rms {score['rms_jerk']:.3f}"
    assert f"  jerk                  {jerk} [m/s^3]" in shown.lines
    assert len(shown.lines) == 11


async def test_followed_score_is_a_line_for_each_ego() -> None:
    async with Simulator(port=0) as sim:
        shown = await in_the_background("score", "--follow", "-n", "1", url=sim.url)
        raw = await in_the_background("score", "--follow", "-n", "1", "--json", url=sim.url)
    assert (shown.code, len(shown.lines)) == (0, 1)
    assert shown.lines[0].startswith("ego 0  distance 0.000 m  collisions 0  red lights 0")
    assert raw.json["scores"][0]["unique_id"] == 0


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--follow", "--reset"), "--reset: expected alone; --follow shows the scores as they come"),
        (("-n", "2"), "--count: expected with --follow"),
    ],
)
async def test_flags_that_do_not_fit_together_are_a_mistake(words: tuple[str, ...], complaint: str) -> None:
    done = await in_the_background("score", *words, url="ws://127.0.0.1:9")
    assert (done.code, done.complaint) == (2, complaint)


async def test_server_without_a_simulator_is_one_line() -> None:
    async with Simulator(port=0, world=False) as sim:
        done = await in_the_background("score", url=sim.url)
        followed = await in_the_background("score", "--follow", url=sim.url)
    assert (done.code, done.complaint) == (1, "Service /sim/score does not exist; does the rosbridge have a simulator?")
    assert followed.code == 1
    assert followed.complaint.startswith("no topic /sim/score here")


async def test_answer_of_any_shape_is_shown_and_cannot_write_escapes() -> None:
    wild = {
        "message": "a\x1b[2Jb",
        "scores": [7, {"unique_id": "\x1b[2J", "distance": None, "collision_ids": ["\x1b"], "jerk": 1}, {}],
    }

    async with other_server(answering(**{"/sim/score": wild})) as url:
        done = await in_the_background("score", url=url)
        assert done.code == 0
        assert "\x1b" not in done.out + done.err
        assert json.loads((await in_the_background("score", "--json", url=url)).out) == wild
