"""The released client libraries, each in its own process: list topics, drive, serve and call."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator

import pytest

from tests.conftest import Connect
from tests.deployment import Place
from tests.end_to_end.programs import LIBRARIES, finish, is_python, start
from tests.support import Frame, ServerProcess, read_line

pytestmark = [pytest.mark.client, pytest.mark.slow]

PAIRS = (  # each library serves once and calls once, Python and JavaScript for each other
    ("roslibpy-twisted", "roslib2"),
    ("roslibpy-asyncio", "roslib1"),
    ("roslib2", "roslibpy-asyncio"),
    ("roslib1", "roslibpy-twisted"),
)


@pytest.fixture(scope="module")
def ros2_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    process = ServerProcess(tmp_path_factory.mktemp("ros2") / "log.txt", ("--ros", "2"))
    yield process
    process.stop_cleanly()


@pytest.mark.parametrize("library", LIBRARIES)
def test_client_library_lists_topics_and_drives_the_car(simulator: Place, library: str) -> None:
    seen = finish(start(library, "basics", simulator.port, "drive"))
    check_drive(seen, "morai_msgs/EgoVehicleStatus")
    assert ("/morai_sim" in seen["nodes"]) == (not simulator.is_attached)


@pytest.mark.parametrize("library", ["roslibpy-asyncio", "roslib2", "roslib1"])
def test_client_library_drives_the_car_under_the_other_ros_version(ros2_server: ServerProcess, library: str) -> None:
    """With the types as its program knows them; what it is told of them is ROS 2's."""
    check_drive(finish(start(library, "basics", ros2_server.port, "drive")), "morai_msgs/msg/EgoVehicleStatus")


async def test_status_of_an_action_comes_by_itself_after_each_change(
    ros2_server: ServerProcess, connect: Connect
) -> None:
    status, provider = "/lone/_action/status", await connect(ros2_server.url)
    await provider.send("advertise_action", action="/lone", type="example_interfaces/action/Fibonacci")
    await provider.subscribe(status)
    await provider.send("send_action_goal", action="/lone", args={"order": 1}, id="g")
    goal = await provider.take("send_action_goal")
    assert [each["status"] for each in (await provider.message(status))["status_list"]] == [2]
    await provider.send("action_result", action="/lone", id=goal["id"], values={}, status=4, result=True)
    assert [each["status"] for each in (await provider.message(status))["status_list"]] == [4]


def check_drive(seen: Frame, ego_type: str) -> None:
    assert {"/Ego_topic", "/Object_topic", "/ctrl_cmd", "/SyncModeInfo", "/clock", "/rosout"} <= set(seen["topics"])
    assert seen["topic_type"] == ego_type
    assert {"/SyncModeCmd", "/SyncModeWaitForTick", "/rosapi/topics"} <= set(seen["services"])
    assert seen["time"] > 0.0
    assert math.dist(seen["first"], seen["last"]) > 2.0


@pytest.mark.parametrize("library", LIBRARIES)
def test_client_library_sets_and_reads_a_parameter(server: ServerProcess, library: str) -> None:
    name = f"/{library}/kept".replace("-", "_")
    seen = finish(start(library, "basics", server.port, "remember", name))
    gone = f"refused: Parameter {name} is not set" if library == "roslib2" else None  # the others know no failure here
    kept = {"text": "안녕", "list": [1, 2.5, None]}
    assert seen == {"kept": kept, "is_listed": True, "is_still_listed": False, "gone": gone}


@pytest.mark.parametrize("library", [library for library in LIBRARIES if is_python(library)])
def test_roslibpy_logs_the_reason_of_each_mistake_until_its_program_reads_status_frames(
    server: ServerProcess, library: str
) -> None:
    seen = finish(start(library, "basics", server.port, "err"))
    reasons = ("Tried to register topic /Ego_topic", "Unable to resolve type std_srvs/Triger", "Message type morai")
    for line, reason in zip(seen["printed"], reasons, strict=True):
        assert line.startswith(f"('No handler registered for operation \"status error: {reason}")
    assert seen["printed_after"] == []
    assert [text.partition(";")[0] for text in seen["shown"]] == [
        "Message type morai_msgs/CtrlCmd does not have a field acel (did you mean accel?)"
    ]


@pytest.mark.parametrize(("provider", "caller"), PAIRS)
def test_a_service_of_one_client_answers_another(server: ServerProcess, provider: str, caller: str) -> None:
    name = f"/{provider}_{caller}/add".replace("-", "_")
    serving = start(provider, "basics", server.port, "serve", name)
    try:
        assert json.loads(read_line(serving)) == {"ready": "example_interfaces/AddTwoInts"}
        seen = finish(start(caller, "basics", server.port, "call", name))
    finally:
        finish(serving)  # closes its stdin, which tells it to go
    assert seen == {"sum": 42, "is_refused": True}
