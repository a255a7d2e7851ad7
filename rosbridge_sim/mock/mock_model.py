"""The file of a mock, key by key: topics, services, actions, parameters, transforms, recordings, faults.

`schemas/mock.schema.json` is generated from this module. Values of messages are kept as they are written here;
`mock_plan.py` compiles them, because their fields are those of message types.
"""

# ruff: noqa: RUF012 - each object gets its own copy of an empty default

from __future__ import annotations

import re
from typing import Annotated, Any, Final, Literal

from msgspec import Meta

from rosbridge_sim.documents.document_model import DocumentType, KeptAsWritten, Table, about

MAX_THINGS: Final = 2_000
"""Most topics, services, actions, parameters and transforms each."""

MAX_TOPIC_RATE: Final = 1_000.0
"""Greatest rate of a topic [Hz]."""

MAX_SECONDS: Final = 86_400.0
"""Longest time in a mock's file [s]."""

_NAME: Final = re.compile(r"/?[A-Za-z_][\w/]{0,254}")
_PLAIN_NAME: Final = re.compile(r"[\w-]{1,60}")


def _check_name(value: str) -> None:
    if not _NAME.fullmatch(value):
        raise ValueError("expected a name such as /odom: letters, digits, _ and /")


def is_plain_name(value: str) -> bool:
    """Return whether a text can be the name of a fault."""
    return _PLAIN_NAME.fullmatch(value) is not None


def _check_plain_name(value: str) -> None:
    if not is_plain_name(value):
        raise ValueError("expected a name such as slow_scan: letters, digits, _ and -")


def _check_path(value: str) -> None:
    if not value or value.startswith(("/", "\\")) or ":" in value or ".." in re.split(r"[/\\]", value):
        raise ValueError("expected a file in the folder of the mock's file, or below it")


_Name = Annotated[str, Meta(extra={"check": _check_name})]
_PlainName = Annotated[str, Meta(extra={"check": _check_plain_name})]
_TypeName = Annotated[str, about("type, such as `nav_msgs/Odometry`", max_length=256)]
_Pattern = Annotated[str, Meta(max_length=256)]
_Text = Annotated[str, Meta(max_length=500)]
_Rate = Annotated[float, Meta(gt=0.0, le=MAX_TOPIC_RATE)]
_Seconds = Annotated[float, Meta(ge=0.0, le=MAX_SECONDS)]
_Duration = Annotated[float, Meta(ge=0.001, le=MAX_SECONDS)]
_Number = Annotated[float, Meta(ge=-1e15, le=1e15)]

MockPath = Annotated[str, Meta(max_length=500, extra={"check": _check_path})]
"""A file in the folder of the mock's file, or below it: a file of a stranger cannot publish other files."""


class SinePattern(Table, frozen=True, kw_only=True):
    """`offset + amplitude * sin(2 pi time / period + phase)`."""

    amplitude: _Number = 1.0
    period: Annotated[_Duration, about("[s]")] = 1.0
    offset: _Number = 0.0
    phase: Annotated[_Number, about("[rad]")] = 0.0


class RampPattern(Table, frozen=True, kw_only=True):
    """From `start` to `end` in `seconds`, then again from `start`, or staying at `end`."""

    start: _Number = 0.0
    end: _Number = 1.0
    seconds: Annotated[_Duration, about("[s]")] = 1.0
    repeat: bool = True


class WalkPattern(Table, frozen=True, kw_only=True):
    """From `start`, with a step of normal distribution for each message; the bounds reflect it."""

    start: _Number = 0.0
    step: Annotated[float, about("standard deviation of a step", gt=0.0, le=1e9)] = 1.0
    low: _Number | None = None
    high: _Number | None = None

    def __post_init__(self) -> None:
        """Check that the bounds fit."""
        if (self.low is None) != (self.high is None):
            raise ValueError("expected low and high, or neither")
        if self.low is not None and self.high is not None and not self.low <= self.start <= self.high > self.low:
            raise ValueError("expected low <= start <= high, and low < high")


class CounterPattern(Table, frozen=True, kw_only=True):
    """`start`, and `step` more with each message; behind `end` again from `start`."""

    start: Annotated[int, Meta(ge=-(2**53), le=2**53)] = 0
    step: Annotated[int, Meta(ge=-(2**31), le=2**31)] = 1
    end: Annotated[int | None, Meta(ge=-(2**53), le=2**53)] = None

    def __post_init__(self) -> None:
        """Check that the end can be reached."""
        if self.end is not None and (not self.step or (self.end - self.start) * self.step < 0):
            raise ValueError("expected an end that the steps reach from start")


