"""The mirror of a master's parameters: what goes which way, and values that one side cannot have."""

from __future__ import annotations

import json
import logging

import pytest

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.parameters import Parameters
from rosbridge_sim.graph.ros1.master_parameters import MAX_UNSENT, MasterParameters
from tests.graph.participants import Somebody


def test_the_master_s_value_counts_and_what_it_lacks_is_sent() -> None:
    parameters = Parameters()
    me = Somebody()
    for name, text in (("/run_id", '"x"'), ("/speed", "1"), ("/robot_description", '"<robot/>"')):
        parameters.put(name, text, me)
    mirror = MasterParameters(parameters)
    mirror.begin({"speed": 2, "run_id": "real", "arm": {"joints": [1, 2.5, "a", True]}})
    assert {name: json.loads(parameters.text(name)) for name in parameters} == {
        "/arm/joints": [1, 2.5, "a", True],
        "/robot_description": "<robot/>",
        "/run_id": "real",
        "/speed": 2,
    }
    assert mirror.unsent == {"/robot_description": "<robot/>"}


def test_changes_of_the_master_are_not_sent_back() -> None:
    parameters = Parameters()
    mirror = MasterParameters(parameters)
    mirror.take("/arm/", {"x": 1, "y": {"z": 2}})
    mirror.take("/arm/y/", {})
    assert list(parameters) == ["/arm/x"]
    parameters.remove(["/arm/x"])
    assert mirror.unsent == {"/arm/x": None}


@pytest.mark.parametrize("text", ["null", "2147483648", '{"a":[null]}', "[" * 150 + "]" * 150])
def test_a_value_that_a_master_cannot_have_is_refused(text: str) -> None:
    parameters = Parameters()
    mirror = MasterParameters(parameters)
    with pytest.raises(GraphError, match="Parameter /a"):
        parameters.put("/a", text, Somebody())
    assert (list(parameters), mirror.unsent) == ([], {})


def test_a_value_that_cannot_be_kept_here_is_told_once(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING, "rosbridge_sim.ros1")
    parameters = Parameters()
    mirror = MasterParameters(parameters)
    deep: object = 1
    for _ in range(300):
        deep = [deep]
    for _ in range(3):
        mirror.take("/deep", deep)
    assert len(caplog.records) == 1


def test_changes_for_a_master_that_is_away_are_bounded() -> None:
    parameters = Parameters()
    mirror = MasterParameters(parameters)
    for i in range(MAX_UNSENT + 5):
        parameters.put(f"/n{i}", "1", mirror)
    assert len(mirror.unsent) == MAX_UNSENT
