"""`tick` drives synchronous mode from a shell, and waiting tools say why no message comes."""

from __future__ import annotations

import json
import shlex
from collections.abc import AsyncIterator, Iterable
from pathlib import Path

import pytest
import pytest_asyncio

from rosbridge_sim import Simulator
from rosbridge_sim.cli.tools.sync_commands import RESUME, why_silent
from rosbridge_sim.cli.tools.tool_client import open_bridge
from rosbridge_sim.simulator.sync.sync_table import SyncState
from tests.cli.tool_fixture import Frame, Result, answering, in_the_background, other_server
from tests.support import PATIENCE, Client


@pytest_asyncio.fixture
async def standing() -> AsyncIterator[Simulator]:
    """A world that stands at frame 0 until a master ticks."""
    async with Simulator(port=0, start="sync", sync_on_loss="wait") as sim:
        yield sim


async def lead(client: Client, user_id: str = "planner") -> None:
    await client.ask("/SyncModeCmd", user_id=user_id, start_sync_mode=True, time_step=20)


async def ended(sim: Simulator, num_left: int = 0) -> None:
    """Wait until the tool's connection has gone, and so many others are left."""
    async with await Client.open(sim.url) as client:
        while len(sim._server.clients) > num_left + 1:  # type: ignore[union-attr] # it listens
            await client.settle()


# Tools that wait


@pytest.mark.usefixtures("patient_answers")
@pytest.mark.parametrize("words", [("topic", "echo", "/Ego_topic", "--once"), ("topic", "hz", "/Ego_topic")])
async def test_waiting_tool_times_out_and_says_that_the_world_waits_for_ticks(
    standing: Simulator, words: tuple[str, ...]
) -> None:
    done = await in_the_background(*words, "--timeout", "0.05", url=standing.url)
    text = "no message on /Ego_topic within 0.05 s: the world stands until a master ticks, and there is no master;"
    assert (done.code, done.out) == (1, "")
    assert done.complaint == f"{text} rosbridge-sim tick N --start moves it"


@pytest.mark.usefixtures("patient_answers")
async def test_waiting_tool_names_the_master_of_synchronous_mode(standing: Simulator) -> None:
    async with await Client.open(standing.url) as master:
        await lead(master)
        done = await in_the_background("topic", "echo", "/Ego_topic", "--timeout", "0.05", url=standing.url)
        assert done.complaint.endswith("the world stands until a master ticks; the master is 'planner'")
        await master.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
        done = await in_the_background("topic", "echo", "/Ego_topic", "--timeout", "0.05", url=standing.url)
        where = "the world is paused, in synchronous mode with the master 'planner'"
        assert done.complaint.endswith(f": {where}; {RESUME}")


@pytest.mark.usefixtures("patient_answers")
async def test_waiting_tool_tells_a_pause_from_a_wait_for_ticks(standing: Simulator) -> None:
    async with Simulator(port=0) as free, await Client.open(free.url) as client:
        done = await in_the_background("topic", "echo", "/InsnStatus", "--timeout", "0.05", url=free.url)
        assert done.complaint == "no message on /InsnStatus within 0.05 s; --timeout waits longer", "it runs"
        await client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
        done = await in_the_background("topic", "echo", "/clock", "--timeout", "0.05", url=free.url)
        assert done.complaint == f"no message on /clock within 0.05 s: the world is paused; {RESUME}"
        words = RESUME.removeprefix("rosbridge-sim ").removesuffix(" resumes it")
        await in_the_background(*shlex.split(words), url=free.url)
        done = await in_the_background("topic", "echo", "/clock", "--once", "--timeout", str(PATIENCE), url=free.url)
        assert done.code == 0, "what is said to do is what helps"
    async with await Client.open(standing.url) as client:
        await client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
        done = await in_the_background("topic", "echo", "/clock", "--timeout", "0.05", url=standing.url)
        assert done.complaint.endswith(f": the world is paused, in synchronous mode with no master; {RESUME}")


@pytest.mark.usefixtures("patient_answers")
@pytest.mark.parametrize(
    ("mode", "status", "text"),
    [(16, 16, ": a replay is paused; "), (16, 32, ": the world is paused at the end of a replay; "), (1, 1, "; --")],
)
async def test_waiting_tool_reports_a_paused_replay(mode: int, status: int, text: str) -> None:
    process = "/sim/process/state/msg/MoraiSimProcStatus"
    latched = {
        "/SyncModeInfo": {"master_id": "", "status": False},
        process: {"current_mode": mode, "current_status": status},
    }

    def reply(frame: Frame) -> Iterable[str | bytes]:
        if frame["op"] == "subscribe" and frame["topic"] in latched:
            yield json.dumps({"op": "publish", "topic": frame["topic"], "msg": latched[frame["topic"]]})
        yield from answering(publishers={"publishers": ["/a"]}, topic_type={"type": "a/B"})(frame)

    # The wait for a message is over; the answers about its cause may take their time.
    async with other_server(reply) as url, open_bridge(url, None, PATIENCE) as bridge:
        error = await why_silent(bridge, "/x", 0.05)
    assert str(error).startswith(f"no message on /x within 0.05 s{text}")