class CsvPattern(Table, frozen=True, kw_only=True):
    """The values of a column of a CSV file, a row for each message, and again from the first one."""

    file: MockPath
    column: Annotated[_Text, about("its name in the first line")]


PatternName = Literal["$sine", "$ramp", "$random_walk", "$counter", "$list", "$file", "$csv", "$expression"]

PATTERN_OPTIONS: Final[dict[str, DocumentType[Any]]] = {
    "$sine": DocumentType(SinePattern),
    "$ramp": DocumentType(RampPattern),
    "$random_walk": DocumentType(WalkPattern),
    "$counter": DocumentType(CounterPattern),
    "$list": DocumentType(Annotated[list[Any], Meta(min_length=1, max_length=100_000)]),
    "$file": DocumentType(MockPath),
    "$csv": DocumentType(CsvPattern),
    "$expression": DocumentType(_Text),
}
"""Key of a pattern -> form of what stands behind it."""


class MockTopic(Table, frozen=True, kw_only=True):
    """A topic that the mock publishes."""

    type: _TypeName
    rate: Annotated[_Rate | None, about("[Hz]; none: one message, latched")] = None
    value: Annotated[
        KeptAsWritten, about("fields of the message: constants and patterns; others have their defaults")
    ] = None
    latch: Annotated[bool, about("late subscribers get the last message")] = False


class MockAnswer(Table, frozen=True, kw_only=True):
    """An answer of a service. The first one whose `when` fits the request is given."""

    when: Annotated[
        KeptAsWritten, about("fields that the request must have, or an expression over its fields; none: always")
    ] = None
    value: Annotated[KeptAsWritten, about("fields of the response, as of a topic")] = None
    delay: Annotated[_Seconds, about("[s]")] = 0.0
    fail: Annotated[_Text | None, about("fail with this text; there is no value then")] = None


class MockService(Table, frozen=True, kw_only=True):
    """A service that the mock offers."""

    type: _TypeName
    answers: Annotated[list[MockAnswer], about("none: a response of defaults, at once", max_length=100)] = []


class MockGoal(Table, frozen=True, kw_only=True):
    """The course of a goal. The first one whose `when` fits the goal is taken."""

    when: Annotated[KeptAsWritten, about("as of an answer of a service")] = None
    duration: Annotated[_Seconds, about("until the result [s]")] = 1.0
    feedback: Annotated[KeptAsWritten, about("fields of the feedback; none: no feedback")] = None
    feedback_rate: Annotated[_Rate, about("[Hz]")] = 1.0
    outcome: Annotated[Literal["succeeded", "aborted", "canceled", "rejected"], about("end of the goal")] = "succeeded"
    result: Annotated[KeptAsWritten, about("fields of the result")] = None


class MockAction(Table, frozen=True, kw_only=True):
    """An action that the mock offers. A goal that is cancelled ends as canceled."""

    type: _TypeName
    goals: Annotated[
        list[MockGoal], about("none: success after a second, with a result of defaults", max_length=100)
    ] = []


class MockTransform(Table, frozen=True, kw_only=True):
    """A transform of a tree of frames. Each number may be a pattern."""

    parent: _Text
    child: _Text
    rate: Annotated[_Rate | None, about("on /tf [Hz]; none: on /tf_static")] = None
    x: Annotated[KeptAsWritten, about("[m]")] = 0.0
    y: Annotated[KeptAsWritten, about("[m]")] = 0.0
    z: Annotated[KeptAsWritten, about("[m]")] = 0.0
    roll: Annotated[KeptAsWritten, about("[rad]")] = 0.0
    pitch: Annotated[KeptAsWritten, about("[rad]")] = 0.0
    yaw: Annotated[KeptAsWritten, about("[rad]")] = 0.0


class MockRecording(Table, frozen=True, kw_only=True):
    """A bag or MCAP file that is played in a loop, with new stamps. Topics of `topics` take precedence."""

    file: MockPath
    topics: Annotated[list[_Pattern], about("patterns such as `/camera/*`; none: all", max_length=100)] = []
    speed: Annotated[float, about("factor", ge=0.01, le=100.0)] = 1.0


FaultKind = Literal["delay", "drop", "duplicate", "freeze", "wrong_type", "nan", "slow", "fail", "close"]
FaultDirection = Literal["to_clients", "from_clients"]

FaultWay = Literal["message", "publish", "call"]
"""A message on its way to a client, a message that a client publishes, and a call by a client."""

