"""Diagnostics of a remote bridge for the log: what it lacks, what it reports, what it does wrong.

rosbridge_suite does not answer mistakes. Its rosapi lists show if it knows our types: we read them a while after
everything was announced, and an item that is missing there was refused. A server that answers mistakes, such as ours,
reports the same in its own words. Either way the log gets one line, once.
Lines about repeated events are limited in number, whatever the bridge sends.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Sequence
from typing import Final, Literal

from rosbridge_sim.graph.attach.connection import Values
from rosbridge_sim.protocol.ops import Status
from rosbridge_sim.suggestions import name_some

MAX_LINES, PERIOD = 10, 10.0
"""At most so many lines about the remote bridge's messages in so many seconds."""

MAX_DIAGNOSTIC: Final = 500
"""Longest line [characters]."""

MAX_DIAGNOSTICS: Final = 100
"""Largest number of lines that are logged once: more than there are packages, unless the bridge invents names."""

MAX_REASON: Final = 2_000
"""Characters of an error text that are searched; it may quote a message of any length after that."""

_UNKNOWN = re.compile(r"Unable to import ([\w-]+)\.\w+ from package")
"""Error text of a server for a package that it does not know."""

_OWNED = re.compile(r"(?:Topic|Service) \S+ is (?:published|provided) by (\S+) alone")
"""Error text of a rosbridge_sim server with its own simulator."""

_NUMBER = re.compile(r"(?<![\w/.])-?\d[\w.+-]*")
"""A number in an error text, but none in a name such as `/Ego_topic_1`: messages of one kind differ in these."""

_NO_NULL = re.compile(r"\bNoneType\b")
"""Word in the error text of a Python program that needs a value and gets `null`."""

_log = logging.getLogger("rosbridge_sim.attach")

ItemKey = tuple[str, str, str]
"""Kind (`topic`, `input` or `service`), name, and type (in the remote spelling) of one of our items."""