@pytest.mark.usefixtures("patient_answers")
async def test_waiting_tool_reports_a_topic_without_a_publisher(standing: Simulator) -> None:
    words = ("topic", "echo", "/x", "--type", "std_msgs/String", "--timeout", "0.05")
    done = await in_the_background(*words, url=standing.url)
    assert (done.code, done.complaint) == (1, "no message on /x within 0.05 s: it has no publisher")


@pytest.mark.usefixtures("patient_answers")
async def test_recording_without_messages_times_out_and_is_complete(standing: Simulator, tmp_path: Path) -> None:
    words = ("record", str(tmp_path / "a.mcap"), "--topics", "/Ego*", "--timeout", "0.05")
    done = await in_the_background(*words, url=standing.url)
    assert done.code == 1
    assert "no message to record within 0.05 s: the world stands until a master ticks" in done.err
    assert (tmp_path / "a.mcap").read_bytes().endswith(b"\x89MCAP0\r\n")


@pytest.mark.usefixtures("patient_answers")
async def test_recording_of_missing_topics_names_them(standing: Simulator, tmp_path: Path) -> None:
    words = ("record", str(tmp_path / "a.mcap"), "--topics", "/Egg*", "--timeout", "0.05")
    done = await in_the_background(*words, url=standing.url)
    assert (done.code, done.err.count("within 0.05 s: none of the wanted topics is there")) == (1, 1)


async def test_tool_that_receives_messages_does_not_time_out() -> None:
    async with Simulator(port=0) as sim:
        done = await in_the_background(
            "topic", "echo", "/Ego_topic", "-n", "3", "--timeout", str(PATIENCE), url=sim.url
        )
        assert (done.code, done.err, done.out.count("---")) == (0, "", 3)
        done = await in_the_background("topic", "hz", "/clock", "-n", "3", "--timeout", str(PATIENCE), url=sim.url)
        assert (done.code, done.err) == (0, "")


@pytest.mark.usefixtures("patient_handshakes")
async def test_waiting_tool_asks_a_server_without_rosapi_for_no_reason() -> None:
    async with other_server(lambda _frame: ()) as url:
        words = ("topic", "echo", "/x", "--type", "a/B", "--timeout", "0.05")
        done = await in_the_background(*words, url=url)
    assert (done.code, done.complaint) == (1, "no message on /x within 0.05 s; --timeout waits longer")


@pytest.mark.usefixtures("patient_handshakes")
async def test_hz_ends_with_an_error_when_its_topic_falls_silent() -> None:
    def reply(frame: Frame) -> Iterable[str | bytes]:
        if frame["op"] == "subscribe" and frame["topic"] == "/x":
            yield from [json.dumps({"op": "publish", "topic": "/x", "msg": {}})] * 2
        yield from answering(publishers={"publishers": ["/a"]}, topic_type={"type": ""})(frame)

    async with other_server(reply) as url:
        done = await in_the_background("topic", "hz", "/x", "--type", "a/B", "--timeout", "0.05", url=url)
    assert (done.code, done.complaint) == (1, "no message on /x within 0.05 s; --timeout waits longer")


# tick


def frames(done: Result) -> list[int]:
    return [int(line.split()[1]) for line in done.lines]


async def test_tick_moves_a_free_running_world_and_leaves_it_free_running() -> None:
    async with Simulator(port=0) as sim:
        assert sim.node is not None
        done = await in_the_background("tick", "3", "--start", "--step", "40", url=sim.url)
        assert (done.code, done.err) == (0, "")
        first, *others = frames(done)
        assert others == [first + 2, first + 4]
        assert "  speed " in done.out
        assert "  heading " in done.out
        assert sim.node.sync.state is SyncState.FREE


async def test_tick_moves_a_world_in_synchronous_mode_and_leaves_it_there(standing: Simulator) -> None:
    assert standing.node is not None
    for start in (0, 5):
        done = await in_the_background("tick", "5", "--start", url=standing.url)
        assert frames(done) == list(range(start + 1, start + 6))
        await ended(standing)
        assert standing.node.sync.state is SyncState.OPEN


async def test_tick_json_output_is_one_answer_per_line(standing: Simulator) -> None:
    done = await in_the_background("tick", "2", "--start", "--json", url=standing.url)
    answers = [json.loads(line) for line in done.lines]
    assert [answer["frame"] for answer in answers] == [1, 2]
    assert answers[0]["vehicle_status"]["position"]["x"] == 40.0


