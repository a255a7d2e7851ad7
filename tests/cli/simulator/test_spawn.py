"""`spawn` places an object into a running simulator."""

from __future__ import annotations

import pytest

from rosbridge_sim import Simulator
from tests.cli.tool_fixture import in_the_background, run


async def test_object_is_placed_and_its_number_shown() -> None:
    async with Simulator(port=0, start="sync", scenario="town") as sim:
        assert sim.node is not None
        world = sim.node.world
        done = await in_the_background("spawn", "kia k5", "--at=-5,2,90", "--speed", "3", url=sim.url)
        assert (done.code, done.err) == (0, "")
        row = world.row(int(done.out))
        assert (world.x[row], world.y[row], world.speed[row]) == (-5.0, 2.0, 3.0)
        words = ("--lane", "R0010L1", "--distance", "20", "--behaviour", "lane", "--route", "R0010L1, J10W1E", "--json")
        done = await in_the_background("spawn", "Bus", *words, url=sim.url)
        (uid,) = done.json["unique_ids"]
        assert world.routes[uid].tolist() == [world.roads.row("R0010L1"), world.roads.row("J10W1E")]
        done = await in_the_background("spawn", "Bus", "--ego", "--at", "0,0", url=sim.url)
        assert [str(ego.index) for ego in sim.node.egos] == ["0", done.out.strip()]


async def test_refusal_is_one_line_with_the_reason() -> None:
    async with Simulator(port=0) as sim:
        done = await in_the_background("spawn", "Buss", "--at", "0,0", url=sim.url)
        assert done.code == 1
        command = "rosbridge-sim service call /sim/catalogue lists all"
        assert done.complaint == f"model: the catalogue has no model 'Buss' (did you mean Bus?); {command}"
        done = await in_the_background("spawn", "Tesla", "--at", "0,0", url=sim.url)
        assert done.complaint.startswith("model: the catalogue has no model 'Tesla'; it has 2016_Hyundai_Ioniq, ")
        assert done.complaint.endswith(f", ...; {command}")
    async with Simulator(port=0, world=False) as sim:
        done = await in_the_background("spawn", "Box", "--at", "0,0", url=sim.url)
        assert (done.code, done.complaint) == (
            1,
            "Service /sim/spawn does not exist; does the rosbridge have a simulator?",
        )


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("Box",), "one of the arguments --at --lane is required"),
        (("Box", "--at", "1"), "--at: expected X,Y or X,Y,HEADING, such as 10,5,90; got '1'"),
        (("Box", "--at", "1,b"), "--at: expected X,Y or X,Y,HEADING, such as 10,5,90; got '1,b'"),
        (("Box", "--at", "1,2", "--distance", "3"), "--distance and --lateral: expected --lane with them"),
        (("Box", "--at", "1,2", "--speed", "fast"), "--speed: expected a number; got 'fast'"),
    ],
)
def test_mistake_in_the_command_is_one_line(words: tuple[str, ...], why: str) -> None:
    done = run("spawn", *words)
    assert done.code == 2
    assert why in done.complaint
