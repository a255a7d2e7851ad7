"""A check played with a server, and the verdict.

Servers may word errors as they like, number calls as they like, and write types and times as their ROS does. All else
of a frame must be as the check says.
"""

from __future__ import annotations

import json
import re
from collections import deque
from collections.abc import Sequence
from enum import StrEnum
from typing import Final, Protocol

from rosbridge_sim.doctor.check import Check, moves, plain_types
from rosbridge_sim.doctor.check_frames import agrees, write_frame
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.records import Record

_SETTING_UP: Final = frozenset(
    {
        *("advertise", "unadvertise", "subscribe", "unsubscribe", "advertise_service", "unadvertise_service"),
        *("advertise_action", "unadvertise_action", "set_level"),
    }
)
"""Ops without an answer that must have worked before the next step."""

_ASKED: Final = frozenset({"call_service", "send_action_goal", "cancel_action_goal"})
"""Ops of the server whose ids it may choose."""

SILENT: Final = "rosbridge_suite, which sends no status"
WITHOUT_ACTIONS: Final = "rosbridge_suite 0.11.17 (ROS 1), which has no ops for actions"


class Verdict(StrEnum):
    """The result of a check."""

    CONFORMS = "conforms"
    DIFFERS = "differs"
    DEVIATES = "deviates"
    MISSING = "missing"
    NOT_APPLICABLE = "not applicable"

    @property
    def is_fault(self) -> bool:
        """True if the protocol, or what both reference servers do, is broken."""
        return self in {Verdict.DEVIATES, Verdict.MISSING}


class Difference(Record):
    """A frame that is not as a check says.

    Attributes:
        client: name of the client in the check.
        expected: the frame that should have come; None if none should.
        got: the frame that came; None if none came.
        known: the reference that sends the same; empty if none does.
    """

    client: str
    expected: JsonValue
    got: JsonValue
    known: str = ""


class CheckResult(Record):
    """A check with its result.

    Attributes:
        check: the check.
        verdict: the verdict.
        reason: why, in words; empty if it conforms.
        sent: the frames that were sent, with the names of their clients.
        came: the frames that came.
    """

    check: Check
    verdict: Verdict
    reason: str = ""
    sent: tuple[tuple[str, JsonValue], ...] = ()
    came: tuple[tuple[str, JsonValue], ...] = ()


class Clients(Protocol):
    """Named clients of one server; each connects when it is first named."""

    async def send(self, name: str, frame: str | bytes) -> None:
        """Send a frame."""

    async def settle(self) -> None:
        """Wait until what was sent has had its effect."""

    async def next(self, name: str, *, is_status: bool) -> JsonValue:
        """Return the next frame of a client that is a status, or that is none; None if none comes in time."""

    async def rest(self, name: str) -> Sequence[JsonValue]:
        """Return all frames that came to a client and were not taken."""

    async def close(self, name: str) -> None:
        """Close a client's connection."""


async def examine(check: Check, clients: Clients, ros: int) -> CheckResult:
    """Play a check, and judge what came.

    Args:
        check: made ready for the server, see `prepared`.
        clients: connections to the server.
        ros: 1 or 2; 0 if it is not known.
    """
    play = _Play(check, clients)
    await play.run()
    knows_actions = any("action" in str(_op(frame)) for _, frame in play.came)
    verdict, reason = _judge(check, play.differences, has_actions=knows_actions or ros != 1)
    return CheckResult(check, verdict, reason, tuple(play.sent), tuple(play.came))


