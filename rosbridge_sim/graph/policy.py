"""Patterns that allow and deny names to clients, by direction, for every way to a thing.

The patterns are rosbridge_suite's globs: shell patterns (`*`, `?`, `[abc]`) over absolute names, in which `*` runs
across slashes. Without an allow pattern everything is allowed; a deny pattern beats every allow pattern.
rosbridge_suite lets an empty list deny all, which nobody reads out of an empty list: here that is `--deny-... '*'`.

Many things have several names, and some can be reached by a topic and by a service. So a name is judged by all names
of its thing, from the table `Ways`:

- It is denied if a deny pattern matches any of them, each by the patterns of its own direction.
- Where there are allow patterns for its direction, one of them must match it; or an allow pattern must match one of the
  other names, each again by those of its own direction.
- A pattern of `*`, `?` and slashes alone names no thing, so it says nothing of other directions: `--deny-publish '*'`
  makes observers that may call services, and `--allow-publish '*'` allows no call.
- A topic of an action of ROS 1 is judged in both directions, as the topic and as the action, wildcards included: the
  action is nothing but its topics.

The table has a direction, from the narrow name to the wide one: `/Ego-2/ctrl_cmd` is judged as `/ctrl_cmd` too, but
the pattern `/Ego-2/*` means ego 2 alone. Of the graph itself these are in it:

    the five topics of an action of ROS 1, known by name and message type    the action
    <action>/_action/..., by which ROS 2 speaks of one                       the action
    sending a goal                                                           publishing <action>/goal
    publishing <action>/cancel                                               calling <action>/_action/cancel_goal, and
                                                                             the reverse
    /republish_tfs, /tf2_web_republisher and its topics                      each other
    the same                                                                 listening to /tf and /tf_static

The last row is stricter, since it is not another name but another way to *hear* something: a client that may not listen
to transforms may not have them republished, whatever the patterns of services allow.

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
from enum import Enum
from fnmatch import translate
from functools import lru_cache, partial
from typing import Final, NamedTuple, TypeAlias

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.actions import CANCEL
from rosbridge_sim.graph.participant import resolve
from rosbridge_sim.graph.tf.web_republisher import REPUBLISH_SERVICE as REPUBLISH
from rosbridge_sim.graph.tf.web_republisher import REPUBLISHER_NAME as REPUBLISHER

__all__ = ["OPEN", "Policy", "PolicyEffect", "Rule", "Use", "Way", "WayLookup", "Ways"]

ROSAPI: Final = "/rosapi/"
"""Where the names of the services begin with which clients look around."""

MAX_KNOWN_NAMES: Final = 20_000
"""Names of which the table keeps the other names; looking them up costs some 10 us, and rosapi lists thousands."""

MAX_EFFECTS: Final = 3
MAX_WAYS_SHOWN: Final = 8
MAX_CHARS: Final = 60
"""Effects, ways of each and characters of one that a line on what is left open names: a line of a log is to be read."""

_HIDDEN: Final = "/_action/"
"""Separator between the name of an action of ROS 2 and those of its topics and services."""

_ACTIONLIB: Final = {
    "goal": "ActionGoal",
    "cancel": "/GoalID",
    "status": "/GoalStatusArray",
    "feedback": "ActionFeedback",
    "result": "ActionResult",
}
"""The five topics of an action of ROS 1, and how their types' names end: many a plain topic is called `status`."""

_WILDCARDS: Final = "*?/"
"""Characters of a pattern that names no thing, such as `*`: it means everything of its direction."""


class Use(Enum):
    """Use of a name by a client; the values are words for the log."""

    PUBLISH = "publishing"
    SUBSCRIBE = "listening to"
    SERVICE = "calling"
    ACTION = "sending goals to"


class Way(NamedTuple):
    """A name, absolute, and what is done with it."""

    use: Use
    name: str


WayLookup: TypeAlias = Callable[[Way], Iterable[Way]]
"""The other names under which a way is judged too; the way itself may be among them."""


@dataclass(frozen=True, slots=True)
class PolicyEffect:
    """Something that can be brought about in several ways, which are not the same thing.

    Attributes:
        what: completes "ways to ...".
        ways: those that are there for it, under the names that they have now.
        also: those that do much else; closing one of them alone does not mean this effect.
    """

    what: str
    ways: tuple[Way, ...]
    also: tuple[Way, ...] = ()