async def test_refused_tick_shows_the_reason_and_a_remedy() -> None:
    async with Simulator(port=0) as sim, await Client.open(sim.url) as master:
        assert sim.node is not None
        done = await in_the_background("tick", url=sim.url)
        text = "the tick is refused: /SyncModeWaitForTick: synchronous mode is off; --start starts the mode"
        assert (done.code, done.complaint) == (1, text)
        await lead(master)
        who = "another user id is the master: 'planner'; --id planner ticks in its name"
        done = await in_the_background("tick", url=sim.url)
        assert done.complaint == f"the tick is refused: /SyncModeWaitForTick: {who}"
        done = await in_the_background("tick", "--start", url=sim.url)
        assert done.complaint == f"synchronous mode cannot be started: /SyncModeCmd: {who}"
        assert sim.node.sync.master_id == "planner"


async def test_tick_with_the_id_of_the_master_keeps_the_master() -> None:
    async with Simulator(port=0) as sim, await Client.open(sim.url) as master:
        assert sim.node is not None
        await lead(master)
        done = await in_the_background("tick", "2", "--id", "planner", url=sim.url)
        assert (done.code, len(frames(done))) == (0, 2)
        await ended(sim, num_left=1)
        assert sim.node.sync.master_id == "planner"


async def test_tick_of_a_paused_world_is_refused_and_ends_the_mode_it_started() -> None:
    async with Simulator(port=0) as sim, await Client.open(sim.url) as client:
        assert sim.node is not None
        await client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
        done = await in_the_background("tick", "--start", url=sim.url)
        assert done.complaint == f"the tick is refused: /SyncModeWaitForTick: the simulation is paused; {RESUME}"
        assert sim.node.sync.state is SyncState.FREE_PAUSED


async def test_tick_names_the_exact_frame_under_strict_frames() -> None:
    async with Simulator(port=0, start="sync", sync_frames="strict") as sim:
        done = await in_the_background("tick", "3", "--start", "--step", "60", url=sim.url)
    assert frames(done) == [3, 6, 9]


async def test_tick_reports_a_server_without_a_simulator() -> None:
    async with Simulator(port=0, world=False) as sim:
        done = await in_the_background("tick", "--start", url=sim.url)
    assert (done.code, done.complaint) == (
        1,
        "Service /SyncModeCmd does not exist; does the rosbridge have a simulator?",
    )


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("0",), "N: expected a number from 1 on; got '0'"),
        (("--step", "30"), "--step: expected a multiple of 20 milliseconds; got 30"),
        (("--step", "2000"), "--step: expected milliseconds, from 20 to 1,000; got '2000'"),
    ],
)
async def test_usage_error_of_tick_gives_exit_code_2(words: tuple[str, ...], complaint: str) -> None:
    done = await in_the_background("tick", *words, url="ws://127.0.0.1:1")
    assert (done.code, done.complaint) == (2, complaint)


async def test_malformed_answers_give_an_error_without_a_traceback() -> None:
    def reply(frame: Frame) -> Iterable[str | bytes]:
        response = {"result": True, "tick_status": True, "frame": "x", "vehicle_status": [], "time": 5}
        values = {"type": ""} if "rosapi" in str(frame.get("service")) else {"response": response}
        if frame["op"] == "call_service":
            yield json.dumps({"op": "service_response", "id": frame["id"], "values": values, "result": True})

    async with other_server(reply) as url:
        done = await in_the_background("tick", "--start", url=url)
    assert (done.code, done.out[:22]) == (0, "frame 0  time 5 s  x n")


# sync


async def test_sync_shows_the_mode_and_its_master() -> None:
    async with Simulator(port=0) as free:
        (line,) = (await in_the_background("sync", url=free.url)).lines
        assert line.startswith("synchronous mode is off, frame ")


async def test_sync_names_the_master(standing: Simulator) -> None:
    (line,) = (await in_the_background("sync", url=standing.url)).lines
    assert line.endswith("there is no master; rosbridge-sim tick N --start moves the world")
    async with await Client.open(standing.url) as master:
        await lead(master)
        done = await in_the_background("sync", url=standing.url)
        assert done.lines == ["synchronous mode is on, frame 0: the master is 'planner'"]
        assert (await in_the_background("sync", "--json", url=standing.url)).json["barrier"] is None


