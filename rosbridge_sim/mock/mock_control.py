"""`/mock/set_fault`, a service, and `/mock/faults`, a latched topic: they switch the faults of a mock and show them."""

from __future__ import annotations

from typing import Any

from rosbridge_sim.documents.document_reading import check_values
from rosbridge_sim.documents.yaml_reading import read_yaml
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.mock.faults import CONTROL, MAX_FAULTS, FaultRule, FaultTable
from rosbridge_sim.mock.mock_model import FAULT, is_plain_name
from rosbridge_sim.mock.mock_node import MockNode
from rosbridge_sim.schema.message import Message
from rosbridge_sim.suggestions import hint, listing

SET_FAULT = f"{CONTROL}set_fault"
FAULTS = f"{CONTROL}faults"


class MockControl(Participant):
    """The participant that offers them.

    Attributes:
        faults: the faults; `show` publishes them anew.
    """

    name = "/mock_control"

    def __init__(self, bus: Bus, node: MockNode, faults: FaultTable) -> None:
        self.faults = faults
        self._bus, self._node = bus, node
        self._shown: list[Any] = []
        self._topic = bus.advertise(self, FAULTS, "rosbridge_sim_msgs/MockFaults", depth=1, is_exclusive=True)
        bus.provide(self, SET_FAULT, "rosbridge_sim_msgs/SetMockFault", self._set, is_exclusive=True)

    def show(self, now: float) -> None:
        """Publish the faults, if they have changed."""
        shown = self._list(now)
        if shown != self._shown or not self._topic.kept:
            self._shown = shown
            store = self._bus.store
            header = store.message("std_msgs/Header").struct_type(stamp=store.time_value(self._bus.stamp_ns))
            message_type = store.message("rosbridge_sim_msgs/MockFaults")
            message = Message(message_type, message_type.struct_type(header=header, faults=shown))
            self._bus.announce(self, self._topic, message, now)

    def _set(self, call: Call, now: float) -> None:
        request: Any = call.request
        message = ""
        try:
            if request.name or request.rule:
                self.set(request.name, request.rule, is_active=request.active, now=now)
        except DocumentError as error:
            message = str(error)
        call.respond(success=not message, message=message, faults=self._list(now))
        self.show(now)

    def _list(self, now: float) -> list[Any]:
        make = self._bus.store.message("rosbridge_sim_msgs/MockFault").struct_type
        now_ns = self._node.now_ns(now)
        return [make(**_fields_of(rule, now_ns)) for rule in self.faults.rules.values()]

    def set(self, name: str, rule: str, *, is_active: bool, now: float) -> None:
        """Switch a fault, or add one.

        Args:
            rule: of a new fault, as in a mock's file; empty for one that is there.

        Raises:
            DocumentError: there is no such fault, or the rule has a mistake.
        """
        rules, now_ns = self.faults.rules, self._node.now_ns(now)
        if rule:
            document = read_yaml(rule, "rule")
            checked = check_values(FAULT, document.value, document.where)
            fault, mistakes = checked
            if fault is None:
                raise DocumentError("; ".join(mistake.text for mistake in mistakes[:3]))
            if not is_plain_name(name):
                raise DocumentError("name: expected a name such as slow_scan: letters, digits, _ and -")
            if name not in rules and len(rules) >= MAX_FAULTS:
                raise DocumentError(f"expected at most {MAX_FAULTS} faults; give this one the name of another")
            self.faults.add(name, fault, now_ns)
        elif name not in rules:
            there = f"; there are {listing(rules)}" if rules else "; there is none, so give a rule"
            raise DocumentError(f"no fault {name!r:.80}{hint(name, rules)}{there}")
        rules[name].switch(is_on=is_active, now_ns=now_ns)
        self._bus.agenda.is_touched = True


def _fields_of(rule: FaultRule, now_ns: int) -> dict[str, Any]:
    fault = rule.fault
    return {
        "name": rule.name,
        "kind": fault.kind,
        "direction": fault.direction,
        "active": rule.holds(now_ns),
        "patterns": [*fault.topics, *fault.services],
        "clients": [str(one) for one in fault.clients],
        "count": rule.count,
    }
