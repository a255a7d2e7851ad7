"""What `ros1 check` says about graphs in which something is wrong."""

from __future__ import annotations

import pytest

from rosbridge_sim.graph.ros1.master_check import SeenMaster, check_master
from rosbridge_sim.graph.ros1.master_view import MasterView, Registration
from rosbridge_sim.records import replace

SERVER = "/rosbridge_sim"
VIEW = MasterView(
    {
        Registration("Publisher", "/imu"): [SERVER],
        Registration("Publisher", "/clock"): [SERVER],
        Registration("Subscriber", "/imu"): ["/planner"],
        Registration("Subscriber", "/clock"): [SERVER],
        Registration("Service", "/sim/reset"): [SERVER],
    },
    {"/imu": "sensor_msgs/Imu", "/clock": "rosgraph_msgs/Clock"},
)
GOOD = SeenMaster(
    "http://robot:11311",
    view=VIEW,
    server=SERVER,
    server_uri="http://127.0.0.1:1/",
    topics={"/imu": "sensor_msgs/Imu", "/clock": "rosgraph_msgs/Clock"},
    uses_sim_time=True,
)


def test_a_graph_in_which_all_is_well() -> None:
    assert [(one.step, one.is_good) for one in check_master(GOOD)] == [
        (step, True) for step in ("master", "server", "address", "own name", "types", "clock", "what is there")
    ]
    assert check_master(GOOD)[-1].text == "2 topics and 1 services of the server; subscribed to: /imu"


@pytest.mark.parametrize(
    ("seen", "step", "text", "advice"),
    [
        (SeenMaster("", why_no_master="http://a:1: refused"), "master", "http://a:1: refused", "start roscore"),
        (replace(GOOD, server_uri=""), "server", "no node /rosbridge_sim", "--ros1-master http://robot:11311"),
        (replace(GOOD, why_no_server="refused"), "address", "cannot be reached at http://127", "--ros1-host"),
        (replace(GOOD, why_no_name="ROS_HOSTNAME is pc"), "own name", "ROS_HOSTNAME is pc", "ROS_HOSTNAME=localhost"),
        (
            replace(GOOD, view=replace(VIEW, types={"/imu": "my_msgs/Imu"})),
            "types",
            "/imu: the server has sensor_msgs/Imu, other nodes my_msgs/Imu",
            "another name",
        ),
        (
            replace(GOOD, view=replace(VIEW, nodes={Registration("Publisher", "/clock"): [SERVER, "/gazebo"]})),
            "clock",
            "/rosbridge_sim and /gazebo publish /clock",
            "--ros1-namespace",
        ),
        (replace(GOOD, view=replace(VIEW, nodes={})), "clock", "no node publishes /clock", "start a simulator"),
    ],
)
def test_what_is_wrong_is_named_with_what_to_do(seen: SeenMaster, step: str, text: str, advice: str) -> None:
    (wrong,) = [one for one in check_master(seen) if not one.is_good]
    assert wrong.step == step
    assert text in wrong.text
    assert advice in wrong.advice
