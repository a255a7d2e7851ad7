"""The table of ways: all names by which one thing can be reached, so that a policy judges them alike.

The table has a direction, from the narrow name to the wide one: `/Ego-2/ctrl_cmd` is also judged as `/ctrl_cmd`, but
the pattern `/Ego-2/*` applies only to ego 2. The graph itself adds these rows:
    the five topics of a ROS 1 action, known by name and message type        the action
    <action>/_action/..., by which ROS 2 uses one                            the action
    sending a goal                                                           publishing <action>/goal
    publishing <action>/cancel                                               calling <action>/_action/cancel_goal, and
                                                                             the reverse
    /republish_tfs, /tf2_web_republisher and its topics                      each other
    the same                                                                 subscribing to /tf and /tf_static

The last row is stricter, because it is not another name but another way to *read* something: a client that may not
subscribe to transforms may not have them republished, whatever the patterns for services allow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from enum import Enum
from typing import Final, NamedTuple, TypeAlias

from rosbridge_sim.graph.actions import CANCEL, HIDDEN
from rosbridge_sim.records import Record

REPUBLISHER_NAME: Final = "/tf2_web_republisher"
"""Name of the action that publishes transforms for web pages."""

REPUBLISH_SERVICE: Final = "/republish_tfs"
"""Name of the service that does the same."""

MAX_KNOWN_NAMES: Final = 20_000
"""Names whose other names are cached; a lookup costs about 10 us, and rosapi lists thousands."""

ACTIONLIB_TOPICS: Final = {
    "goal": "ActionGoal",
    "cancel": "/GoalID",
    "status": "/GoalStatusArray",
    "feedback": "ActionFeedback",
    "result": "ActionResult",
}
"""The five topics of a ROS 1 action, and the end of their types' names, because other topics are called `status`, too.
"""


class Use(Enum):
    """The use of a name by a client; the values are words for the log."""

    PUBLISH = "publishing"
    SUBSCRIBE = "listening to"
    SERVICE = "calling"
    ACTION = "sending goals to"


class Way(NamedTuple):
    """An absolute name, and its use."""

    use: Use
    name: str


WayLookup: TypeAlias = Callable[[Way], Iterable[Way]]
"""Returns the other names by which a way is judged; the way itself may be among them."""


class PolicyEffect(Record):
    """An effect that can be reached in several ways, which are not names of one thing.

    Attributes:
        what: completes "ways to ...".
        ways: the ways made for it, with their current names.
        also: ways that do many other things, too; a pattern that closes only one of them does not mean this effect.
    """

    what: str
    ways: tuple[Way, ...]
    also: tuple[Way, ...] = ()


class Ways:
    """The table of other names. Parts of the server that give things several names add their own rows.

    Attributes:
        on_change: called with monotonic time [s] after the meaning of names has changed.
    """

    def __init__(self) -> None:
        self.on_change: dict[Callable[[float], None], None] = {}
        self._lookups: list[WayLookup] = [_look_up]
        self._effects: list[Callable[[], Iterable[PolicyEffect]]] = [lambda: (_TRANSFORMS,)]
        self._known: dict[tuple[Way, tuple[Way, ...]], tuple[Way, ...]] = {}

    def add(self, effects: Callable[[], Iterable[PolicyEffect]], lookup: WayLookup | None = None) -> None:
        """Add the rows of a part of the server.

        Args:
            effects: returns the effects that can be reached in several ways, for the log.
            lookup: returns the other names of a way; None if each of its things has one name.
        """
        self._effects.append(effects)
        if lookup is not None:
            self._lookups.append(lookup)
        self._known.clear()

    def change(self, now: float) -> None:
        """Clear the cache, because a part of the server now has other names."""
        self._known.clear()
        for notify in tuple(self.on_change):
            notify(now)

    def all_of(self, way: Way, type_name: str = "") -> tuple[Way, ...]:
        """Return the way itself and all others by which it is judged.

        Args:
            way: a way with an absolute name.
        """
        of_action = tuple(_look_up_topic(way, type_name))
        key = (way, of_action)  # not the type's name, which may be as long as a frame
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
        """Yield all effects that can be reached in several ways."""
        for each in self._effects:
            yield from each()


def _look_up_topic(way: Way, type_name: str) -> Iterator[Way]:
    """Yield the action to which one of the five topics belongs."""
    action, _, part = way.name.rpartition("/")
    ending = ACTIONLIB_TOPICS.get(part)
    if ending is None or not action or way.use not in {Use.PUBLISH, Use.SUBSCRIBE}:
        return
    package, _, short = type_name.rstrip("/").rpartition("/")  # trailing slashes do not belong to a type's name
    if package and f"/{short}".endswith(ending):
        yield Way(Use.ACTION, action)
        if way.use is Use.PUBLISH and part == "cancel":
            yield Way(Use.SERVICE, action + CANCEL)


def _look_up(way: Way) -> Iterator[Way]:
    """Yield the other names that the graph itself gives."""
    action, _, part = way.name.partition(HIDDEN)
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
"""Topics that the transform republisher reads, and the topics on which it publishes them."""


_REPUBLISHERS: Final = (Way(Use.SERVICE, REPUBLISH_SERVICE), Way(Use.ACTION, REPUBLISHER_NAME))
"""Ways to request transforms."""

_TRANSFORMS: Final = PolicyEffect("learn transforms", (*SHOWN_TOPICS[:2], *_REPUBLISHERS))


def topics_shown_by(way: Way) -> tuple[Way, ...]:
    """Return the topics whose content a client gets, in other words, by this way."""
    if way in {*_REPUBLISHERS, (Use.PUBLISH, f"{REPUBLISHER_NAME}/goal")}:
        return SHOWN_TOPICS
    if way.use is Use.SUBSCRIBE and way.name.startswith(f"{REPUBLISHER_NAME}/"):
        return (way, *SHOWN_TOPICS)
    return ()
