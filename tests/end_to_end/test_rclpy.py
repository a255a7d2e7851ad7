"""Real nodes of ROS 2 (rclpy of Jazzy on Fast DDS, from PyPI) beside a server, on loopback."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader

from tests.cpu_time import run as run_to_end
from tests.end_to_end.programs import finish, start
from tests.support import ROOT, ServerProcess, miss, require_tool
from tests.vector_player import load_vectors

RCLPY = ROOT / ".venv" / "rclpy" / "bin" / "python"
DOMAIN = "231"
EXAMPLES = ROOT / "scripts" / "examples"

pytestmark = [pytest.mark.long, pytest.mark.client]


def require_rclpy() -> None:
    if not RCLPY.exists():
        miss("needs rclpy in .venv/rclpy (./scripts/test --long installs it on x86-64)")


@contextmanager
def rclpy_server(tmp_path: Path, *options: str) -> Iterator[ServerProcess]:
    """A server in the domain, as a node through rclpy."""
    require_rclpy()
    program = ServerProcess(tmp_path / "log", ["--ros2-domain", DOMAIN, *options], python=RCLPY)
    try:
        yield program
        program.stop_cleanly()
    finally:
        program.kill()


@pytest.fixture
def server(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[ServerProcess]:
    """A server in the domain, with more options of the test."""
    require_rclpy()
    program = ServerProcess(tmp_path / "log", ["--ros2-domain", DOMAIN, *getattr(request, "param", ())])
    yield program
    program.stop_cleanly()


def run_node(*command: str | Path) -> str:
    require_rclpy()
    own = {"ROS_DOMAIN_ID": DOMAIN, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "PYTHONPATH": str(ROOT)}
    done = run_to_end([str(RCLPY), *map(str, command)], env=os.environ | own)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_rclpy_sees_the_node_its_types_and_every_message(server: ServerProcess) -> None:
    assert server.is_alive
    seen = json.loads(run_node(ROOT / "tests" / "end_to_end" / "node_of_ros2.py"))
    assert seen["nodes"] == ["/judge", "/rosbridge_sim"]
    assert seen["node_of_imu"] == "rosbridge_sim"
    assert seen["is_hash_ours"]
    assert seen["types"]["/Ego_topic"] == ["morai_msgs/msg/EgoVehicleStatus"]
    assert len(seen["stamps"]) >= 250
    assert {after - before for before, after in pairwise(seen["stamps"])} == {20_000_000}, "none is lost"
    assert seen["num_fixes"] > 0
    assert seen["num_clocks"] > 0


def test_a_node_drives_along_a_path(server: ServerProcess) -> None:
    assert server.is_alive
    told = run_node(EXAMPLES / "drive_ros2.py", EXAMPLES / "course.txt")
    error = float(told.removeprefix("largest error ").removesuffix(" m\n"))
    assert error <= 0.3


def test_a_node_sees_markers_and_cameras_and_the_bytes_that_are_recorded(tmp_path: Path) -> None:
    require_rclpy()
    file = tmp_path / "run.mcap"
    options = ["--ros2-domain", DOMAIN, "--ros", "2", "--record", str(file), "--sensors", "camera"]
    program = ServerProcess(tmp_path / "log", options)
    told = json.loads(run_node(ROOT / "tests" / "end_to_end" / "witness_of_ros2.py"))
    program.stop_cleanly()
    assert told["counts"]["/sim/scene/map"] == 1, "it is latched, and comes once"
    assert told["seen"]["/sim/scene/map"] > 0
    assert told["seen"]["/sim/scene/objects"] > 0
    assert told["seen"]["/odom"] == "base_link"
    assert told["seen"]["/image_jpeg/camera_info"] == [640, 480]
    assert told["seen"]["/image_jpeg/compressed"] == "ffd8ff"
    with AnyReader([file]) as bag:
        connections = [one for one in bag.connections if one.topic == "/imu"]
        recorded = [bytes(raw) for _, _, raw in bag.messages(connections)]
    seen = [bytes.fromhex(raw) for raw in told["imu"]]
    assert [raw for raw in recorded if raw in set(seen)] == seen, "each is recorded, in this order"


@pytest.mark.parametrize(
    "server", [("--ros2-wait-for-command", "--ros2-command-deadline=10", "--real-time-factor=0")], indirect=True
)
def test_a_node_drives_in_lock_step_and_sees_every_frame(server: ServerProcess) -> None:
    assert server.is_alive
    told = json.loads(run_node(ROOT / "tests" / "end_to_end" / "lock_step_of_ros2.py", EXAMPLES / "course.txt"))
    assert told["error"] <= 0.3
    assert len(told["stamps"]) > 100 * 50, "the course takes two minutes"
    assert {after - before for before, after in pairwise(told["stamps"])} == {20_000_000}, "none is lost"


def test_services_pass_in_both_directions(tmp_path: Path) -> None:
    with rclpy_server(tmp_path, "--no-world") as program:
        told = json.loads(run_node(ROOT / "tests" / "end_to_end" / "services_of_ros2.py", program.url))
    assert told["wrong"] == {"web to node": 0, "node to web": 0}, "of 1,000 calls each, types without --schema-path"
    assert told["at once"] == {"web to node": 20, "node to web": 20}
    assert told["unknown"] == "Service /nobody does not exist"
    assert told["killed"].startswith("Service /doomed was unadvertised")
    assert told["hanging"] == "Timeout exceeded while waiting for service response"
    assert told["failed"] == [False, "Service /web_fails failed; its provider gave no reason"]
    assert told["cbor"] == "over CBOR"


def test_clients_of_every_kind_are_beside_one_node(tmp_path: Path) -> None:
    libraries = ["roslib2", "roslib1"]
    script = ROOT / "tests" / "end_to_end" / "beside_of_ros2.py"
    with rclpy_server(tmp_path, "--no-world") as program:
        clients = {name: start(name, "graph", program.port, "use", name) for name in libraries}
        told = json.loads(run_node(script, program.url, *libraries))
        said = told["said"] | {name: finish(client) for name, client in clients.items()}
    names = [*libraries, "roslibpy", "cbor"]
    assert told["heard"] == {name: f"{name} \u2713" for name in names}
    assert told["asked"] == {name: f"{name} was asked" for name in names}
    assert said == {name: {"text": "robot \u2713", "answer": [f"for {name}", 0.1]} for name in names}


@pytest.mark.parametrize("side", ["provider", "caller"])
def test_checks_of_services_and_actions_hold_across_the_graph(tmp_path: Path, side: str) -> None:
    wanted = [one["id"] for one in load_vectors() if one["id"].startswith(("services/", "actions/"))]
    without = [name for names in NOT_FOR_NODES[side].values() for name in names]
    assert not set(without) - set(wanted)
    names = [name for name in wanted if name not in without]
    script = ROOT / "tests" / "end_to_end" / "vectors_of_ros2.py"
    with rclpy_server(tmp_path, "--no-world") as program:
        told = json.loads(run_node(script, program.url, side, *names))
    assert told == dict.fromkeys(names, "")


def test_actions_and_parameters_pass_in_both_directions(tmp_path: Path) -> None:
    with rclpy_server(tmp_path, "--no-world", "--max-calls", "2", "--deny-param", "*:secret") as program:
        told = json.loads(run_node(ROOT / "tests" / "end_to_end" / "actions_of_ros2.py", program.url))
    assert told["listed"] == ["test_msgs/Fibonacci", True]
    assert told["web to node"] == [[[0, 1, 1, 2, 3, 5], True, 4], "the goal was rejected by its node", 5]
    assert told["has cancelled the goal of a client that left"]
    assert told["feedback"] == [[0, i] for i in range(5)], "all of it, in order"
    assert told["node to web"] == [[[0, 1, 1], 4], [True, 5], False]
    assert told["parameters"] == PARAMETERS


def test_no_packet_leaves_the_machine_though_it_has_another_interface() -> None:
    require_rclpy()
    script = ROOT / "tests" / "end_to_end" / "loopback_of_ros2.py"
    words = ["unshare", "-n", str(RCLPY), str(script)]
    told = json.loads(run_in_network(words))
    assert told["localhost"] == [0, 0]
    assert min(told["multicast"]) > 0, "the other choice leaves by it, so packets are counted"


def test_messages_of_a_tick_are_in_a_node_before_the_answer() -> None:
    told = json.loads(run_node(ROOT / "tests" / "end_to_end" / "tick_of_ros2.py"))
    assert told["heard"] == [[num, num] for num in range(1, 201)]
    assert told["stamps"]["/clock"] == told["stamps"]["/imu"]
    assert {after - before for before, after in pairwise(told["stamps"]["/imu"])} == {20_000_000}


def test_patterns_of_access_hold_for_a_node_in_both_directions(tmp_path: Path) -> None:
    check_rights(tmp_path, "--deny-publish=/robot/plan", "--deny-subscribe=/web/private")


def test_in_a_namespace_the_chosen_topics_alone_pass(tmp_path: Path) -> None:
    topics = ("--ros2-topics=/robot/state", "--ros2-topics=/web/public")
    check_rights(tmp_path, "--ros2-namespace=/sim1", *topics, namespace="/sim1")


def check_rights(tmp_path: Path, *options: str, namespace: str = "") -> None:
    """Check that `/robot/plan` and `/web/private` do not pass, nor services and parameters that are denied."""
    denied = ("--deny-service=*/secret", "--deny-param=*/robot:secret", "--deny-param=/robot:secret")
    script = ROOT / "tests" / "end_to_end" / "rights_of_ros2.py"
    with rclpy_server(tmp_path, "--no-world", *options, *denied) as program:
        told = json.loads(run_node(script, program.url, namespace))
    assert told["node heard"] == ["/web/public"]
    assert told["client heard"] == ["/robot/state"]
    assert told["node sees"] == told["node sees topics"] == [0, 1]
    assert [one if isinstance(one, str) else one["success"] for one in told["client calls"]] == [
        "Not allowed to call /robot/secret",
        True,
    ]
    assert told["parameters"][1]["value"] == "1"
    assert "/robot:secret" in told["by its service"]
    assert "/robot:secret" in str(told["parameters"][0])


def test_hostile_node_keeps_no_client_waiting(tmp_path: Path) -> None:
    script = ROOT / "tests" / "end_to_end" / "hostile_of_ros2.py"
    with rclpy_server(tmp_path, "--no-world") as program:
        told = json.loads(run_node(script, program.url))
    assert told["types"] == ["int"], "a subscription gets messages of its type alone"
    assert told["late"] == ["Timeout exceeded while waiting for service response"] * 3
    assert told["after late"], "it gets its own answer"
    assert told["names"] == [True, True], "of the node that answers, and not of the one that has 200,000"
    assert not told["unread"]
    assert told["dead"] == ["Action /dying was unadvertised", False]
    assert told["many"] > 900
    assert told["alive"]
    assert "error" not in (tmp_path / "log").read_text().lower()


def test_nodes_that_come_and_go_leave_nothing_behind() -> None:
    told = json.loads(run_node(ROOT / "scripts" / "soak" / "ros2_nodes.py", "--seconds", "1"))
    assert told["nodes"] == 14
    assert told["end"] == told["begin"], "descriptors, threads, tasks, and what the bus knows"


def run_in_network(words: list[str]) -> str:
    require_tool("unshare")
    if os.geteuid() != 0:
        miss("needs the right to make a network namespace")
    done = run_to_end(words)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_node_drives_in_lock_step_through_rclpy(tmp_path: Path) -> None:
    options = ("--ros2-wait-for-command", "--ros2-command-deadline=10", "--real-time-factor=0")
    script = ROOT / "tests" / "end_to_end" / "lock_step_of_ros2.py"
    with rclpy_server(tmp_path, *options):
        told = json.loads(run_node(script, EXAMPLES / "course.txt"))
    assert told["error"] <= 0.3
    assert {after - before for before, after in pairwise(told["stamps"])} == {20_000_000}, "none is lost"


NOT_INSTALLED = [
    *("services/unknown-package", "services/unknown-package-args", "services/unknown-package-result"),
    *("services/known-package-lacks", "services/standard-package", "actions/unknown-package"),
]

NOT_FOR_NODES: dict[str, dict[str, list[str]]] = {
    "provider": {
        "a node has no class of such a type": NOT_INSTALLED,
        "the number of fields is that of the type of the check": ["services/args-too-many"],
        "a node cannot fail a call, nor answer one with another type": [
            *("services/provider-refuses", "services/provider-refuses-bare", "services/bad-response"),
            *("services/response-reason", "services/result-false-empty", "services/result-absent-empty"),
            *("services/result-null-text", "services/result-false-other-object"),
            *("services/result-absent-wrong-values", "services/result-empty-type-false"),
            *("services/result-empty-type-absent", "services/response-unknown-id"),
        ],
        "rclpy has no such request": ["services/advertise-without-type", "services/unadvertise-unknown"],
        "ROS 2 does not tell two providers of one name apart": [
            *("services/duplicate-same-client", "services/duplicate-other-client"),
        ],
    },
    "caller": {
        "a node has no class of such a type": NOT_INSTALLED,
        "rosapi is for clients": [
            *("services/extra-type", "services/relative-name", "services/envelope", "services/type-spelling"),
            *("services/unset-parameter", "services/id-suffix"),
        ],
        "rclpy makes no such request": [
            *("services/args-by-position", "services/args-too-many", "services/args-unknown-field"),
            *("services/args-wrong-type", "services/advertise-without-type", "services/response-unadvertised"),
            *("actions/bad-args", "actions/wrong-type", "actions/cancel-all-by-call"),
            *("actions/cancel-unknown-by-call", "actions/cancel-one-by-call"),
        ],
        "a failure is `success: false` for a node; other types have none": [
            *("services/result-false-one-field", "services/result-false-other-object"),
            *("services/result-empty-type-false", "services/result-empty-type-absent"),
        ],
        "its node still sees the service for a moment": ["services/provider-lost"],
        "the graph lists no service that has never ended": ["services/duplicate-other-client"],
        "a goal that fails is aborted for a node": ["actions/provider-lost", "actions/unadvertise"],
        "ROS 2 does not tell whose goal it is": ["actions/caller-lost"],
        "actions of ROS 1 are topics": ["actions/by-topics"],
    },
}
"""Side of the node -> why a check of clients has no meaning there -> names."""

PARAMETERS: dict[str, object] = {
    "read": ["1.5", "true", '"slow"', "[1,2]"],
    "set": ["2.0", "[3,4]"],
    "names": [f"/robot:{name}" for name in ("flag", "gaits", "speed", "text", "use_sim_time")],
    "exists": [True, False],
    "unset": False,
    "refused": "the node says no",
    "denied": "Not allowed to use the parameter /robot:secret",
    "denied by another way": "Not allowed to use the parameter /robot:secret",
}
"""What `actions_of_ros2.py` is told of the parameters of its node."""
