"""Patterns that allow and deny names to clients, by direction, for every way to a thing.

The patterns are rosbridge_suite's globs: shell patterns (`*`, `?`, `[abc]`) over absolute names, in which `*` runs
across slashes. Without an allow pattern everything is allowed; a deny pattern beats every allow pattern.
rosbridge_suite lets an empty list deny all, which nobody reads out of an empty list: here that is `--deny-... '*'`.

Many things have several names, and some can be reached by a topic and by a service. So a name is judged by all names
of its thing, from the table `Ways` (`ways.py`):

- It is denied if a deny pattern matches any of them, each by the patterns of its own direction.
- Where there are allow patterns for its direction, one of them must match it; or an allow pattern must match one of the
  other names, each again by those of its own direction.
- A pattern of `*`, `?` and slashes alone names no thing, so it says nothing of other directions: `--deny-publish '*'`
  makes observers that may call services, and `--allow-publish '*'` allows no call.
- A topic of an action of ROS 1 is judged in both directions, as the topic and as the action, wildcards included: the
  action is nothing but its topics.

An action is judged by the patterns of services: it is a long call. rosapi's own services can always be called
unless a deny pattern names them, since no client gets far without looking around; what they list is what the
asking client could use. The simulator's own node and rosapi are not subject to any of this.

Names are judged when they are first used (advertise, subscribe, the first bare publish, each call), and again when the
table changes, never per message.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import translate
from functools import lru_cache, partial
from typing import Final

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.participant import resolve
from rosbridge_sim.graph.ways import ACTIONLIB_TOPICS, SHOWN_TOPICS, PolicyEffect, Use, Way, Ways, topics_shown_by

__all__ = ["OPEN", "Policy", "Rule"]

ROSAPI: Final = "/rosapi/"
"""Beginning of the names of the services with which clients look around."""

MAX_EFFECTS: Final = 3
MAX_WAYS_SHOWN: Final = 8
MAX_CHARS: Final = 60
"""Effects, ways of each and characters of one that a line on what is left open names: a line of a log is to be read."""

_WILDCARDS: Final = "*?/"
"""Characters of a pattern that names no thing, such as `*`: it means everything of its direction."""


@dataclass(frozen=True, slots=True)
class Rule:
    """Which names may be used in one way.

    Attributes:
        allow: patterns, one of which a name must match; empty where any name will do.
        deny: patterns, none of which it may match.
    """

    allow: tuple[str, ...] = ()
    deny: tuple[str, ...] = ()

    def admits(self, name: str) -> bool:
        """Return whether a name may be used.

        Raises:
            GraphError: there are patterns, and it is no name.
        """
        return not self.denies(name) and (not self.allow or self.allows(name))

    def allows(self, name: str) -> bool:
        """Return whether an allow pattern matches the name; raises as `admits` does."""
        return bool(self.allow) and _matches(self.allow, resolve(name))

    def denies(self, name: str) -> bool:
        """Return whether a deny pattern matches the name; raises as `admits` does."""
        return bool(self.deny) and _matches(self.deny, resolve(name))


_NO_PATTERNS: Final = Rule()


@dataclass(frozen=True, slots=True)
class Policy:
    """The rights of every client. Each `check_...` does nothing where the name, relative or absolute, may be used so.

    Attributes:
        publish, subscribe: for topics.
        service: for services and actions, to call and to offer.
        parameter: for parameters, to read and to write.
        max_held: advertisements, subscriptions, services and actions that one client may hold.
        ways: the other names of things.
        is_open: there are no patterns for topics, services and actions.
    """

    publish: Rule = Rule()
    subscribe: Rule = Rule()
    service: Rule = Rule()
    parameter: Rule = Rule()
    max_held: int = 10_000
    ways: Ways = field(default_factory=Ways, compare=False)
    is_open: bool = field(init=False, compare=False)

    def __post_init__(self) -> None:
        is_open = self.publish == self.subscribe == self.service == _NO_PATTERNS
        object.__setattr__(self, "is_open", is_open)  # asked for at each call

    def check_publish(self, topic: str, type_name: str = "") -> None:
        """Raise GraphError if the topic may not be published to.

        Args:
            topic: its name.
            type_name: its type, where that is known: some things are told apart by it. So for the others.
        """
        self._check("publish to", Use.PUBLISH, topic, type_name)

    def check_subscribe(self, topic: str, type_name: str = "") -> None:
        """Raise GraphError if the topic may not be listened to."""
        self._check("subscribe to", Use.SUBSCRIBE, topic, type_name)

    def check_call(self, name: str) -> None:
        """Raise GraphError if the service may not be called."""
        self._check("call", Use.SERVICE, name)

    def check_goal(self, name: str) -> None:
        """Raise GraphError if no goal may be sent to the action."""
        self._check("call", Use.ACTION, name)

    def check_offer(self, name: str) -> None:
        """Raise GraphError if no service and no action may be offered under that name."""
        if self.service == _NO_PATTERNS:
            return
        names = [
            way.name for way in self.ways.all_of(Way(Use.SERVICE, resolve(name))) if self._rule(way) is self.service
        ]
        if any(map(self.service.denies, names)) or (self.service.allow and not any(map(self.service.allows, names))):
            raise GraphError(f"Not allowed to offer {name}", reason=Reason.NOT_ALLOWED)

    def check_parameter(self, name: str) -> None:
        """Raise GraphError if the parameter may be neither read nor written."""
        if not self.parameter.admits(name):
            raise GraphError(f"Not allowed to use the parameter {name}", reason=Reason.NOT_ALLOWED)

    def may_call(self, name: str) -> bool:
        """Return whether a service may be called."""
        return self._why_not(Use.SERVICE, name) is None

    def may_send_goal(self, name: str) -> bool:
        """Return whether a goal may be sent to an action."""
        return self._why_not(Use.ACTION, name) is None

    def may_see(self, topic: str, type_name: str = "") -> bool:
        """Return whether a client may publish to a topic, or listen to it."""
        return any(self._why_not(use, topic, type_name) is None for use in (Use.PUBLISH, Use.SUBSCRIBE))

    def left_open(self) -> list[str]:
        """Lines for the log, one for each pattern that closes a way to something and leaves other ways open."""
        if self.is_open:
            return []
        effects = list(self.ways.effects())
        lines: list[str] = []
        for flag, use, rule in (
            ("publish", Use.PUBLISH, self.publish),
            ("subscribe", Use.SUBSCRIBE, self.subscribe),
            ("service", Use.SERVICE, self.service),
        ):
            for pattern in rule.deny:
                is_denied = partial(self._is_denied_by, use, pattern)
                lines += self._describe(f"--deny-{flag} {_shortened(pattern)}", effects, is_denied)
            if rule.allow:
                is_left_out = partial(self._is_left_out, use)
                lines += self._describe(
                    f"--allow-{flag} {_listed([*map(_shortened, rule.allow)])}", effects, is_left_out
                )
        return lines

    def needs_type(self, topic: str) -> bool:
        """Return whether the type decides if a topic may be used, so that no other one may come later."""
        return not self.is_open and topic.rpartition("/")[2] in ACTIONLIB_TOPICS

    # How it is judged

    def _check(self, verb: str, use: Use, name: str, type_name: str = "") -> None:
        why = self._why_not(use, name, type_name)
        if why is not None:
            raise GraphError(f"Not allowed to {verb} {name}{why}", reason=Reason.NOT_ALLOWED)

    def _why_not(self, use: Use, name: str, type_name: str = "") -> str | None:
        """Return why a name may not be used: an empty text, or one that tells the other name; None if it may be.

        Raises:
            GraphError: there are patterns, and it is no name.
        """
        if self.is_open:
            return None
        way = Way(use, resolve(name))
        ways = self.ways.all_of(way, type_name)
        for each in ways:
            if self._denies(way, each):
                return "" if each.name == way.name else f", another way of {each.use.value} {each.name}"
        if not self._is_allowed(way, ways):
            return ""
        shown = topics_shown_by(way)
        for each in shown:
            if self.subscribe.denies(each.name):
                return f", since it shows what {each.name} does"
        if shown and self.subscribe.allow and not any(self.subscribe.allows(each.name) for each in shown):
            return f", since it shows what {SHOWN_TOPICS[0].name} does"
        return None

    def _is_allowed(self, way: Way, ways: Sequence[Way]) -> bool:
        if not (self.service.allow or self.publish.allow or self.subscribe.allow):
            return True
        if way.use is Use.SERVICE and way.name.startswith(ROSAPI):
            return True
        if any(_matches(_named(self._rule(each).allow), each.name) for each in ways):
            return True
        judged = (way, *(each for each in ways if each.use is Use.ACTION))
        return all(not self._rule(each).allow or _matches(self._rule(each).allow, each.name) for each in judged)

    def _denies(self, way: Way, other: Way) -> bool:
        """Return whether a deny pattern for another name of a way holds for the way."""
        patterns = self._rule(other).deny
        if not patterns:
            return False
        if other.use is not Use.ACTION and _is_crossing(way, other):
            patterns = _named(patterns)
        return _matches(patterns, other.name)

    def _rule(self, way: Way) -> Rule:
        if way.use is Use.PUBLISH:
            return self.publish
        return self.subscribe if way.use is Use.SUBSCRIBE else self.service

    def _is_denied_by(self, use: Use, pattern: str, way: Way) -> bool:
        named = _named((pattern,))
        return any(
            each.use is use and _matches(named if _is_crossing(way, each) else (pattern,), each.name)
            for each in self.ways.all_of(way)
        )

    def _is_left_out(self, use: Use, way: Way) -> bool:
        return way.use is use and not self._is_allowed(way, self.ways.all_of(way))

    def _describe(
        self, flag: str, effects: Iterable[PolicyEffect], is_closed_by: Callable[[Way], bool]
    ) -> Iterator[str]:
        """A line on what a pattern leaves open, if it does."""
        parts = []
        for effect in effects:
            open_ways = [way for way in (*effect.ways, *effect.also) if self._why_not(*way) is None]
            if open_ways and any(is_closed_by(way) for way in effect.ways if way not in open_ways):
                parts.append(f"to {effect.what}: {_listed_by_use(open_ways)}")
        if parts:
            yield f"{flag} leaves these ways open {_listed(parts, MAX_EFFECTS, '; ')}"


OPEN = Policy()
"""Everything is allowed."""


def _listed(parts: Sequence[str], limit: int = MAX_WAYS_SHOWN, between: str = ", ") -> str:
    """The first of them, and how many more there are."""
    more = len(parts) - limit
    return between.join(parts[:limit]) + (f"{between}and {more} more" if more > 0 else "")


def _listed_by_use(ways: list[Way]) -> str:
    """Such as "publishing /a, /b, calling /c"."""
    names = [_shortened(way.name) for way in ways]
    for i in reversed(range(len(ways))):
        if i == 0 or ways[i].use is not ways[i - 1].use:
            names[i] = f"{ways[i].use.value} {names[i]}"
    return _listed(names)


def _shortened(text: str) -> str:
    return text if len(text) <= MAX_CHARS else text[: MAX_CHARS - 3] + "..."


def _is_crossing(way: Way, other: Way) -> bool:
    """Return whether two names are judged by the patterns of different directions; actions are judged as services."""
    services = {Use.SERVICE, Use.ACTION}
    return way.use is not other.use and not {way.use, other.use} <= services


@lru_cache(maxsize=64)
def _named(patterns: tuple[str, ...]) -> tuple[str, ...]:
    """The patterns that name something."""
    return tuple(pattern for pattern in patterns if pattern.strip(_WILDCARDS))


@lru_cache(maxsize=4096)
def _matches(patterns: tuple[str, ...], name: str) -> bool:
    return bool(patterns) and _compile(patterns).match(name) is not None


@lru_cache(maxsize=64)
def _compile(patterns: tuple[str, ...]) -> re.Pattern[str]:
    """One expression for all; a pattern that begins as a name does is meant from the root."""
    return re.compile("|".join(translate(p if p[:1] in {"/", "*", "?", "["} else f"/{p}") for p in patterns))