async def test_sync_shows_the_members_of_a_barrier(standing: Simulator) -> None:
    async with await Client.open(standing.url) as one, await Client.open(standing.url) as other:
        await one.values("/sim/barrier/join", {"user_id": "one", "deadline_s": 60.0})
        await other.values("/sim/barrier/join", {"user_id": "other"})
        request = {"request": {"user_id": "one", "frame": 1}}
        await one.send("call_service", service="/SyncModeWaitForTick", id="tick", args=request)
        await one.settle()
        done = await in_the_background("sync", url=standing.url)
        assert done.lines == [
            "synchronous mode is on, frame 0: a barrier leads, 20 ms a tick, deadline 60 s",
            "  one  has ticked",
            "  other  is waited for",
        ]
        done = await in_the_background("sync", "--json", url=standing.url)
        assert (done.json["sync"]["master_id"], done.json["barrier"]["waited_for"]) == ("/sim/barrier", ["other"])
        done = await in_the_background("tick", "--id", "stranger", url=standing.url)
        assert done.code == 1
        assert done.complaint.endswith("rosbridge-sim sync shows the members of the barrier")


async def test_sync_tells_that_there_is_no_simulator() -> None:
    async with Simulator(port=0, world=False) as bridge:
        done = await in_the_background("sync", url=bridge.url)
        assert (done.code, done.complaint) == (1, "no message on /SyncModeInfo; is a simulator there?")


# step


async def test_step_drives_and_shows_frame_ego_and_topics_and_leaves_the_mode() -> None:
    async with Simulator(port=0) as sim:
        assert sim.node is not None
        words = ("step", "--start", "-n", "100", "--velocity", "36", "--topic", "/clock", "--topic", "/gps")
        done = await in_the_background(*words, url=sim.url)
        assert (done.code, done.err) == (0, "")
        head, ego, clock, gps = done.lines
        assert head.endswith("  steps 100")
        assert ego.startswith("ego 0  x ")
        assert float(ego.split()[-2]) > 3.0
        assert json.loads(clock.removeprefix("/clock  "))["clock"]["secs"] >= 1
        assert gps.startswith('/gps  {"header"')
        assert sim.node.sync.state is SyncState.FREE


async def test_step_says_why_it_stopped_and_json_output_is_the_answer(standing: Simulator) -> None:
    words = ("step", "--start", "-n", "500", "--throttle", "1", "--stop-after", "5", "--stop-on", "red-light")
    done = await in_the_background(*words, url=standing.url)
    assert done.lines[0].endswith("  stopped by distance")
    done = await in_the_background("step", "--start", "--json", "--stop-at", "0,0,1000", url=standing.url)
    answer = json.loads(done.out)
    assert (answer["steps"], answer["stopped_by"], answer["result"]) == (1, "place", True)


async def test_refused_step_shows_the_reason_and_a_remedy() -> None:
    async with Simulator(port=0) as sim, await Client.open(sim.url) as master:
        done = await in_the_background("step", url=sim.url)
        assert (done.code, done.complaint) == (
            1,
            "the step is refused: synchronous mode is off; --start starts the mode",
        )
        await lead(master)
        done = await in_the_background("step", url=sim.url)
        who = "another user id is the master: 'planner'; --id planner ticks in its name"
        assert done.complaint == f"the step is refused: {who}"
        done = await in_the_background("step", "--id", "planner", "--topic", "/no", url=sim.url)
        assert done.complaint == "the step is refused: topics[0]: the simulator has no topic '/no'"


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("-n", "0"), "-n/--n: expected a number from 1 to 1,000; got '0'"),
        (("--throttle", "2"), "--throttle: expected a number from 0 to 1; got '2'"),
        (("--velocity", "30", "--brake", "1"), "--velocity: expected it alone, or --throttle and --brake; got both"),
        (("--stop-at", "1,2"), "--stop-at: expected X,Y,RADIUS in metres, such as 120.5,3,2; got '1,2'"),
        (("--stop-at", "1,2,nan"), "--stop-at: expected X,Y,RADIUS in metres, such as 120.5,3,2; got '1,2,nan'"),
        (("--step", "30"), "--step: expected a multiple of 20 milliseconds; got 30"),
    ],
)
async def test_usage_error_of_step_gives_exit_code_2(words: tuple[str, ...], complaint: str) -> None:
    done = await in_the_background("step", *words, url="ws://127.0.0.1:1")
    assert (done.code, done.complaint) == (2, complaint)


async def test_malformed_answer_to_a_step_gives_an_error_without_a_traceback() -> None:
    def reply(frame: Frame) -> Iterable[str | bytes]:
        response = {"result": True, "steps": 1, "frame": "x", "egos": [3, {}], "topics": {}, "stopped_by": 7}
        if frame["op"] == "call_service":
            yield json.dumps({"op": "service_response", "id": frame["id"], "values": response, "result": True})

    async with other_server(reply) as url:
        done = await in_the_background("step", url=url)
    assert (done.code, done.lines[0]) == (0, "frame 0  steps 1  stopped by 7")
