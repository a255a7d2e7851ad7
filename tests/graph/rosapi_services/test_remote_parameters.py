"""Parameters of other nodes by the services of rosapi: names, types, refusals, and what patterns keep."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.rosapi_services.remote_parameters import PATIENCE, RemoteParameters
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.topics_services import Call
from tests.graph.bus_fixture import Wire, make_store
from tests.graph.participants import Somebody


class Robot(Somebody):
    """A node with parameters, whose services are on the bus."""

    def __init__(self, policy: Policy) -> None:
        super().__init__("/robot")
        self.bus = Bus(make_store(2))
        Rosapi(self.bus, policy)
        self.remote = RemoteParameters(self.bus, policy, lambda service: service.owner is self)
        self.values: dict[str, dict[str, Any]] = {"speed": {"type": 3, "double_value": 1.5}}
        for name in ("get_parameters", "set_parameters", "list_parameters"):
            type_name = "rcl_interfaces/" + name.title().replace("_", "")
            self.bus.provide(self, f"/robot/{name}", type_name, self.take)
        self.wire = Wire(self.bus, policy)
        self.is_silent = False

    def take(self, call: Call, _now: float) -> None:
        self.remote.check_request(call.service.name, call)
        request: Any = call.request
        if self.is_silent:
            return
        answer: dict[str, Any]
        if call.service.name.endswith("get_parameters"):
            answer = {"values": [self.values.get(name, {"type": 0}) for name in request.names]}
        elif call.service.name.endswith("list_parameters"):
            answer = {"result": {"names": list(self.values)}}
        else:
            (one,) = request.parameters
            self.values[one.name] = {
                name: getattr(one.value, name) for name in ("type", "double_value", "string_value")
            }
            is_ok = one.name != "fixed"
            answer = {"results": [{"successful": is_ok, "reason": "" if is_ok else "it is fixed"}]}
        call.answer(call.service.type.response.check(answer, 0))

    def ask(self, service: str, /, **args: object) -> object:
        """Call a service as a client; its values if that succeeds, else the reason as text."""
        (frame,) = self.wire.says(op="call_service", service=service, args=args)
        return frame["values"]


@pytest.fixture
def robot() -> Robot:
    return Robot(Policy())


def test_parameters_of_nodes_are_read_and_set_with_the_type_that_they_have(robot: Robot) -> None:
    got = robot.ask("/rosapi/get_param", name="/robot:speed")
    assert got == {"value": "1.5", "successful": True, "reason": ""}
    robot.ask("/rosapi/set_param", name="robot:speed", value="2")
    assert (robot.values["speed"]["type"], robot.values["speed"]["double_value"]) == (3, 2.0)
    robot.ask("/rosapi/set_param", name="/robot:gait", value="slow")
    assert (robot.values["gait"]["type"], robot.values["gait"]["string_value"]) == (4, "slow")
    robot.ask("/rosapi/delete_param", name="/robot:speed")
    assert robot.values["speed"]["type"] == 0


def test_names_of_all_nodes_are_listed_and_unset_ones_are_told(robot: Robot) -> None:
    robot.bus.parameters.put("/own:name", "1", robot)
    assert robot.ask("/rosapi/get_param_names") == {"names": ["/own:name", "/robot:speed"]}
    assert robot.ask("/rosapi/has_param", name="/robot:speed") == {"exists": True}
    assert robot.ask("/rosapi/has_param", name="/robot:none") == {"exists": False}
    unset = {"value": '""', "successful": False, "reason": "Parameter /robot:none is not set"}
    assert robot.ask("/rosapi/get_param", name="/robot:none") == unset
    assert robot.ask("/rosapi/get_param", name="/robot:none", default="3") == {**unset, "value": "3"} | {
        "successful": True,
        "reason": "",
    }
    assert robot.ask("/rosapi/get_param", name="/own:name") == {"value": "1", "successful": True, "reason": ""}


def test_refusals_of_a_node_and_its_silence_are_told(robot: Robot) -> None:
    assert robot.ask("/rosapi/set_param", name="/robot:fixed", value="1") == "it is fixed"
    robot.is_silent = True
    robot.wire.says(op="call_service", service="/rosapi/get_param", args={"name": "/robot:speed"})
    robot.wire.says(op="call_service", service="/rosapi/get_param_names")
    robot.bus.expire(PATIENCE)
    answers = [frame["values"] for frame in robot.wire.hears()]
    assert answers == ["Timeout exceeded while waiting for service response", {"names": []}]


@pytest.mark.parametrize(
    ("policy", "service", "args"),
    [
        (Policy(parameter=Rule(deny=("*:speed",))), "/rosapi/get_param", {"name": "/robot:speed"}),
        (Policy(parameter=Rule(deny=("*:speed",))), "/rosapi/set_param", {"name": "/robot:speed", "value": "1"}),
        (Policy(parameter=Rule(deny=("*:speed",))), "/robot/get_parameters", {"names": ["speed"]}),
        (Policy(parameter=Rule(deny=("*:speed",))), "/robot/set_parameters", {"parameters": [{"name": "speed"}]}),
        (Policy(parameter=Rule(deny=("*:speed",))), "/robot/list_parameters", {}),
        (Policy(service=Rule(deny=("/rosapi/set_param",))), "/robot/set_parameters", {"parameters": []}),
    ],
)
def test_denied_parameters_are_kept_on_every_way(policy: Policy, service: str, args: dict[str, object]) -> None:
    robot = Robot(policy)
    assert str(robot.ask(service, **args)).startswith("Not allowed to")
    assert robot.values == {"speed": {"type": 3, "double_value": 1.5}}


def test_denied_names_are_not_listed() -> None:
    robot = Robot(Policy(parameter=Rule(deny=("*:speed",))))
    assert robot.ask("/rosapi/get_param_names") == {"names": []}
