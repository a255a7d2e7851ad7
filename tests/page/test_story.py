"""The story of the loaded scenario on the page: its acts, events and conditions, and their marks on the timeline."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.async_api import expect

from rosbridge_sim.client import AsyncClient
from tests.conftest import Serve
from tests.page.conftest import OpenPage
from tests.simulator.story.story_texts import after, by_entity, event, group, lane_change, link, speed, story, teleport
from tests.support import PATIENCE

pytestmark = [pytest.mark.client, pytest.mark.slow]

CUT_IN = story(
    {"Ego": teleport(link("L1_00", 5)) + speed(20), "Car": teleport(link("L2_00", 30)) + speed(17)},
    group("Car", event("cut in", lane_change('<RelativeTargetLane entityRef="Car" value="1"/>', length=2), after(1.0))),
    more='<VariableDeclarations><VariableDeclaration name="moraiMap" value="track"/></VariableDeclarations>',
    end="<Evaluation><SuccessConditionGroup>"
    + by_entity("Ego", '<TraveledDistanceCondition value="90"/>')
    + "</SuccessConditionGroup></Evaluation>",
)


async def test_story_is_shown_as_it_goes_and_marked_on_the_timeline(
    serve: Serve, open_page: OpenPage, tmp_path: Path
) -> None:
    file = tmp_path / "cut_in.xosc"
    file.write_text(CUT_IN)
    server = serve("--scenario", str(file), "--ego", "story", "--start", "sync")
    page = await open_page(server)
    async with AsyncClient(server.url, timeout=PATIENCE) as client:
        await client.start_sync()
        await page.get_by_role("tab", name="Time").click()
        await client.step(5)
        parts = page.get_by_role("table", name="Acts and events")
        cut_in = parts.get_by_role("row", name="cut in")
        await expect(cut_in).to_contain_text("waits")
        await client.step(60)
        await expect(cut_in).to_contain_text("runs")
        await expect(page.get_by_role("button", name=re.compile(r"^Story, .*cut in begins"))).to_be_visible()
        conditions = page.get_by_role("table", name="Conditions")
        await expect(conditions.get_by_role("row", name="SimulationTimeCondition")).to_contain_text("✓")
        await client.step(200)
        await expect(cut_in).to_contain_text("done")
        await expect(page.locator(".story-line")).to_contain_text(
            re.compile(r"^5\.\d s\. Success at 4\.\d s\. SuccessConditionGroup 1: cut_in\.xosc: line ")
        )
        await expect(page.get_by_role("button", name=re.compile(r"^Story, .*verdict: success"))).to_be_visible()
