"""Patterns that allow or deny names to clients, by direction, for every way to reach a thing.

The patterns are rosbridge_suite's globs: shell patterns (`*`, `?`, `[abc]`) for absolute names, in which `*` also
matches slashes. Without an allow pattern, everything is allowed. A deny pattern has priority over every allow pattern.
In rosbridge_suite an empty list denies everything, which users do not expect; here that is `--deny-... '*'`.
Many things have several names, and some can be reached by a topic and by a service. So a name is judged by all names of
its thing, from the table `Ways` (`ways.py`):
- It is denied if a deny pattern matches any of these names. Each name is compared with the patterns of its own
direction.
- If there are allow patterns for its direction, one of them must match it; or an allow pattern must match one of the
other names, again in that name's own direction.
- A pattern of only `*`, `?` and slashes names no particular thing, so it does not apply to other directions.
`--deny-publish '*'` still lets clients call services, and `--allow-publish '*'` allows no call.
- A topic of a ROS 1 action is judged in both directions, as the topic and as the action, wildcards included, because
the action consists only of its topics.
An action is judged by the patterns of services, because it is a long call. rosapi's own services are always allowed
unless a deny pattern names them, because clients need them to look around. They list only what the client may use.
These rules do not apply to the simulator's own node and rosapi.
Names are judged when they are first used (advertise, subscribe, first publish without advertise, each call), and again
when the table changes. They are not judged for each message.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import translate
from functools import lru_cache, partial
from typing import Final

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.participant import Participant, resolve
from rosbridge_sim.graph.ways import ACTIONLIB_TOPICS, SHOWN_TOPICS, PolicyEffect, Use, Way, Ways, topics_shown_by
from rosbridge_sim.records import Record

ROSAPI: Final = "/rosapi/"
"""Prefix of the services that list what exists."""

MAX_EFFECTS: Final = 3
MAX_WAYS_SHOWN: Final = 8
MAX_CHARS: Final = 60
"""Limits for a log line about open ways: effects, ways of each effect, and characters of a name."""

_WILDCARDS: Final = "*?/"
"""A pattern of only these characters, such as `*`, names no particular thing: it means everything in its direction."""


class Rule(Record):
    """The names that may be used in one direction.

    Attributes:
        allow: patterns, one of which a name must match; empty allows all names.
        deny: patterns, none of which a name may match.
    """

    allow: tuple[str, ...] = ()
    deny: tuple[str, ...] = ()

    def admits(self, name: str) -> bool:
        """Return True if a name may be used.

        Args:
            name: relative or absolute name.

        Raises:
            GraphError: there are patterns, and the name is not valid.
        """
        return not self.denies(name) and (not self.allow or self.allows(name))

    def allows(self, name: str) -> bool:
        """Return True if an allow pattern matches the name.

        Args:
            name: relative or absolute name.

        Raises:
            GraphError: there are patterns, and the name is not valid.
        """
        return bool(self.allow) and _matches(self.allow, resolve(name))

    def denies(self, name: str) -> bool:
        """Return True if a deny pattern matches the name.

        Args:
            name: relative or absolute name.

        Raises:
            GraphError: there are patterns, and the name is not valid.
        """
        return bool(self.deny) and _matches(self.deny, resolve(name))


_NO_PATTERNS: Final = Rule()


def is_allowed(check: Callable[..., None], *names: str) -> bool:
    """Return True if a `check_...` of a policy passes."""
    try:
        check(*names)
    except GraphError:
        return False
    return True


@dataclass(frozen=True, slots=True)
class Policy:
    """The rights of every client.

    Each `check_...` raises GraphError if a name, relative or absolute, must not be used so.

    Attributes:
        publish, subscribe: rules for topics.
        service: rule for services and actions, to call and to offer.
        parameter: rule for parameters, to read and to write.
        max_held: advertisements, subscriptions, services and actions that one client may hold.
        ways: the other names of things.
        is_open: there are no patterns for topics, services and actions.
    """

    publish: Rule = _NO_PATTERNS
    subscribe: Rule = _NO_PATTERNS
    service: Rule = _NO_PATTERNS
    parameter: Rule = _NO_PATTERNS
    max_held: int = 10_000
    ways: Ways = field(default_factory=Ways, compare=False)
    is_open: bool = field(init=False, compare=False)

    def __post_init__(self) -> None:
        is_open = self.publish == self.subscribe == self.service == _NO_PATTERNS
        object.__setattr__(self, "is_open", is_open)  # read at each call

    def check_publish(self, topic: str, type_name: str = "") -> None:
        """Raise GraphError if the topic must not be published to.

        Args:
            type_name: its type if it is known, because some rules depend on it.
        """
        self._check("publish to", Use.PUBLISH, topic, type_name)

    def check_subscribe(self, topic: str, type_name: str = "") -> None:
        """Raise GraphError if the topic must not be subscribed to.

        Args:
            type_name: its type if it is known.
        """
        self._check("subscribe to", Use.SUBSCRIBE, topic, type_name)

    def check_call(self, name: str) -> None:
        """Raise GraphError if the service must not be called."""
        self._check("call", Use.SERVICE, name)

    def check_goal(self, name: str) -> None:
        """Raise GraphError if no goal may be sent to the action."""
        self._check("call", Use.ACTION, name)

    def check_offer(self, name: str) -> None:
        """Raise GraphError if no service or action may be offered under that name.

        Args:
            name: name of the service or action.
        """
        if self.service == _NO_PATTERNS:
            return
        names = [
            way.name for way in self.ways.all_of(Way(Use.SERVICE, resolve(name))) if self._rule(way) is self.service
        ]
        if any(map(self.service.denies, names)) or (self.service.allow and not any(map(self.service.allows, names))):
            raise GraphError(f"Not allowed to offer {name}", reason=Reason.NOT_ALLOWED)

    def check_parameter(self, name: str) -> None:
        """Raise GraphError if the parameter must not be read or written."""
        if not self.parameter.admits(name):
            raise GraphError(f"Not allowed to use the parameter {name}", reason=Reason.NOT_ALLOWED)

    def may_call(self, name: str) -> bool:
        """Return True if a service may be called."""
        return self._why_not(Use.SERVICE, name) is None

    def may_send_goal(self, name: str) -> bool:
        """Return True if a goal may be sent to an action."""
        return self._why_not(Use.ACTION, name) is None

    def may_subscribe(self, topic: str) -> bool:
        """Return True if a client may subscribe to a topic."""
        return self._why_not(Use.SUBSCRIBE, topic) is None

    def may_see(self, topic: str, type_name: str = "") -> bool:
        """Return True if a client may publish or subscribe to a topic.

        Args:
            type_name: its type if it is known.
        """
        uses = (Use.PUBLISH, Use.SUBSCRIBE)
        return self.is_open or any(self._why_not(use, topic, type_name) is None for use in uses)

    def left_open(self) -> list[str]:
        """Return log lines, one for each pattern that closes one way to something and leaves other ways open."""
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
        """Return True if the rights for a topic depend on its type, so that the type must not change later."""
        return not self.is_open and topic.rpartition("/")[2] in ACTIONLIB_TOPICS

    # Judging

    def _check(self, verb: str, use: Use, name: str, type_name: str = "") -> None:
        why = self._why_not(use, name, type_name)
        if why is not None:
            raise GraphError(f"Not allowed to {verb} {name}{why}", reason=Reason.NOT_ALLOWED)

    def _why_not(self, use: Use, name: str, type_name: str = "") -> str | None:
        """Return why a name must not be used: an empty text, or a text that names another way; None if it may be used.

        Raises:
            GraphError: there are patterns, and the name is not valid.
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
        """Return True if a deny pattern for another name of a thing applies to this way, too."""
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
        """Yield a log line if a pattern leaves other ways open."""
        parts = []
        for effect in effects:
            open_ways = [way for way in (*effect.ways, *effect.also) if self._why_not(*way) is None]
            if open_ways and any(is_closed_by(way) for way in effect.ways if way not in open_ways):
                parts.append(f"to {effect.what}: {_listed_by_use(open_ways)}")
        if parts:
            yield f"{flag} leaves these ways open {_listed(parts, MAX_EFFECTS, '; ')}"


