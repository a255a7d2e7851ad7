"""Several ticking clients over real sockets: one is killed, one is late, one leaves, and the others go on."""

from __future__ import annotations

import asyncio

import pytest

from tests.conftest import Connect, Serve, Simulate
from tests.end_to_end.programs import finish, start
from tests.support import PATIENCE, Client, Frame

pytestmark = pytest.mark.slow

DEADLINE = 3.0
"""Of a barrier of which one member is to be late [s]: the others, and their ticks, are not late on a busy machine."""


async def join(client: Client, user_id: str, **terms: object) -> Frame:
    return await client.values("/sim/barrier/join", {"user_id": user_id, **terms})


async def tick(client: Client, user_id: str) -> Frame:
    return await client.ask("/SyncModeWaitForTick", user_id=user_id, frame=0)


async def tick_all(clients: dict[str, Client]) -> set[int]:
    """The frames that the members' ticks were answered with."""
    answers = await asyncio.gather(*(tick(client, user_id) for user_id, client in clients.items()))
    assert all(answer["tick_status"] for answer in answers)
    return {answer["frame"] for answer in answers}


async def told(client: Client, text: str) -> Frame:
    """The status with this text."""
    return await client.take_where(lambda frame: text in str(frame.get("msg")), f"a status with {text!r}")


async def test_others_go_on_and_are_told_when_one_is_killed_one_is_late_and_one_leaves(
    serve: Serve, connect: Connect
) -> None:
    url = serve().url
    clients = {user_id: await connect(url) for user_id in "abcd"}
    watcher = await connect(url)
    await watcher.subscribe("/sim/barrier", type="rosbridge_sim_msgs/Barrier")
    for user_id, client in clients.items():
        await client.send("set_level", level="warning")
        assert (await join(client, user_id, deadline_s=DEADLINE))["result"]
    start_frame = (await join(clients["a"], "a"))["frame"]
    for i in range(1, 6):
        assert await tick_all(clients) == {start_frame + i}

    killed = clients.pop("d")
    await watcher.settle()  # in a tick of before, d may have been the last one, too
    waiting = asyncio.gather(*(tick(client, user_id) for user_id, client in clients.items()))
    await watcher.message_where("/sim/barrier", lambda barrier: barrier["waited_for"] == ["d"])
    killed.cut()
    assert {answer["frame"] for answer in await waiting} == {start_frame + 6}
    for client in clients.values():
        assert (await told(client, "member 'd' is lost"))["level"] == "warning"

    late = clients["c"]
    others = {user_id: clients[user_id] for user_id in "ab"}
    assert await tick_all(others) == {start_frame + 7}
    assert "counts for the next boundary" in (await told(late, f"'c' has not ticked within {DEADLINE:g} s"))["msg"]
    barrier = await watcher.message_where("/sim/barrier", lambda barrier: any(barrier["late_counts"]))
    assert (barrier["members"], barrier["late_counts"]) == (["a", "b", "c"], [0, 0, 1])
    first = asyncio.ensure_future(tick(late, "c"))
    await watcher.message_where("/sim/barrier", lambda barrier: barrier["waited_for"] == ["a", "b"])
    assert await tick_all(others) == {start_frame + 8}
    assert (await first)["frame"] == start_frame + 8

    waiting = asyncio.gather(*(tick(client, user_id) for user_id, client in others.items()))
    await watcher.message_where("/sim/barrier", lambda barrier: barrier["waited_for"] == ["c"])
    assert (await late.values("/sim/barrier/leave", {"user_id": "c"}))["members"] == ["a", "b"]
    assert {answer["frame"] for answer in await waiting} == {start_frame + 9}
    for client in others.values():
        await told(client, "member 'c' has left")
    assert await tick_all(others) == {start_frame + 10}


@pytest.mark.client
async def test_roslibpy_members_go_on_when_another_is_killed(serve: Serve, connect: Connect) -> None:
    server = serve()
    programs = [
        start(library, "barrier", server.port, "member", library, "3", "20")
        for library in ("roslibpy-twisted", "roslibpy-asyncio")
    ]
    client = await connect(server.url)
    await client.subscribe("/sim/barrier", type="rosbridge_sim_msgs/Barrier")
    await client.message_where("/sim/barrier", lambda barrier: len(barrier["members"]) == 2)
    await join(client, "raw")
    for _ in range(5):
        frame = (await tick(client, "raw"))["frame"]
    client.cut()
    for seen in await asyncio.gather(*(asyncio.to_thread(finish, program) for program in programs)):
        assert (seen["joined"], seen["left"]) == (True, True)
        assert seen["frames"] == sorted(set(seen["frames"]))
        assert seen["frames"][-1] >= frame + 15
        assert {3, 2} <= set(seen["groups"])


async def test_peers_behind_one_bridge_are_one_member(simulate: Simulate, connect: Connect) -> None:
    place = simulate()
    one, other = await connect(place.url), await connect(place.url)
    assert (await join(one, "a", deadline_s=PATIENCE))["result"]
    answer = await join(other, "b")
    assert answer["result"] is not place.is_attached
    if place.is_attached:
        assert "peers behind one bridge are one member; it is 'a'" in answer["message"]
        assert (await join(other, "a"))["result"]
        frame = (await tick(one, "a"))["frame"]
        assert (await tick(other, "a"))["frame"] == frame + 1
    else:
        answers = await asyncio.gather(tick(one, "a"), tick(other, "b"))
        assert answers[0]["frame"] == answers[1]["frame"]
    await one.values("/sim/barrier/leave", {"user_id": "a"})
