"""Why a node sees nothing: each cause, and what is said of it."""

from __future__ import annotations

import pytest

from rosbridge_sim.graph.gateway.finding import Finding
from rosbridge_sim.graph.gateway.quality import PROFILES, Quality, why_unheard
from rosbridge_sim.graph.ros2.network_check import Discovery, SeenEndpoint, SeenGraph, check_graph, domain_of
from rosbridge_sim.records import replace

LOCAL = {"ROS_DOMAIN_ID": "7", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
SERVER = "/rosbridge_sim"
IMU = "sensor_msgs::msg::dds_::Imu_"
OUR_IMU = SeenEndpoint("/imu", IMU, is_writer=True, quality=Quality(), hash="RIHS01_a", node=SERVER)
THEIRS = SeenEndpoint("/imu", IMU, is_writer=False, quality=Quality(), hash="RIHS01_a", node="/planner")
FOUND = SeenGraph(7, "localhost", SERVER, (OUR_IMU, THEIRS), (), "")
LOST = SeenGraph(7, None, "", (), (), "")


def bad(seen: SeenGraph, environment: dict[str, str]) -> list[Finding]:
    return [one for one in check_graph(seen, environment) if not one.is_good]


def test_a_node_that_sees_all_has_six_good_steps() -> None:
    findings = check_graph(FOUND, LOCAL)
    steps = ["domain", "range", "interface", "quality of service", "type hash", "publishers"]
    assert [one.step for one in findings] == steps
    assert all(one.is_good and not one.advice for one in findings)


def test_without_a_server_the_last_steps_are_left_out_and_other_domains_are_named() -> None:
    (finding,) = bad(replace(LOST, other_domains=(12, 40)), LOCAL)
    assert finding.advice == "programs of this machine are in domain 12, 40: export ROS_DOMAIN_ID=12"
    (finding,) = bad(LOST, LOCAL)
    assert finding.advice == "rosbridge-sim serve --ros2-domain 7"
    assert len(check_graph(LOST, LOCAL)) == 3


@pytest.mark.parametrize(
    ("text", "domain"), [("", 0), (" 7 ", 7), ("232", 232), ("233", None), ("-1", None), ("²", None)]
)
def test_domain_of_the_variables(text: str, domain: int | None) -> None:
    assert domain_of({"ROS_DOMAIN_ID": text}) == domain
    assert domain_of({}) == 0


def test_another_or_an_odd_domain_of_the_nodes_is_named() -> None:
    (finding,) = bad(FOUND, LOCAL | {"ROS_DOMAIN_ID": "3"})
    assert finding.text == "the server is in domain 7, your nodes would be in 3"
    (finding,) = bad(FOUND, LOCAL | {"ROS_DOMAIN_ID": "x"})
    assert "expected a number from 0 to 232" in finding.text


@pytest.mark.parametrize(
    ("found_by", "variables", "advice"),
    [
        ("localhost", {}, "export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"),
        ("localhost", {"ROS_DISTRO": "humble"}, "export ROS_LOCALHOST_ONLY=1"),
        ("localhost", {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, "export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"),
        ("localhost", {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}, "export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"),
        ("multicast", {"ROS_LOCALHOST_ONLY": "1"}, "unset ROS_AUTOMATIC_DISCOVERY_RANGE ROS_LOCALHOST_ONLY"),
        (
            "localhost",
            {"RMW_IMPLEMENTATION": "rmw_zenoh_cpp"},
            "export RMW_IMPLEMENTATION=rmw_fastrtps_cpp, or rmw_cyclonedds_cpp",
        ),
    ],
)
def test_a_range_that_does_not_fit_has_an_advice(found_by: Discovery, variables: dict[str, str], advice: str) -> None:
    seen = replace(FOUND, found_by=found_by)
    (finding,) = bad(seen, {"ROS_DOMAIN_ID": "7"} | variables)
    assert (finding.step, finding.advice) == ("range", advice)


@pytest.mark.parametrize(
    ("found_by", "variables"),
    [
        ("localhost", {"ROS_LOCALHOST_ONLY": "1"}),
        ("localhost", {"ROS_STATIC_PEERS": "192.168.0.3;127.0.0.1"}),
        ("multicast", {}),
    ],
)
def test_a_range_that_fits_is_good(found_by: Discovery, variables: dict[str, str]) -> None:
    assert not bad(replace(FOUND, found_by=found_by), {"ROS_DOMAIN_ID": "7"} | variables)


@pytest.mark.parametrize(
    ("seen", "variables", "text"),
    [
        (FOUND, LOCAL, "your nodes and the server look on this machine (ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST)"),
        (LOST, {}, "your nodes look in the network (ROS_AUTOMATIC_DISCOVERY_RANGE is not set)"),
        (
            FOUND,
            {"ROS_LOCALHOST_ONLY": "1", "ROS_STATIC_PEERS": "a"},
            "your nodes and the server look on this machine (ROS_LOCALHOST_ONLY=1, ROS_STATIC_PEERS=a)",
        ),
    ],
)
def test_place_where_nodes_look_is_told_with_its_variables(
    seen: SeenGraph, variables: dict[str, str], text: str
) -> None:
    assert check_graph(seen, variables)[1].text == text


def test_pairs_that_fit_are_counted_and_none_is_said_in_words() -> None:
    more = replace(THEIRS, node="/other")
    texts = [
        check_graph(replace(FOUND, endpoints=each), LOCAL)[3].text for each in ((OUR_IMU, THEIRS, more), (OUR_IMU,))
    ]
    assert texts == [
        "all 2 pairs of publisher and subscription with the server fit",
        "no other node publishes or subscribes to a topic of the server",
    ]


def test_topic_of_many_publishers_is_not_told_beside_one_that_has_a_sole_one() -> None:
    sole = [replace(OUR_IMU, topic="/clock", node=node, is_sole=True) for node in (SERVER, "/bag")]
    shared = [replace(OUR_IMU, topic="/chat", node=node) for node in (SERVER, "/bag")]
    (finding,) = bad(replace(FOUND, endpoints=(*sole, *shared)), LOCAL)
    assert finding.text == "two publish /clock: /bag and /rosbridge_sim"


def test_files_that_configure_dds_are_named() -> None:
    (finding,) = [one for one in check_graph(FOUND, LOCAL | {"CYCLONEDDS_URI": "a"}) if one.advice]
    assert finding.advice == "if all else is ok: unset CYCLONEDDS_URI"


def test_a_machine_without_loopback_is_told() -> None:
    (finding,) = [one for one in bad(replace(LOST, why_no_loopback="unreachable"), LOCAL) if one.step == "interface"]
    assert finding.advice == "ip link set lo up"


@pytest.mark.parametrize(
    ("offered", "wanted", "num"),
    [
        (Quality(), Quality(), 0),
        (Quality(), PROFILES["sensor_data"], 0),
        (PROFILES["sensor_data"], Quality(), 1),
        (Quality(), PROFILES["latched"], 1),
        (PROFILES["sensor_data"], PROFILES["latched"], 2),
    ],
)
def test_a_subscription_that_asks_for_more_is_told_with_both_nodes(offered: Quality, wanted: Quality, num: int) -> None:
    assert len(why_unheard(offered, wanted)) == num
    seen = replace(FOUND, endpoints=(replace(OUR_IMU, quality=offered), replace(THEIRS, quality=wanted)))
    found = bad(seen, LOCAL)
    assert [one.step for one in found] == ["quality of service"] * (num > 0)
    assert all(one.text.startswith("/imu from /rosbridge_sim to /planner: ") for one in found)


def test_other_types_and_other_definitions_are_told() -> None:
    for other in (replace(THEIRS, type="a::msg::dds_::B_"), replace(THEIRS, hash="RIHS01_b")):
        (finding,) = bad(replace(FOUND, endpoints=(OUR_IMU, other)), LOCAL)
        assert finding.step == "type hash"
        assert "/planner" in finding.text
    assert not bad(replace(FOUND, endpoints=(OUR_IMU, replace(THEIRS, hash=""))), LOCAL), "Humble tells no hash"
    ours = replace(THEIRS, topic="/cmd_vel", type="geometry_msgs::msg::dds_::Twist_", node=SERVER)
    theirs = replace(OUR_IMU, topic="/cmd_vel", type="geometry_msgs::msg::dds_::TwistStamped_", node="/controller")
    (finding,) = bad(replace(FOUND, endpoints=(ours, theirs)), LOCAL)
    assert "--cmd-vel TwistStamped" in finding.advice


def test_what_other_nodes_have_among_themselves_does_not_matter() -> None:
    others = (replace(OUR_IMU, node="/a", hash="RIHS01_x"), replace(THEIRS, quality=PROFILES["latched"]))
    frames = [("tool", others[0]), ("tool", others[1])]
    assert not bad(replace(FOUND, endpoints=others, frames=frames), LOCAL)


def test_a_second_publisher_of_what_one_may_publish_is_wrong() -> None:
    ours = [replace(OUR_IMU, topic=f"/{name}", program="01.aa", is_sole=True) for name in ("a", "b", "c", "clock")]
    theirs = [replace(one, program="01.bb") for one in ours]
    seen = replace(FOUND, endpoints=(*ours, *theirs))
    (finding,) = bad(seen, LOCAL)
    both = "/rosbridge_sim (GUID 01.aa) and /rosbridge_sim (GUID 01.bb)"
    assert finding.text == f"two publish /clock, /a, /b and 1 more: {both}"
    assert "--ros2-domain" in finding.advice
    bag = replace(theirs[3], node="/rosbag2_player", is_sole=False)
    (finding,) = bad(replace(seen, endpoints=(*ours, bag)), LOCAL)
    assert finding.text == "two publish /clock: /rosbag2_player (GUID 01.bb) and /rosbridge_sim (GUID 01.aa)"
    shared = [replace(one, is_sole=False) for one in (ours[0], bag)]
    assert not bad(replace(seen, endpoints=shared), LOCAL), "a topic of clients may have many publishers"
    frames = [("base_link", ours[0]), ("odom", bag), ("base_link", bag), ("gps_link", ours[0])]
    (finding,) = bad(replace(seen, endpoints=ours, frames=frames), LOCAL)
    assert finding.text.startswith("two publish frame base_link: /rosbag2_player ")


def test_many_mistakes_are_a_few_lines() -> None:
    many = [replace(THEIRS, node=f"/n{i}", hash="RIHS01_b") for i in range(50)]
    (finding,) = bad(replace(FOUND, endpoints=(OUR_IMU, *many)), LOCAL)
    assert len(finding.text.splitlines()) == 21
    assert finding.text.endswith("and 30 more")
