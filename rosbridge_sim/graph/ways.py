"""The table of ways: all names by which one thing can be reached, so that a policy judges them alike.

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
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Final, NamedTuple, TypeAlias

from rosbridge_sim.graph.actions import CANCEL
from rosbridge_sim.graph.republisher_names import REPUBLISH_SERVICE, REPUBLISHER_NAME

__all__ = [
    "ACTIONLIB_TOPICS",
    "SHOWN_TOPICS",
    "PolicyEffect",
    "Use",
    "Way",
    "WayLookup",
    "Ways",
    "topics_shown_by",
]

MAX_KNOWN_NAMES: Final = 20_000
"""Names of which the table keeps the other names; looking them up costs some 10 us, and rosapi lists thousands."""

_HIDDEN: Final = "/_action/"
"""Separator between the name of an action of ROS 2 and those of its topics and services."""

ACTIONLIB_TOPICS: Final = {
    "goal": "ActionGoal",
    "cancel": "/GoalID",
    "status": "/GoalStatusArray",
    "feedback": "ActionFeedback",
    "result": "ActionResult",
}
"""The five topics of an action of ROS 1, and how their types' names end: many a plain topic is called `status`."""


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
    ending = ACTIONLIB_TOPICS.get(part)
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
    if topics_shown_by(way):
        yield from _REPUBLISHERS


SHOWN_TOPICS: Final = tuple(
    Way(Use.SUBSCRIBE, name)
    for name in ("/tf", "/tf_static", f"{REPUBLISHER_NAME}/feedback", f"{REPUBLISHER_NAME}/tf_repub_1")
)
"""Topics that the republisher of transforms shows, and the topics on which it does."""


_REPUBLISHERS: Final = (Way(Use.SERVICE, REPUBLISH_SERVICE), Way(Use.ACTION, REPUBLISHER_NAME))
"""The ways of asking for transforms."""

_TRANSFORMS: Final = PolicyEffect("learn transforms", (*SHOWN_TOPICS[:2], *_REPUBLISHERS))


def topics_shown_by(way: Way) -> tuple[Way, ...]:
    """Names of all that is heard, in other words, by going this way."""
    if way in {*_REPUBLISHERS, (Use.PUBLISH, f"{REPUBLISHER_NAME}/goal")}:
        return SHOWN_TOPICS
    if way.use is Use.SUBSCRIBE and way.name.startswith(f"{REPUBLISHER_NAME}/"):
        return (way, *SHOWN_TOPICS)
    return ()
