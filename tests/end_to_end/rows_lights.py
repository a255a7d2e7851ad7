"""Rows: traffic lights and intersections."""

from __future__ import annotations

from itertools import pairwise

import pytest

from tests.end_to_end.table_rows import SceneClient, Table

__all__ = ["TABLE"]

TABLE = Table()

RED, YELLOW, GREEN, LEFT = 1, 4, 16, 32

CROSSING = 10
"""The one in the middle, with TL22W; of its four phases, those with green end with 3 s of yellow."""

LASTS = 3.3, 0.3
"""Of each phase these times before its end are looked at [s]: green and then yellow, yellow and then the next phase."""


async def skip(play: SceneClient, left: float) -> None:
    """Leave out the time until so much of the crossing's phase is left [s]. `/IntscnTL_topic` must be heard."""
    name = "/IntscnTL_topic"

    async def look() -> tuple[int, float]:
        await play.tick(0.1)
        said = play.last(name)
        place = said["idx"].index(f"IntTL{CROSSING}")
        return said["state"][place], said["delta_time"][place]

    async def be_in(phase: int, seconds: float) -> None:
        at = {"intersection_status": phase, "intersection_status_time": seconds}
        await play.send("/InsnControl", intersection_index=str(CROSSING), **at)

    phase, _ = await look()
    await be_in(phase, 0.0)
    _, rest = await look()
    await be_in(phase, rest + 0.1 - left)


@TABLE.row(
    "/GetTrafficLightStatus",
    done="the ego waits on the avenue through a short cycle of its light, and is then put behind the stop line",
    seen="the light's name and type, and its green, yellow and red as /Morai_TLSrv has them; behind the line silence",
)
async def _(play: SceneClient) -> None:
    await play.listen("/GetTrafficLightStatus", "/IntscnTL_topic")
    shown = []
    await play.lead(100)
    for left in LASTS * 4:
        await skip(play, left)
        for _ in range(6):
            await play.tick(0.1)
            said = play.last("/GetTrafficLightStatus")
            assert (said["trafficLightIndex"], said["trafficLightType"]) == ("TL22W", 0)
            assert said["trafficLightStatus"] == await play.light("TL22W")
            shown.append(said["trafficLightStatus"])
    changes = [value for i, value in enumerate(shown) if not i or value != shown[i - 1]]
    assert set(changes) == {RED, YELLOW, GREEN}
    assert all(after == YELLOW for now, after in pairwise(changes) if now == GREEN)
    assert play.last("/GetTrafficLightStatus")["header"]["frame_id"] == "TrafficLightStatus"
    await play.put(0.0, 300.0)
    await play.tick()
    assert play.heard("/GetTrafficLightStatus") == []


@TABLE.row(
    "/SetTrafficLight",
    done="the light before a car is held at red for nine seconds, then set to green, then handed back (-1)",
    seen="the car waits before the line and goes when it is green; all of a group show it, others do not",
)
async def _(play: SceneClient) -> None:
    await play.listen("/Object_topic")
    await play.lead(1000)
    for _ in range(9):
        await play.send("/SetTrafficLight", trafficLightIndex="TL22W", trafficLightStatus=RED)
        await play.tick(1.0)
    car = (await play.objects())[9]
    assert (car["velocity"]["x"], -22.0 < car["position"]["x"] < -16.0) == (0.0, True), (
        "its rear axle; the line is at -14"
    )
    assert await play.light("TL22W") == RED
    other = await play.light("TL22E")
    await play.send("/SetTrafficLight", trafficLightIndex="TL22W", trafficLightStatus=GREEN)
    assert [await play.light(name) for name in ("TL22W", "TL22E")] == [GREEN, other]
    await play.tick(4.0)  # the command holds until the crossing's next phase
    assert (await play.objects())[9]["position"]["x"] > -14.0
    await play.send("/SetTrafficLight", trafficLightIndex="TL22W", trafficLightStatus=-1)
    assert await play.light("TL22W") in {RED, YELLOW, GREEN}
    await play.send("/SetTrafficLight", trafficLightIndex="PS22E1", trafficLightStatus=0)
    assert [await play.light(name) for name in ("PS22E1", "PS22E2")] == [0, 0]
    nobody = "no traffic light 'TL99'"
    await play.send_badly("/SetTrafficLight", nobody, trafficLightIndex="TL99", trafficLightStatus=RED)
    await play.send_badly("/SetTrafficLight", "sum of lamps", trafficLightIndex="TL22W", trafficLightStatus=2)
    no_arrow = "have the lamps 1 + 4 + 16;"
    await play.send_badly("/SetTrafficLight", no_arrow, trafficLightIndex="TL22W", trafficLightStatus=GREEN + LEFT)


