"""Choices about the node of ROS 2: which library is below it, and which services nodes may call."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.ros2 import joining
from tests.graph.participants import Somebody, YieldingParticipant

SERVER, CLIENT = Somebody(), YieldingParticipant()


@pytest.mark.parametrize(
    ("options", "owner", "may"),
    [
        ({}, SERVER, True),
        ({}, CLIENT, True),
        ({"ros2_discovery": "multicast"}, SERVER, False),
        ({"ros2_discovery": "multicast"}, CLIENT, True),
        ({"ros2_discovery": "multicast", "ros2_services": ("/sim/*",)}, SERVER, True),
        ({"ros2_services": ("/other",)}, SERVER, False),
        ({"ros2_services": ("/other",)}, CLIENT, False),
    ],
)
def test_services_of_the_server_are_for_nodes_of_this_machine_until_they_are_named(
    options: dict[str, Any],
    owner: Participant,
    may: bool,  # noqa: FBT001 - a column
) -> None:
    assert joining.is_for_nodes(Settings(**options), "/sim/reset", owner) is may


def test_rclpy_that_is_wanted_and_not_there_is_an_error_that_names_setup_bash(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    with pytest.raises(
        DocumentError, match=r"ros2-through: rclpy is not installed for this Python; source setup\.bash"
    ):
        joining.is_through_rclpy("rclpy")
    assert not joining.is_through_rclpy("auto")
