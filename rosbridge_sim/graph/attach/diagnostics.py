"""Diagnostics of a far side, for the log: what it lacks of ours, what it says, what it does wrong.

rosbridge_suite answers no mistake. Whether it knows our types is seen from the lists that its rosapi gives, a while
after everything was announced: what is missing there was refused. A server that does answer mistakes, as ours does,
says the same in its own words; either way it is one line, said once.

Lines about what comes again and again are bounded in number, whatever a far side sends.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Sequence
from typing import Final, Literal

from rosbridge_sim.graph.attach.connection import Values
from rosbridge_sim.protocol.ops import Status

__all__ = ["MAX_LINES", "PERIOD", "Diagnostics", "ItemKey", "names_of"]

MAX_LINES, PERIOD = 10, 10.0
"""Lines about what the far side sends, at most so many in so many seconds."""

MAX_NAMES_SHOWN: Final = 3
"""Names that a line gives before it only counts."""

MAX_DIAGNOSTIC: Final = 500
"""Longest line [characters]."""

MAX_DIAGNOSTICS: Final = 100
"""Lines that are said once, in all: more than there are packages, unless a far side makes names up."""

_UNKNOWN = re.compile(r"Unable to import ([\w-]+)\.\w+ from package")
"""Words by which a server that answers mistakes tells of a package that it does not know."""

_OWNED = re.compile(r"(?:Topic|Service) \S+ is (?:published|provided) by (\S+) alone")
"""Words of a server of our own kind that has a simulator inside."""

_log = logging.getLogger("rosbridge_sim.attach")

ItemKey = tuple[str, str, str]
"""Something of ours: `topic`, `input` or `service`; its name; its type as the far side is told."""


class Diagnostics:
    """Findings about one far side.

    Attributes:
        taken_services: services of ours that it had before us, until that is said.
        has_lost_topics: topics of ours that it listed once were missing in its last lists.
    """

    def __init__(self, address: str, ros: Literal[1, 2]) -> None:
        """Nothing is known yet.

        Args:
            address: of the far side, for people to read.
            ros: the generation that we speak.
        """
        self.taken_services: list[str] = []
        self.has_lost_topics = False
        self._listed: set[str] = set()
        self._address = address
        self._ros = ros
        self._logged: set[str] = set()
        self._num_lines = self._num_suppressed = 0
        self._lines_until = 0.0

    # Lines

    def log(self, level: int, text: str) -> None:
        """A line about the far side, cut where its own words make it too long."""
        _log.log(
            level, "%s: %s", self._address, text if len(text) <= MAX_DIAGNOSTIC else text[: MAX_DIAGNOSTIC - 3] + "..."
        )

    def log_once(self, text: str) -> None:
        """A warning that is true until somebody changes something there."""
        if text not in self._logged and len(self._logged) < MAX_DIAGNOSTICS:
            self._logged.add(text)
            self.log(logging.WARNING, text)

    def log_limited(self, level: int, text: str, now: float) -> None:
        """A line that may come again and again: some are said, the others counted."""
        if now >= self._lines_until:
            if self._num_suppressed:
                self.log(logging.WARNING, f"and {self._num_suppressed} lines more that are left out")
            self._lines_until = now + PERIOD
            self._num_lines = self._num_suppressed = 0
        if self._num_lines < MAX_LINES:
            self._num_lines += 1
            self.log(level, text)
        else:
            self._num_suppressed += 1

    # Findings

    def note_status(self, op: Status, ours: Collection[ItemKey], now: float) -> None:
        """A remark of its own."""
        text = op.msg or ""
        unknown, owned = _UNKNOWN.match(text), _OWNED.match(text)
        if unknown is not None and any(_package(key) == unknown[1] for key in ours):
            self._report_missing_package(unknown[1], ours)
        elif owned is not None:
            self.taken_services.clear()
            self.log_once(
                f"it has a simulator of its own ({owned[1]}), whose names it keeps for it: ours is not seen there;"
                " a bridge without a world is wanted (--no-world)"
            )
        else:
            about = f" of {op.id}" if op.id else ""
            self.log_limited(logging.WARNING, f"it says{about}: [{op.level}] {text}", now)

    def report_no_rosapi(self) -> None:
        """Its rosapi had time enough to start, and does not answer."""
        self.log_once("rosapi does not answer there: how far behind it is, and what of ours it lacks, is not seen")

    def check_generation(self, values: Values) -> None:
        """Look at the time that it told: its spelling is that of its ROS generation."""
        time = values.get("time")
        ours, theirs = self._ros, 3 - self._ros
        if isinstance(time, dict) and ("sec" in time or "secs" in time) and ("secs" in time) != (ours == 1):
            self.log_once(f"it is of ROS {theirs}, and may refuse messages as ROS {ours} has them: use --ros {theirs}")

    def check_stamps(self, *, is_simulated: bool, is_wall: bool, is_settled: bool) -> None:
        """Look at the time that programs there go by.

        Args:
            is_simulated: its `/use_sim_time` is true.
            is_wall: ours goes out with the time of day.
            is_settled: that follows from what it has just said.
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
        """Everything is announced there."""
        kinds = [kind for kind, _, _ in ours]
        num_topics, num_services, num_inputs = map(kinds.count, ("topic", "service", "input"))
        self.log(
            logging.INFO,
            f"attached: {num_topics} topics and {num_services} services announced, {num_inputs} topics subscribed",
        )
        if self.taken_services:
            names = _listed(self.taken_services)
            self.log_once(f"it has {names} already, of another program or of one that is gone; ours take their place")
            self.taken_services.clear()

    def compare_lists(self, topics: Values, services: Values, ours: Collection[ItemKey], *, is_final: bool) -> bool:
        """Look through the lists of its rosapi.

        Args:
            topics: the values of `/rosapi/topics`.
            services: the values of `/rosapi/services`.
            ours: what was announced.
            is_final: it had time enough: what is missing will not come.

        Returns:
            Whether nothing is missing.
        """
        types = dict(zip(names_of(topics, "topics"), names_of(topics, "types"), strict=False))
        there = {("topic", name) for name in types} | {("service", name) for name in names_of(services, "services")}
        announced = [key for key in ours if key[0] != "input"]
        missing = [key for key in announced if key[:2] not in there]
        self.has_lost_topics = any(kind == "topic" and name in self._listed for kind, name, _ in missing)
        self._listed.update(name for kind, name, _ in announced if kind == "topic" and name in types)
        if is_final:
            self._report_missing(missing, announced, ours)
        for kind, name, type_name in announced:
            told = types.get(name)
            if kind == "topic" and told and _plain(told) != _plain(type_name):
                self.log_once(f"{name} is {told} there and not {type_name}: ours is not taken")
        return not missing

    def _report_missing(
        self, missing: Sequence[ItemKey], announced: Sequence[ItemKey], ours: Collection[ItemKey]
    ) -> None:
        for package in dict.fromkeys(map(_package, missing)):
            lacking = [key for key in missing if _package(key) == package]
            if len(lacking) == sum(_package(key) == package for key in announced):
                self._report_missing_package(package, ours)
            else:
                names = _listed([f"{name} ({type_name})" for _, name, type_name in lacking])
                self.log_once(
                    f"it does not have {names}: its {package} may be of another release, or its lists (globs) deny them"
                )

    def _report_missing_package(self, package: str, ours: Collection[ItemKey]) -> None:
        names = _listed([key[1] for key in ours if _package(key) == package])
        self.log_once(
            f"it does not know the package {package}, and so not {names}: build the package where it runs, and start it"
            " again"
        )


def names_of(values: Values | None, key: str) -> list[str]:
    """A list of names in an answer; empty where there is none."""
    names = None if values is None else values.get(key)
    return [name for name in names if isinstance(name, str)] if isinstance(names, list) else []


def _package(key: ItemKey) -> str:
    return key[2].partition("/")[0]


def _plain(type_name: str) -> str:
    return type_name.replace("/msg/", "/")


def _listed(names: Sequence[str]) -> str:
    """`/a, /b, /c and 4 more`."""
    more = len(names) - MAX_NAMES_SHOWN
    return ", ".join(names[:MAX_NAMES_SHOWN]) + (f" and {more} more" if more > 0 else "")