class Ways:
    """The table of other names. Parts of the server that give things several names add their own rows.

    Attributes:
        on_change: called with `now` after names have got another meaning.
    """

    def __init__(self) -> None:
        self.on_change: dict[Callable[[float], None], None] = {}
        self._lookups: list[WayLookup] = [_look_up]
        self._effects: list[Callable[[], Iterable[PolicyEffect]]] = [lambda: (_TRANSFORMS,)]
        self._known: dict[tuple[Way, tuple[Way, ...]], tuple[Way, ...]] = {}

    def add(self, effects: Callable[[], Iterable[PolicyEffect]], lookup: WayLookup | None = None) -> None:
        """Add the rows of a part of the server.

        Args:
            effects: what can be brought about in several ways, for the log.
            lookup: what it knows of a way; None where each of its things has one name.
        """
        self._effects.append(effects)
        if lookup is not None:
            self._lookups.append(lookup)
        self._known.clear()

    def change(self, now: float) -> None:
        """Look everything up anew, for a part of the server has other names now."""
        self._known.clear()
        for notify in tuple(self.on_change):
            notify(now)

    def all_of(self, way: Way, type_name: str = "") -> tuple[Way, ...]:
        """The way itself and all others that it is judged by.

        Args:
            way: under an absolute name.
            type_name: of a topic, in any spelling.
        """
        of_action = tuple(_look_up_topic(way, type_name))
        key = (way, of_action)  # without the type: its name may be as long as a frame
        ways = self._known.get(key)
        if ways is None:
            found = dict.fromkeys([way, *of_action])
            for lookup in self._lookups:
                found |= dict.fromkeys(lookup(way))
            if len(self._known) >= MAX_KNOWN_NAMES:
                self._known.clear()
            ways = self._known[key] = tuple(found)
        return ways

    def effects(self) -> Iterator[PolicyEffect]:
        """All that can be brought about in several ways."""
        for each in self._effects:
            yield from each()


def _look_up_topic(way: Way, type_name: str) -> Iterator[Way]:
    """The action to which one of the five topics belongs."""
    action, _, part = way.name.rpartition("/")
    ending = _ACTIONLIB.get(part)
    if ending is None or not action or way.use not in {Use.PUBLISH, Use.SUBSCRIBE}:
        return
    package, _, short = type_name.rstrip("/").rpartition("/")  # needless slashes are no part of a type's name
    if package and f"/{short}".endswith(ending):
        yield Way(Use.ACTION, action)
        if way.use is Use.PUBLISH and part == "cancel":
            yield Way(Use.SERVICE, action + CANCEL)


def _look_up(way: Way) -> Iterator[Way]:
    """The other names that the graph itself gives."""
    action, _, part = way.name.partition(_HIDDEN)
    if part and action:
        yield Way(Use.ACTION, action)
        if way == (Use.SERVICE, action + CANCEL):
            yield Way(Use.PUBLISH, action + "/cancel")
    elif way.use is Use.ACTION:
        yield Way(Use.PUBLISH, way.name + "/goal")
    if _shows(way):
        yield from _REPUBLISHERS


_SHOWN: Final = tuple(
    Way(Use.SUBSCRIBE, name) for name in ("/tf", "/tf_static", f"{REPUBLISHER}/feedback", f"{REPUBLISHER}/tf_repub_1")
)
"""Topics that the republisher of transforms shows, and the topics on which it does."""


_REPUBLISHERS: Final = (Way(Use.SERVICE, REPUBLISH), Way(Use.ACTION, REPUBLISHER))
"""The ways of asking for transforms."""

_TRANSFORMS: Final = PolicyEffect("learn transforms", (*_SHOWN[:2], *_REPUBLISHERS))


def _shows(way: Way) -> tuple[Way, ...]:
    """Names of all that is heard, in other words, by going this way."""
    if way in {*_REPUBLISHERS, (Use.PUBLISH, f"{REPUBLISHER}/goal")}:
        return _SHOWN
    if way.use is Use.SUBSCRIBE and way.name.startswith(f"{REPUBLISHER}/"):
        return (way, *_SHOWN)
    return ()


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
        """Whether a name may be used.

        Raises:
            GraphError: there are patterns, and it is no name.
        """
        return not self.denies(name) and (not self.allow or self.allows(name))

    def allows(self, name: str) -> bool:
        """Tell whether an allow pattern matches the name; raises as `admits` does."""
        return bool(self.allow) and _matches(self.allow, resolve(name))

    def denies(self, name: str) -> bool:
        """Whether a deny pattern matches the name; raises as `admits` does."""
        return bool(self.deny) and _matches(self.deny, resolve(name))


_NO_PATTERNS: Final = Rule()


@dataclass(frozen=True, slots=True)
class Policy:
    """What every client may do. Each `check_...` does nothing where the name, relative or absolute, may be used so.

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
        """Tell whether a service may be called."""
        return self._why_not(Use.SERVICE, name) is None

    def may_send_goal(self, name: str) -> bool:
        """Tell whether a goal may be sent to an action."""
        return self._why_not(Use.ACTION, name) is None

    def may_see(self, topic: str, type_name: str = "") -> bool:
        """Whether a topic is any of a client's business: it may publish there, or listen."""
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
        """Tell whether the type decides if a topic may be used, so that no other one may come later."""
        return not self.is_open and topic.rpartition("/")[2] in _ACTIONLIB

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
        shown = _shows(way)
        for each in shown:
            if self.subscribe.denies(each.name):
                return f", since it shows what {each.name} does"
        if shown and self.subscribe.allow and not any(self.subscribe.allows(each.name) for each in shown):
            return f", since it shows what {_SHOWN[0].name} does"
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
        """Tell whether a deny pattern for another name of a way holds for the way."""
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
    """Tell whether two names are judged by the patterns of different directions; actions are judged as services."""
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