class Diagnostics:
    """Findings about one remote bridge.

    Attributes:
        taken_services: services of ours that it had before; empty after they were logged.
        has_lost_topics: topics of ours that it once listed are missing in its last lists.
    """

    def __init__(self, address: str, ros: Literal[1, 2]) -> None:
        """Begin without findings.

        Args:
            address: address of the bridge, for people.
            ros: ROS generation of our messages.
        """
        self.taken_services: list[str] = []
        self.has_lost_topics = False
        self._listed: set[str] = set()
        self._address = address
        self._ros = ros
        self._logged: set[str] = set()
        self._statuses: set[str] = set()  # status messages that were logged, without their numbers
        self._num_lines = self._num_suppressed = 0
        self._lines_until = 0.0

    # Lines

    def log(self, level: int, text: str) -> None:
        """Log a line about the bridge, shortened if it is too long.

        Args:
            level: level of `logging`.
        """
        _log.log(
            level, "%s: %s", self._address, text if len(text) <= MAX_DIAGNOSTIC else text[: MAX_DIAGNOSTIC - 3] + "..."
        )

    def log_once(self, text: str) -> None:
        """Log a warning once. It stays true until a user changes something there."""
        if text not in self._logged and len(self._logged) < MAX_DIAGNOSTICS:
            self._logged.add(text)
            self.log(logging.WARNING, text)

    def log_limited(self, level: int, text: str, now: float) -> bool:
        """Log a line about an event that may repeat; too many lines in a short time are only counted.

        Args:
            level: level of `logging`.

        Returns:
            True if it was logged.
        """
        if now >= self._lines_until:
            if self._num_suppressed:
                self.log(logging.WARNING, f"and {self._num_suppressed} more lines, which are left out")
            self._lines_until = now + PERIOD
            self._num_lines = self._num_suppressed = 0
        if self._num_lines < MAX_LINES:
            self._num_lines += 1
            self.log(level, text)
            return True
        self._num_suppressed += 1
        return False

    # Findings

    def note_status(self, op: Status, ours: Collection[ItemKey], now: float) -> str:
        """Log a status message of the bridge; one that differs only in its numbers from an earlier one is left out.

        Returns:
            The package that it does not know; empty if it says something else.
        """
        text = op.msg or ""
        unknown, owned = _UNKNOWN.match(text), _OWNED.match(text)
        if unknown is not None and any(_package(key) == unknown[1] for key in ours):
            self._report_missing_package(unknown[1], ours)
            return unknown[1]
        if owned is not None:
            self.taken_services.clear()
            self.log_once(
                f"it runs its own simulator ({owned[1]}), which owns these names, so ours is not visible there;"
                " attach to a bridge without a world (start it with --no-world)"
            )
        else:
            about = f" of {op.id}" if op.id else ""
            line = f"it says{about}: [{op.level}] {text}"
            kind = _NUMBER.sub("#", line[:MAX_DIAGNOSTIC])
            is_new = kind not in self._statuses
            if is_new and self.log_limited(logging.WARNING, line, now) and len(self._statuses) < MAX_DIAGNOSTICS:
                self._statuses.add(kind)
        return ""

    def report_words(self) -> None:
        """Log that the bridge refuses null for a number."""
        self.log(logging.INFO, "it refuses null: NaN and infinity are sent to it as the words NaN and Infinity")

    def report_no_rosapi(self, seconds: float, *, is_refused: bool) -> None:
        """Log that rosapi there does not answer, though it had time to start.

        Args:
            seconds: time since the first question [s].
            is_refused: the bridge has refused calls, so rosapi is not there; otherwise there was no word at all.
        """
        said = "rosapi does not answer there" if is_refused else f"rosapi there has not answered for {seconds:.0f} s"
        self.log_once(f"{said}, so its delay and the items that it lacks cannot be seen")

    def check_generation(self, values: Values) -> None:
        """Compare the ROS generation of the bridge with ours, by the spelling of a time that it sent.

        Args:
            values: answer of `/rosapi/get_time`.
        """
        time = values.get("time")
        ours, theirs = self._ros, 3 - self._ros
        if isinstance(time, dict) and ("sec" in time or "secs" in time) and ("secs" in time) != (ours == 1):
            self.log_once(f"it runs ROS {theirs} and may refuse messages of ROS {ours}: use --ros {theirs}")

    def check_stamps(self, *, is_simulated: bool, is_wall: bool, is_settled: bool) -> None:
        """Compare the clock of the programs there with our stamps.

        Args:
            is_simulated: its `/use_sim_time` is true.
            is_wall: our stamps are the time of day.
            is_settled: its answer has just decided our stamps.
        """
        if is_settled:
            said = "is true" if is_simulated else "is not true"
            self.log(
                logging.INFO, f"its /use_sim_time {said}: stamps are {'the time of day' if is_wall else 'simulated'}"
            )
        elif is_simulated and is_wall:
            self.log_once(
                "its /use_sim_time is true, and our stamps are the time of day: programs there may find no transforms;"
                " --stamps sim makes both simulated"
            )
        elif not is_simulated and not is_wall:
            self.log_once(
                "its /use_sim_time is not true, and our stamps are simulated time: programs there may find no"
                " transforms; --stamps wall gives the time of day, or set the parameter before they start"
            )

    def report_attached(self, ours: Collection[ItemKey]) -> None:
        """Log that everything is announced there."""
        kinds = [kind for kind, _, _ in ours]
        num_topics, num_services, num_inputs = map(kinds.count, ("topic", "service", "input"))
        self.log(
            logging.INFO,
            f"attached: {num_topics} topics and {num_services} services announced, {num_inputs} topics subscribed",
        )
        if self.taken_services:
            names = name_some(self.taken_services)
            self.log_once(f"it already has {names}, from another or an earlier program; ours replace them")
            self.taken_services.clear()

    def compare_lists(self, topics: Values, services: Values, ours: Collection[ItemKey], *, is_final: bool) -> bool:
        """Compare the lists of its rosapi with our items.

        Args:
            topics: the values of `/rosapi/topics`.
            services: the values of `/rosapi/services`.
            is_final: it had enough time; a missing item will not appear later.

        Returns:
            True if nothing is missing.
        """
        types = types_of(topics)
        there = {("topic", name) for name in types} | {("service", name) for name in names_of(services, "services")}
        announced = [key for key in ours if key[0] != "input"]
        missing = [key for key in announced if key[:2] not in there]
        self.has_lost_topics = any(kind == "topic" and name in self._listed for kind, name, _ in missing)
        self._listed.update(name for kind, name, _ in announced if kind == "topic" and name in types)
        if is_final:
            self._report_missing(missing, announced, ours)
        for kind, name, type_name in announced:
            told = types.get(name)
            if kind == "topic" and told and plain_type(told) != plain_type(type_name):
                self.log_once(f"{name} has type {told} there, not {type_name}: ours was refused")
        return not missing

    def _report_missing(
        self, missing: Sequence[ItemKey], announced: Sequence[ItemKey], ours: Collection[ItemKey]
    ) -> None:
        for package in dict.fromkeys(map(_package, missing)):
            lacking = [key for key in missing if _package(key) == package]
            if len(lacking) == sum(_package(key) == package for key in announced):
                self._report_missing_package(package, ours)
            else:
                names = name_some([f"{name} ({type_name})" for _, name, type_name in lacking])
                self.log_once(
                    f"it does not have {names}: its {package} may be another release, or its globs deny these names"
                )

    def _report_missing_package(self, package: str, ours: Collection[ItemKey]) -> None:
        names = name_some([key[1] for key in ours if _package(key) == package])
        self.log_once(
            f"it does not know the package {package}, so it lacks {names}: build the package on its machine, and"
            " restart it"
        )


def refuses_null(text: str | None) -> bool:
    """Return True if an error text of the bridge is about a `null` that it does not take."""
    return _NO_NULL.search(text or "", 0, MAX_REASON) is not None


def names_of(values: Values | None, key: str) -> list[str]:
    """Return a list of names from an answer; empty if there is none."""
    names = None if values is None else values.get(key)
    return [name for name in names if isinstance(name, str)] if isinstance(names, list) else []


def _package(key: ItemKey) -> str:
    return key[2].partition("/")[0]


def is_list_of_topics(values: Values | None) -> bool:
    """Return True if an answer of `/rosapi/topics` has its list."""
    return values is not None and isinstance(values.get("topics"), list)


def types_of(values: Values | None) -> dict[str, str]:
    """Return the types of all topics in an answer of `/rosapi/topics`, by name."""
    return dict(zip(names_of(values, "topics"), names_of(values, "types"), strict=False))


def plain_type(type_name: str) -> str:
    """Return the name of a message type as ROS 1 spells it.

    Args:
        type_name: the name, as ROS 1 or ROS 2 spells it.
    """
    return type_name.replace("/msg/", "/")