@TABLE.row(
    "/InsnStatus",
    done="the ego is put into the middle crossing, and stands there while a phase goes by",
    seen="silence outside; inside the crossing's number, its phase, and for how long it has lasted",
)
async def _(play: SceneClient) -> None:
    await play.lead(1000)
    await play.listen("/InsnStatus", "/IntscnTL_topic")
    await play.tick(2.0)
    assert play.heard("/InsnStatus") == []
    await play.put(0.0, -5.25)
    await skip(play, 2.5)
    phases = []
    for _ in range(5):
        await play.tick(1.0)
        said, everything = play.last("/InsnStatus"), play.last("/IntscnTL_topic")
        place = everything["idx"].index(f"IntTL{said['intersection_index']}")
        assert said["intersection_status"] == everything["state"][place]
        phases.append((said["intersection_status"], said["intersection_status_time"]))
    assert {phase for phase, _ in phases} >= {0, 1}
    for (phase, time), (following, later) in pairwise(phases):
        assert later == pytest.approx(time + 1.0, abs=1e-3) if following == phase else later <= 1.0


@TABLE.row(
    "/InsnControl",
    done="the crossing that the ego stands in is put into phase 1, 4.5 s after its beginning, by number and by name",
    seen="/InsnStatus says so from the next frame on, and its lights show what belongs to that phase",
)
async def _(play: SceneClient) -> None:
    await play.put(0.0, -5.25)
    await play.listen("/InsnStatus")
    await play.tick()
    number, before = play.last("/InsnStatus")["intersection_index"], await play.light("TL22W")
    for index in (number, str(number), f"IntTL{number}"):
        await play.send("/InsnControl", intersection_index=index, intersection_status=0, intersection_status_time=0.0)
        assert await play.light("TL22W") == before
        await play.send("/InsnControl", intersection_index=index, intersection_status=1, intersection_status_time=4.5)
        await play.tick()
        said = play.last("/InsnStatus")
        assert (said["intersection_status"], said["intersection_status_time"]) == (1, pytest.approx(4.52))
        assert await play.light("TL22W") != before
    await play.send_badly("/InsnControl", "phases", intersection_index=number, intersection_status=77)


@TABLE.row(
    "/Morai_TLSrv",
    done="a crossing goes through its phases",
    seen="each light's status is told by its name, wherever the ego is; an unknown one has no name and -2",
)
async def _(play: SceneClient) -> None:
    shown = set()
    await play.listen("/IntscnTL_topic")
    await play.lead(100)
    for left in LASTS * 4:
        await skip(play, left)
        await play.tick(0.6)
        info = await play.ask("/Morai_TLSrv", idx="TL22W")
        assert info["idx"] == "TL22W"
        shown.add(info["status"])
        assert not ((await play.light("TL22S")) & GREEN and info["status"] & GREEN), "the two roads take turns"
    assert shown == {RED, YELLOW, GREEN}
    nobody = await play.ask("/Morai_TLSrv", idx="TL99")
    assert (nobody["idx"], nobody["status"]) == ("", -2)
