"""Topics of a bag that a mock plays in a loop, with new stamps."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from fnmatch import fnmatchcase
from typing import Any

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.records import Record
from rosbridge_sim.suggestions import hint


class RecordedTrack(Record):
    """The messages of one topic.

    Attributes:
        times_ns: since the beginning of the recording [ns], in order.
        messages: bytes as they were recorded.
        decode: returns a message as a plain object; raises DocumentError.
    """

    name: str
    type_name: str
    times_ns: Sequence[int]
    messages: Sequence[bytes]
    decode: Callable[[bytes], object]


class RecordedFile(Record):
    """A recording.

    Attributes:
        length_ns: time after which it begins again [ns].
    """

    length_ns: int
    tracks: tuple[RecordedTrack, ...]


def choose_topics(names: Sequence[str], patterns: Sequence[str], others: Collection[str]) -> list[str]:
    """Return the topics of a recording that are played.

    Args:
        names: all that it has.
        patterns: empty for all.
        others: topics that are not played.

    Raises:
        DocumentError: a pattern matches no topic.
    """
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise DocumentError(f"no topic {pattern} is recorded{hint(pattern, names)}")
    chosen = [name for name in names if not patterns or any(fnmatchcase(name, pattern) for pattern in patterns)]
    return [name for name in chosen if name not in others]


def without_stamps(value: Any) -> Any:  # noqa: ANN401 - of any message
    """Return a plain message without the stamps of its headers, so that they get new ones."""
    if isinstance(value, list):
        return [without_stamps(each) for each in value] if value and isinstance(value[0], dict) else value
    if not isinstance(value, dict):
        return value
    is_header = "stamp" in value and "frame_id" in value
    return {key: without_stamps(each) for key, each in value.items() if not (is_header and key in {"stamp", "seq"})}
