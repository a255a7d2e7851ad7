"""Topics that a client publishes and nothing subscribes to; the client is told once if the name looks misspelt.

A topic without a subscriber is no mistake, and most programs have some. But a command to `/ctrl_cmdd` has no effect and
gets no answer. So if nothing listens after some seconds, and the name is nearly that of a topic with a listener, the
publisher is told at level `info`, which clients get only if they have asked for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import islice

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.suggestions import find_misspelt

UNHEARD_AFTER = 5.0
"""Time without a subscriber after which a publisher is told [s]: most programs of a start script are running then."""

MAX_WATCHED_PUBLISHERS = 1_000
"""Publishers that are watched at once; further ones are not told."""

MAX_TOLD_PUBLISHERS = 2
"""Publishers that are judged in one turn, up to 10 ms each with 10,000 topics; the others in the next turns."""

MAX_COMPARED = 200
"""Topics with a listener that a name is compared with, at most; with more of like length some mistakes are not told."""

MAX_LENGTH_DIFFERENCE = 4
"""A misspelt name is longer or shorter by so many characters, at most: two slips and two separators."""

_SEPARATORS = str.maketrans("", "", "_-/")


def is_heard(topic: Topic) -> bool:
    """Return whether something listens to a topic; a recording of all topics does not count."""
    return any(not each.is_recording and not each.is_general for each in topic.subscriptions)


def find_meant(topic: Topic, owner: Participant, topics: Iterable[Topic], may_see: Callable[[str], bool]) -> str:
    """Return the name of the topic with a listener that a publisher probably means; an empty text for none.

    Names that differ by a number are different things. So is a topic that the same client publishes, too.

    Args:
        topic: the topic without a listener.
        owner: its publisher.
        topics: all topics. Most of them have no listener, so that is asked first.
        may_see: returns whether the publisher may know a topic.
    """
    length = len(topic.name)
    like = (
        each
        for each in topics
        if each.subscriptions and abs(len(each.name) - length) <= MAX_LENGTH_DIFFERENCE and is_heard(each)
    )
    heard = {
        each.name: each
        for each in islice(like, MAX_COMPARED)
        if may_see(each.name) and not _is_another_number(each.name, topic.name)
    }
    meant = find_misspelt(topic.name, heard)
    return "" if not meant or owner in heard[meant].publishers else meant


def _is_another_number(one: str, other: str) -> bool:
    """Return whether two names differ by numbers alone: `/ctrl_cmd_0` and `/ctrl_cmd_1`, or `/ctrl_cmd`."""
    numbers = ["".join(filter(str.isdecimal, name)) for name in (one, other)]
    words = ["".join(each for each in name.translate(_SEPARATORS) if not each.isdecimal()) for name in (one, other)]
    return numbers[0] != numbers[1] and words[0] == words[1]
