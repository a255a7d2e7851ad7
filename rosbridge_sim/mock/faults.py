"""Faults of the wire: which ones hold for a message or a call, by rule, time and chance. Chance comes from a seed."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any, Final

import numpy as np
import orjson

from rosbridge_sim.mock.mock_model import FAULT_KINDS, FaultWay, MockFault
from rosbridge_sim.mock.value_patterns import SECOND_NS
from rosbridge_sim.records import Record
from rosbridge_sim.schema.definitions.message_spec import MessageSpec
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType

CONTROL: Final = "/mock/"
"""Prefix of the topics and services that switch faults; no fault touches them."""

_ROSAPI: Final = "/rosapi/"
"""Prefix of services that only patterns reach: without rosapi most pages do not even begin."""

MAX_FAULTS: Final = 200
"""Most faults of a mock, with those that commands have added."""


class FaultEffect(Record):
    """The effect of the faults on a message or a call.

    Attributes:
        delay: of the message, or of the call on its way to the service [s].
        answer_delay: of the answer of a call [s].
        num_copies: times that it is delivered; 0 if it is dropped.
        is_frozen: the last message before is delivered in its place.
        change: `nan` or `wrong_type`; empty for none.
        fail: text with which a publish or a call is refused; None if it is not.
    """

    delay: float = 0.0
    answer_delay: float = 0.0
    num_copies: int = 1
    is_frozen: bool = False
    change: str = ""
    fail: str | None = None

    def joined(self, other: FaultEffect) -> FaultEffect:
        """Return the effect of both."""
        num_copies = self.num_copies and other.num_copies and self.num_copies + other.num_copies - 1
        return FaultEffect(
            delay=self.delay + other.delay,
            answer_delay=self.answer_delay + other.answer_delay,
            num_copies=num_copies,
            is_frozen=self.is_frozen or other.is_frozen,
            change=self.change or other.change,
            fail=other.fail if self.fail is None else self.fail,
        )


NO_EFFECT: Final = FaultEffect()


class FaultyClient(Record):
    """A client, as the patterns of a fault name it.

    Attributes:
        number: in the order of connecting, from 1.
        address: host and port.
    """

    number: int
    address: str


class FaultRule:
    """A fault that can be switched.

    Attributes:
        began_ns: time from which its `start` and `end` count [ns].
        count: messages, calls or connections that it has hit.
    """

    def __init__(self, name: str, fault: MockFault, seed: int, began_ns: int) -> None:
        self.name, self.fault = name, fault
        self.is_on, self.began_ns = fault.on, began_ns
        self.count = 0
        self._random = np.random.default_rng((seed, zlib.crc32(name.encode())))
        self._next_close_ns = self._close_after(began_ns - 1)

    def switch(self, *, is_on: bool, now_ns: int) -> None:
        """Switch it; its times count from now."""
        self.is_on, self.began_ns = is_on, now_ns
        self._next_close_ns = self._close_after(now_ns - 1)

    def holds(self, now_ns: int) -> bool:
        """Return whether it is on at a time."""
        passed = (now_ns - self.began_ns) / SECOND_NS
        return self.is_on and passed >= self.fault.start and (self.fault.end is None or passed < self.fault.end)

    def hits(self, now_ns: int) -> bool:
        """Return whether it hits the next message or call."""
        fault = self.fault
        is_hit = self.holds(now_ns) and (fault.probability == 1.0 or self._random.random() < fault.probability)
        self.count += is_hit
        return is_hit

    def delay(self) -> float:
        """Return the next delay [s]."""
        jitter = self.fault.jitter
        return max(0.0, self.fault.seconds + (jitter * self._random.uniform(-1.0, 1.0) if jitter else 0.0))

    def matches(self, name: str, way: FaultWay) -> bool:
        """Return whether it concerns a topic or a service. Patterns of one of both exclude all of the other."""
        fault = self.fault
        if fault.kind not in FAULT_KINDS[fault.direction].get(way, ()) or name.startswith(CONTROL):
            return False
        patterns, others = (fault.services, fault.topics) if way == "call" else (fault.topics, fault.services)
        if patterns:
            return any(fnmatchcase(name, one) for one in patterns)
        return not others and not name.startswith(_ROSAPI)

    def concerns(self, client: FaultyClient) -> bool:
        """Return whether it concerns a client."""
        clients, address = self.fault.clients, client.address
        return not clients or any(
            one == client.number
            if isinstance(one, int)
            else fnmatchcase(address, one) or fnmatchcase(address.rpartition(":")[0], one)
            for one in clients
        )

    # Closing

    def next_close(self) -> float:
        """Return when it closes connections next [ns]; infinity if it does not."""
        return self._next_close_ns if self.is_on and self.fault.kind == "close" else math.inf

    def close(self, now_ns: int) -> bool:
        """Return whether it closes connections now; the next time is that after now."""
        if now_ns < self.next_close():
            return False
        self._next_close_ns = self._close_after(now_ns)
        return self.fault.probability == 1.0 or self._random.random() < self.fault.probability

    def _close_after(self, now_ns: int) -> float:
        fault = self.fault
        first_ns = self.began_ns + round(fault.start * SECOND_NS)
        if now_ns < first_ns:
            return first_ns
        if fault.every is None:
            return math.inf
        every_ns = round(fault.every * SECOND_NS)
        due_ns = first_ns + ((now_ns - first_ns) // every_ns + 1) * every_ns
        is_over = fault.end is not None and due_ns >= self.began_ns + fault.end * SECOND_NS
        return math.inf if is_over else due_ns


class FaultTable:
    """All faults of a mock.

    Attributes:
        rules: by name, in the order in which they are applied.
    """

    def __init__(self, faults: Mapping[str, MockFault], seed: int) -> None:
        self.rules: dict[str, FaultRule] = {}
        self._seed = seed
        self._found: dict[tuple[str, FaultWay], Sequence[FaultRule]] = {}
        for name, fault in faults.items():
            self.add(name, fault, 0)

    def add(self, name: str, fault: MockFault, now_ns: int) -> None:
        """Add a fault, or put it in place of one with the same name."""
        self.rules[name] = FaultRule(name, fault, self._seed, now_ns)
        self._found.clear()

    def judge(self, name: str, now_ns: int, way: FaultWay, client: FaultyClient | None = None) -> FaultEffect | None:
        """Return what happens to the next message of a topic, or the next call of a service; None if nothing does.

        Args:
            name: of the topic or service.
            client: judge by the faults that concern some clients, this one among them; None judges by those of all.
        """
        if not self.rules:
            return None
        rules = self._found.get((name, way))
        if rules is None:
            rules = self._found[name, way] = [rule for rule in self.rules.values() if rule.matches(name, way)]
        hits = [
            rule
            for rule in rules
            if (not rule.fault.clients if client is None else rule.fault.clients and rule.concerns(client))
            and rule.hits(now_ns)
        ]
        if not hits:
            return None
        kinds = [rule.fault.kind for rule in hits]
        return FaultEffect(
            delay=sum(rule.delay() for rule in hits if rule.fault.kind == "delay"),
            answer_delay=sum(rule.delay() for rule in hits if rule.fault.kind == "slow"),
            num_copies=0 if "drop" in kinds else 1 + kinds.count("duplicate"),
            is_frozen="freeze" in kinds,
            change=next((kind for kind in kinds if kind in {"nan", "wrong_type"}), ""),
            fail=next((rule.fault.text for rule in hits if rule.fault.kind == "fail"), None),
        )

    def next_close(self) -> float:
        """Return when connections are closed next [ns]; infinity if never."""
        return min((rule.next_close() for rule in self.rules.values()), default=math.inf)


# Changed messages


def changed(message: Message, change: str) -> Message:
    """Return a message with NaN in place of its floating-point numbers, or with values of the wrong type.

    Args:
        change: `nan` or `wrong_type`.
    """
    if change == "nan":
        if isinstance(message.type, MessageType) and message.type.spec.has_floats:
            return Message(message.type, _with_nan(message.type.spec, message.value))
        return message
    values = _mistyped(orjson.loads(message.json))
    return Message(OpaqueType(message.type.name), values if isinstance(values, dict) else {})


def _with_nan(spec: MessageSpec, value: Any) -> Any:  # noqa: ANN401 - a struct
    changes: dict[str, Any] = {}
    for field in spec.fields.values():
        if not field.has_floats:
            continue
        given = getattr(value, field.attribute)
        if field.definition.array is None:
            changes[field.attribute] = math.nan if field.nested is None else _with_nan(field.nested, given)
        elif field.nested is None:
            changes[field.attribute] = [math.nan] * len(given)
        else:
            changes[field.attribute] = [_with_nan(field.nested, each) for each in given]
    copy = value.__copy__()
    for attribute, change in changes.items():
        setattr(copy, attribute, change)
    return copy


def _mistyped(value: Any) -> Any:  # noqa: ANN401 - of JSON
    """Return a value whose numbers are texts and whose texts are numbers."""
    if isinstance(value, dict):
        return {key: _mistyped(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_mistyped(each) for each in value]
    if isinstance(value, str):
        return len(value)
    return str(value) if isinstance(value, int | float) else value