OPEN = Policy()
"""A policy that allows everything."""


class Guest(Participant):
    """A participant with the rights of clients.

    Attributes:
        policy: its rights.
    """

    is_guest = True
    policy: Policy

    def check_subscribe(self, topic: str, type_name: str) -> None:
        """See `Participant`."""
        self.policy.check_subscribe(topic, type_name)

    def check_publish(self, topic: str, type_name: str) -> None:
        """See `Participant`."""
        self.policy.check_publish(topic, type_name)


def _listed(parts: Sequence[str], limit: int = MAX_WAYS_SHOWN, between: str = ", ") -> str:
    """Return the first parts as text, and the number of the others."""
    more = len(parts) - limit
    return between.join(parts[:limit]) + (f"{between}and {more} more" if more > 0 else "")


def _listed_by_use(ways: list[Way]) -> str:
    """Return ways as text, such as "publishing /a, /b, calling /c"."""
    names = [_shortened(way.name) for way in ways]
    for i in reversed(range(len(ways))):
        if i == 0 or ways[i].use is not ways[i - 1].use:
            names[i] = f"{ways[i].use.value} {names[i]}"
    return _listed(names)


def _shortened(text: str) -> str:
    return text if len(text) <= MAX_CHARS else text[: MAX_CHARS - 3] + "..."


def _is_crossing(way: Way, other: Way) -> bool:
    """Return True if two names are judged by patterns of different directions; actions count as services."""
    services = {Use.SERVICE, Use.ACTION}
    return way.use is not other.use and not {way.use, other.use} <= services


@lru_cache(maxsize=64)
def _named(patterns: tuple[str, ...]) -> tuple[str, ...]:
    """Return the patterns that name a particular thing."""
    return tuple(pattern for pattern in patterns if pattern.strip(_WILDCARDS))


@lru_cache(maxsize=4096)
def _matches(patterns: tuple[str, ...], name: str) -> bool:
    return bool(patterns) and _compile(patterns).match(name) is not None


@lru_cache(maxsize=64)
def _compile(patterns: tuple[str, ...]) -> re.Pattern[str]:
    """Return one expression for all patterns; relative patterns that do not begin with a wildcard become absolute."""
    return re.compile("|".join(translate(p if p[:1] in {"/", "*", "?", "["} else f"/{p}") for p in patterns))