class _Play:
    """One play of a check.

    Attributes:
        sent, came: frames with the names of their clients.
        differences: what was not as the check says.
    """

    def __init__(self, check: Check, clients: Clients) -> None:
        self._steps = deque(moves(check))
        self._judged = {name for name, _, _ in self._steps}
        self._clients = clients
        self._ids: dict[str, str] = {}
        self._last = ""
        self._is_settled = True
        self.sent: list[tuple[str, JsonValue]] = []
        self.came: list[tuple[str, JsonValue]] = []
        self.differences: list[Difference] = []

    async def run(self) -> None:
        """Play the steps; behind a frame that is missing, or is another one, the rest is not played."""
        while self._steps:
            name, action, frame = self._steps.popleft()
            if action == ">":
                await self._send(name, frame)
            elif action == "-":
                await self._clients.close(name)
                self._is_settled = False
            elif action == "?":
                self._judged.discard(name)
            elif not await self._expect(name, frame):
                return
        await self._clients.settle()
        for name in sorted(self._judged):
            for frame in await self._clients.rest(name):
                self.came.append((name, frame))
                self.differences.append(Difference(name, None, frame))

    async def _send(self, name: str, frame: JsonValue) -> None:
        op = frame.get("op") if isinstance(frame, dict) else None
        if not self._is_settled and (name != self._last or op not in _SETTING_UP):
            await self._clients.settle()
        self._last, self._is_settled = name, op in _ASKED
        if isinstance(frame, dict) and isinstance(frame.get("id"), str):
            frame = frame | {"id": self._ids.get(frame["id"], frame["id"])}
        self.sent.append((name, frame))
        await self._clients.send(name, write_frame(frame))

    async def _expect(self, name: str, expected: JsonValue) -> bool:
        """Take the next frame of a client; return False if it is another one than expected, or none came."""
        got = await self._take(name, is_status=_is_status(expected))
        if _op(got) == "fragment":
            expected = self._joined(name, expected) if _op(expected) == "fragment" else expected
            got = await self._join(name, got)
        if _op(expected) in _ASKED and isinstance(got, dict) and isinstance(got.get("id"), str):
            self._ids[expected["id"]] = got["id"]
            expected = expected | {"id": got["id"]}
        options = expected["$either"] if isinstance(expected, dict) and "$either" in expected else [expected]
        if agrees(_lenient(options[0]), _plain(got)):
            return True
        for who, frame in options[1:]:
            if agrees(_lenient(frame), _plain(got)):
                self.differences.append(Difference(name, frame, got, who))
                return True
        self.differences.append(Difference(name, options[0], got))
        return got is None and _is_status(expected)

    async def _take(self, name: str, *, is_status: bool) -> JsonValue:
        got = await self._clients.next(name, is_status=is_status)
        if got is not None:
            self.came.append((name, got))
        return got

    def _joined(self, name: str, first: JsonValue) -> JsonValue:
        """Return the frame whose pieces come next in the check."""
        pieces = [first["data"]]
        for step in list(self._steps)[: first["total"] - 1]:
            if step[0] != name:
                break
            self._steps.popleft()
            pieces.append(step[2]["data"])
        return json.loads("".join(pieces))

    async def _join(self, name: str, first: JsonValue) -> JsonValue:
        """Return the frame whose pieces come from the server; a list of the pieces if they do not fit."""
        pieces = [first]
        total = first.get("total")
        while isinstance(total, (int, float)) and len(pieces) < min(int(total), _MAX_PIECES):
            piece = await self._take(name, is_status=False)
            if _op(piece) != "fragment":
                return pieces
            pieces.append(piece)
        try:
            return json.loads("".join(str(piece["data"]) for piece in sorted(pieces, key=lambda piece: piece["num"])))
        except (ValueError, KeyError, TypeError):
            return pieces


_MAX_PIECES: Final = 1000


def _op(frame: JsonValue) -> JsonValue:
    return frame.get("op") if isinstance(frame, dict) else None


def _is_status(frame: JsonValue) -> bool:
    return bool(_op(frame) == "status")


def _lenient(expected: JsonValue) -> JsonValue:
    """Return an expected frame without what a server may choose."""
    expected = _plain(expected)
    if _is_status(expected):
        return expected | {"msg": {"$any": "text"}}
    if isinstance(expected, dict) and expected.get("result") is False and isinstance(expected.get("values"), str):
        return expected | {"values": {"$any": "text"}}
    return expected


def _plain(value: JsonValue) -> JsonValue:
    """Return a value with types and times as ROS 1 writes them, and without the `seq` of headers."""
    if isinstance(value, dict):
        if value.keys() == {"$now"}:
            return {"$any": "number"}
        names = {"sec": "secs", "nanosec": "nsecs"} if value.keys() == {"sec", "nanosec"} else {}
        return {
            names.get(key, key): _plain(inner)
            for key, inner in value.items()
            if key != "seq" or "frame_id" not in value
        }
    if isinstance(value, list):
        return [_plain(inner) for inner in value]
    return plain_types(value) if isinstance(value, str) else value


def _judge(check: Check, differences: Sequence[Difference], *, has_actions: bool) -> tuple[Verdict, str]:
    """Return the verdict and the reason."""
    if not differences:
        return Verdict.CONFORMS, ""
    first = next((one for one in differences if not _reference_of(one)), None)
    if first is None:
        return Verdict.DIFFERS, f"as {_reference_of(differences[0])}"
    if check.section == "actions" and not has_actions and first.got is None:
        return Verdict.DIFFERS, f"as {WITHOUT_ACTIONS}"
    text = _words(first)
    if not _PRESCRIBED.match(check.source):
        return Verdict.DIFFERS, f"{text} (nothing prescribes it: {check.source})"
    return (Verdict.MISSING if first.got is None else Verdict.DEVIATES), text


def _reference_of(difference: Difference) -> str:
    """Return the reference that does the same; empty if none does."""
    return difference.known or (SILENT if _is_status(difference.expected) and difference.got is None else "")


_PRESCRIBED: Final = re.compile(r"protocol text|rosbridge_suite (0\.11\.17|2\.1\.0)|rosapi|actionlib|action_msgs")
"""Sources that all servers should follow: the specification, and releases that most users have."""

_MAX_SHOWN: Final = 300
"""Longest frame in a reason [characters]."""


def _words(difference: Difference) -> str:
    """Return a difference in words."""
    wanted, got = (shown(frame) for frame in (difference.expected, difference.got))
    if difference.expected is None:
        return f"client {difference.client} also got {got}"
    if difference.got is None:
        return f"client {difference.client} got nothing; expected {wanted}"
    return f"client {difference.client} got {got}; expected {wanted}"


def shown(frame: JsonValue) -> str:
    """Return a frame for people; a long one is cut."""
    text = json.dumps(frame, ensure_ascii=False)
    return text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]}... ({len(text):,} characters)"
