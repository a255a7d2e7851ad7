"""What a far side lacks is one line in the log."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rosbridge_sim.graph.attach.connection import PROBE
from rosbridge_sim.graph.attach.survey import SURVEY_DELAYS
from rosbridge_sim.graph.peers.peer import Peer
from tests.graph.attach.mirror_harness import Car, Program, SimHarness, make_deaf

# What it lacks


def test_existing_services_are_taken_over_with_one_log_line(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness()
    other = Program(harness.far)
    other.send("advertise_service", service="/honk", type="std_srvs/SetBool")
    harness.attach()
    taken = [line for line in lines() if "already" in line]
    assert taken == ["ws://far:9090: it already has /honk, from another or an earlier program; ours replace them"]
    harness.cut()
    harness.attach()
    assert [line for line in lines() if "already" in line] == []


def test_missing_package_at_the_far_bridge_is_one_log_line(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness()
    make_deaf(harness, "/honk")
    harness.attach()
    assert not any("package" in line for line in lines())  # it may take a while
    harness.run(until=sum(SURVEY_DELAYS) + 1.0)
    found = [line for line in lines() if "package" in line]
    text = "it does not know the package std_srvs, so it lacks /honk: build the package on its machine, and restart it"
    assert found == [f"ws://far:9090: {text}"]
    harness.cut()
    harness.attach()
    harness.run(until=10.0)
    assert not any("package" in line for line in lines())
    assert harness.car.state.has_listener  # the others go on


def test_missing_topic_at_the_far_bridge_is_reported_as_possibly_denied(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness()
    make_deaf(harness, "/state")
    harness.attach()
    harness.run(until=10.0)
    (line,) = [line for line in lines() if "globs" in line]
    assert "it does not have /state (std_msgs/Int32): its std_msgs may be another release" in line


def test_topic_of_another_type_at_the_far_bridge_is_reported(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness()
    Program(harness.far).send("advertise", topic="/state", type="std_msgs/String")
    harness.attach()
    harness.run(until=10.0)
    assert any("/state has type std_msgs/String there, not std_msgs/Int32" in line for line in lines())


def test_status_about_a_missing_package_gives_the_same_log_line(
    harness: SimHarness, lines: Callable[[], list[str]]
) -> None:
    text = "Unable to import std_msgs.msg from package std_msgs. Caused by: no module"
    for name in ("/state", "/plate"):
        harness.receive({"op": "status", "level": "error", "msg": text, "id": f"advertise:{name}"})
    (line,) = lines()
    assert "it does not know the package std_msgs, so it lacks /state, /plate, /pedal: build the package" in line


def test_status_about_an_unknown_package_is_logged_verbatim(
    harness: SimHarness, lines: Callable[[], list[str]]
) -> None:
    """What ours is made of, or something of somebody else's."""
    lines()
    text = "Unable to import geometry_msgs.msg from package geometry_msgs. Caused by: no module"
    harness.receive({"op": "status", "level": "error", "msg": text, "id": "advertise:/state"})
    assert lines() == [f"ws://far:9090: it says of advertise:/state: [error] {text}"]


def test_second_simulator_at_the_far_bridge_is_one_log_line(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness()
    Car(harness.far.bus)
    harness.attach()
    warnings = [line for line in lines() if "attached" not in line]
    assert len(warnings) == 1
    assert "it runs its own simulator (/car)" in warnings[0]


def test_far_bridge_of_the_other_ros_version_is_reported(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness()
    harness.far.mute.add(PROBE)
    harness.attach()
    question = harness.far.ops("call_service")[-1]
    values = {"time": {"sec": 1, "nanosec": 2}}
    harness.receive(
        {"op": "service_response", "service": PROBE, "id": question["id"], "values": values, "result": True}
    )
    assert any("it runs ROS 2" in line and "--ros 2" in line for line in lines())


def run_late(harness: SimHarness, delay: float, *, until: float) -> None:
    """Attach to a far side that handles each frame so much later [s]."""
    receive = harness.far._receive
    late: list[tuple[float, Peer, bytes]] = []
    harness.far._receive = lambda peer, frame, now: late.append((now + delay, peer, frame))  # type: ignore[method-assign]
    harness.attach()
    for step in range(round(until / 0.1)):
        now = step * 0.1
        while late and late[0][0] <= now:
            _, peer, frame = late.pop(0)
            receive(peer, frame, now)
        harness.mirror.advance(now)
        harness.pump(now)


@pytest.mark.parametrize("delay", [2.5, 6.0, 14.0])
def test_slow_rosapi_is_not_said_to_be_missing(delay: float, lines: Callable[[], list[str]]) -> None:
    harness = SimHarness()
    make_deaf(harness, "/honk")
    run_late(harness, delay, until=120.0)
    said = lines()
    assert not [line for line in said if "does not answer" in line]
    assert any("does not know the package std_srvs" in line for line in said) or delay > 10.0
    assert any("has not answered for" in line for line in said) == (delay > 10.0)


def test_silent_bridge_is_said_to_be_silent_and_for_how_long(lines: Callable[[], list[str]]) -> None:
    run_late(SimHarness(), 1_000.0, until=60.0)
    (line,) = [line for line in lines() if "rosapi" in line]
    assert "rosapi there has not answered for 10 s" in line
