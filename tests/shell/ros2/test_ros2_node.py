"""A server as a node of ROS 2, and a program there that is not ours, on loopback."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from cyclonedds.core import Policy

from rosbridge_sim import Simulator
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.gateway.far_graph import Endpoint
from rosbridge_sim.shell.ros2.ros2_node import ENDPOINTS_PER_TURN, Ros2Choices, Ros2Node
from tests.shell.ros2.dds_program import Clock, CtrlCmd, Program, String, domain_of, until
from tests.support import Client

TOPICS = ("/clock", "/ctrl_cmd", "/words")
"""The DDS library takes some milliseconds for each type: these are enough here."""


class Joined(NamedTuple):
    """A simulator in a domain at frame 0, a client of it that is master, and a foreign program."""

    sim: Simulator
    client: Client
    program: Program
    domain: int

    async def tick(self) -> None:
        await self.client.ask("/SyncModeWaitForTick", user_id="1")

    async def heard_by_nodes(self, topic: str) -> None:
        """Wait until a node's subscription has the topic encoded."""
        bus = self.sim.bus
        assert bus is not None
        await until(lambda: topic in bus.topics and bus.topics[topic].has_listener)


@pytest.fixture
async def joined(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[Joined]:
    options: dict[str, Any] = getattr(request, "param", {})
    domain = domain_of(0)
    sim = Simulator(port=0, start="sync", data_dir=tmp_path, ros2_domain=domain, ros2_topics=TOPICS, **options)
    async with sim, await Client.open(sim.url) as client:
        await client.ask("/SyncModeCmd", user_id="1", start_sync_mode=True, time_step=20)
        program = Program(domain)
        yield Joined(sim, client, program, domain)
        program.close()


async def test_a_tick_s_messages_reach_nodes_of_ros2(joined: Joined) -> None:
    clock = await joined.program.subscribe("/clock", Clock)
    await joined.heard_by_nodes("/clock")
    for _ in range(5):
        await joined.tick()
    stamps = [(message.clock.sec, message.clock.nanosec) for message in [await clock.next() for _ in range(5)]]
    assert stamps == [(0, 20_000_000 * i) for i in range(1, 6)]


async def test_a_mock_is_there_for_nodes(tmp_path: Path) -> None:
    robot = tmp_path / "robot.yaml"
    robot.write_text("topics: {/words: {type: std_msgs/String, rate: 50, value: {data: hello}}}")
    domain = domain_of(14)
    async with Simulator(port=0, mock=robot, ros=2, ros2_domain=domain):
        program = Program(domain)
        assert (await (await program.subscribe("/words", String)).next()).data == "hello"
        program.close()


async def test_commands_of_nodes_reach_the_simulator(joined: Joined) -> None:
    writer = joined.program.publish("/ctrl_cmd", CtrlCmd)
    await joined.client.subscribe("/ctrl_cmd", type="morai_msgs/CtrlCmd")
    await joined.program.matched(writer)
    command = CtrlCmd(longl_cmd_type=2, accel=0.0, brake=0.0, steering=0.1, velocity=20.0, acceleration=0.0)
    writer.write(command)
    message = await joined.client.message("/ctrl_cmd")
    assert (message["longlCmdType"], message["steering"], message["velocity"]) == (2, 0.1, 20.0)


async def test_publishers_that_lose_messages_are_heard_too(joined: Joined) -> None:
    writer = joined.program.publish("/words", String, is_reliable=False)
    await joined.client.subscribe("/words", type="std_msgs/String")
    await joined.program.matched(writer)
    writer.write(String("from a sensor"))
    assert await joined.client.message("/words") == {"data": "from a sensor"}


@pytest.mark.parametrize("joined", [{"ros": 2}], indirect=True)
async def test_what_clients_publish_reaches_nodes(joined: Joined) -> None:
    await joined.client.send("advertise", topic="/words", type="std_msgs/msg/String")
    heard = await joined.program.subscribe("/words", String)
    await joined.heard_by_nodes("/words")
    await joined.client.send("publish", topic="/words", msg={"data": "from a client"})
    assert (await heard.next()).data == "from a client"


@pytest.mark.parametrize("joined", [{"ros2_qos": "/words=sensor_data"}], indirect=True)
async def test_a_publisher_of_a_chosen_quality_offers_it(joined: Joined) -> None:
    await joined.client.send("advertise", topic="/words", type="std_msgs/String")
    heard = await joined.program.subscribe("/words", String, is_reliable=False)
    await joined.heard_by_nodes("/words")
    await joined.client.send("publish", topic="/words", msg={"data": "from a sensor"})
    assert (await heard.next()).data == "from a sensor"
    assert Policy.Reliability.BestEffort in heard.offered


async def test_each_frame_waits_for_the_command_of_a_node(tmp_path: Path) -> None:
    domain = domain_of(4)
    options: dict[str, Any] = {"ros2_topics": TOPICS, "ros2_wait_for_command": True, "ros2_command_deadline": 3_600.0}
    async with Simulator(port=0, data_dir=tmp_path, ros2_domain=domain, **options) as sim:
        node, program = sim.node, Program(domain)
        assert node is not None
        clock = await program.subscribe("/clock", Clock)
        await until(lambda: node.context.bus.topics["/clock"].has_listener)
        commands = program.publish("/ctrl_cmd", CtrlCmd)
        await program.matched(commands)
        for frame in range(1, 21):
            commands.write(
                CtrlCmd(longl_cmd_type=1, accel=0.3, brake=0.0, steering=0.0, velocity=0.0, acceleration=0.0)
            )
            stamp = (await clock.next()).clock
            assert (stamp.sec, stamp.nanosec) == (0, frame * 20_000_000)
            assert node.world.frame == frame
        program.close()


class NotesOfTurns:
    """Counts what a node notes in each turn of the loop; it stands where the gateway does."""

    def __init__(self) -> None:
        self.sizes: list[int] = [0]

    def note_endpoints(self, found: Sequence[Endpoint], _lost: Sequence[str], _now: float) -> None:
        self.sizes[-1] += sum(one.topic.startswith("/many") and not one.is_named for one in found)

    def turn(self) -> None:
        self.sizes.append(0)
        asyncio.get_running_loop().call_soon(self.turn)


async def test_each_turn_of_the_loop_takes_a_few_endpoints_however_many_have_come() -> None:
    domain, notes = domain_of(7), NotesOfTurns()
    node = Ros2Node(Ros2Choices(domain), asyncio.get_running_loop())
    node.on_endpoints = notes.note_endpoints
    program = Program(domain)
    for i in range(100):
        program.publish(f"/many{i}", String)
        program.listen(f"/many{i}", String)
    notes.turn()
    await until(lambda: sum(notes.sizes) == 200)
    assert max(notes.sizes) <= 2 * ENDPOINTS_PER_TURN, "of writers and of readers each"
    program.close()
    node.stop()


async def test_lock_step_needs_a_domain() -> None:
    with pytest.raises(DocumentError, match="ros2-wait-for-command: expected with --ros2-domain"):
        await Simulator(port=0, ros2_wait_for_command=True).start()


async def test_a_type_of_commands_needs_their_topic() -> None:
    with pytest.raises(DocumentError, match="cmd-vel: expected with --standard-topics or --ros2-domain"):
        await Simulator(port=0, cmd_vel="TwistStamped").start()


async def test_a_domain_is_used_once_in_a_process(joined: Joined) -> None:
    with pytest.raises(DocumentError, match="another simulator of this process is in it"):
        await Simulator(port=0, ros2_domain=joined.domain).start()


def num_threads() -> int:
    """Threads that are not Python's: the loop starts some of those for its own work, and keeps them."""
    return len(list(Path("/proc/self/task").iterdir())) - threading.active_count()


async def test_stopping_leaves_no_thread(tmp_path: Path) -> None:
    before = num_threads()
    async with Simulator(port=0, start="sync", data_dir=tmp_path, ros2_domain=domain_of(1), ros2_topics=TOPICS):
        assert num_threads() > before + 2
    await until(lambda: num_threads() <= before)


async def test_a_token_needs_a_word_of_consent() -> None:
    with pytest.raises(DocumentError, match="--ros2-without-token"):
        await Simulator(port=0, token="secret", ros2_domain=domain_of(2)).start()  # noqa: S106 - for a test