FAULT_KINDS: Final[dict[FaultDirection, dict[FaultWay, tuple[FaultKind, ...]]]] = {
    "to_clients": {"message": ("delay", "drop", "duplicate", "freeze", "wrong_type", "nan"), "call": ("slow", "fail")},
    "from_clients": {"publish": ("delay", "drop", "duplicate", "freeze", "fail"), "call": ("delay", "drop", "fail")},
}
"""The kinds of faults of each way; `close` has none."""

MAX_CLIENT_NUMBER: Final = 1_000_000


class MockFault(Table, frozen=True, kw_only=True):
    """A fault of the wire between clients and the mock."""

    kind: Annotated[FaultKind, about("see the table of kinds")]
    direction: Annotated[FaultDirection, about("of the messages and calls that it concerns")] = "to_clients"
    topics: Annotated[list[_Pattern], about("patterns of topics; none: all", max_length=100)] = []
    services: Annotated[list[_Pattern], about("patterns of services; none: all", max_length=100)] = []
    clients: Annotated[
        list[Annotated[int, Meta(ge=1, le=MAX_CLIENT_NUMBER)] | _Pattern],
        about("numbers in the order of connecting, from 1, and patterns of addresses; none: all", max_length=100),
    ] = []
    probability: Annotated[float, about("for each message or call", ge=0.0, le=1.0)] = 1.0
    seconds: Annotated[Annotated[float, Meta(ge=0.0, le=600.0)], about("delay of `delay` and `slow` [s]")] = 0.5
    jitter: Annotated[
        Annotated[float, Meta(ge=0.0, le=600.0)], about("delays are even within `seconds` +- `jitter` [s]")
    ] = 0.0
    text: Annotated[_Text, about("of `fail`, and the reason of `close`")] = "a fault of the mock"
    code: Annotated[int, about("of `close`; 1006 cuts the connection without a close frame", ge=1000, le=4999)] = 1011
    every: Annotated[_Duration | None, about("time between two `close` [s]; none: once")] = None
    start: Annotated[_Seconds, about("time after the start of the mock [s]")] = 0.0
    end: Annotated[_Seconds | None, about("the same; none: for ever")] = None
    on: Annotated[bool, about("false: off until it is switched on")] = True

    def __post_init__(self) -> None:
        """Check that the kind, the direction and the patterns fit, and the times."""
        ways = [way for way, kinds in FAULT_KINDS[self.direction].items() if self.kind in kinds]
        if not ways and (self.kind != "close" or self.direction == "from_clients"):
            known = dict.fromkeys(kind for kinds in FAULT_KINDS[self.direction].values() for kind in kinds)
            raise ValueError(f"expected kind {', '.join(known)} with direction {self.direction}")
        if self.services and "call" not in ways:
            raise ValueError(f"expected topics: {self.kind} {self.direction} concerns no services")
        if self.topics and ways in ([], ["call"]):
            raise ValueError(f"expected services: {self.kind} {self.direction} concerns no topics")
        if self.end is not None and self.end <= self.start:
            raise ValueError("expected start < end")
        if self.code in {1004, 1005} or MAX_CODE < self.code < MIN_OWN_CODE:
            raise ValueError("expected a code that a close frame may have: 1000 to 1014, or 3000 to 4999")


MAX_CODE: Final = 1_014
"""Greatest close code of the protocol itself that a frame may have."""

MIN_OWN_CODE: Final = 3_000
"""Least close code of applications."""


class MockDocument(Table, frozen=True, kw_only=True):
    """A mock of a robot."""

    node: Annotated[_Name, about("name of its node")] = "/mock"
    seed: Annotated[int, about("of random walks and faults", ge=0, le=2**32 - 1)] = 0
    topics: Annotated[dict[_Name, MockTopic], about("that it publishes, by name", max_length=MAX_THINGS)] = {}
    subscribers: Annotated[
        dict[_Name, _TypeName],
        about("topics that it subscribes to -> type; expressions may read them", max_length=MAX_THINGS),
    ] = {}
    services: Annotated[dict[_Name, MockService], about("by name", max_length=MAX_THINGS)] = {}
    actions: Annotated[dict[_Name, MockAction], about("by name", max_length=MAX_THINGS)] = {}
    parameters: Annotated[dict[str, KeptAsWritten], about("by name: any values of JSON", max_length=MAX_THINGS)] = {}
    transforms: Annotated[list[MockTransform], about("trees of /tf", max_length=MAX_THINGS)] = []
    recordings: Annotated[list[MockRecording], about("files to play", max_length=20)] = []
    faults: Annotated[dict[_PlainName, MockFault], about("by name", max_length=100)] = {}


MOCK: Final = DocumentType[MockDocument](MockDocument)

FAULT: Final = DocumentType[MockFault](MockFault)
"""A fault that is written by itself."""
