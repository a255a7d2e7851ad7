"""The file of a mock, from what was seen of a running system: types, rates, values, transforms."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from rosbridge_sim.contracts.seen_system import MAX_DEPTH, SeenField, SeenTopic, parent_of
from rosbridge_sim.documents.document_model import Mistake
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.mock.mock_model import MAX_TOPIC_RATE

MAX_LIST: Final = 1_000
"""Longest list that is written [entries]; a laser scan has some hundreds."""

MAX_LONG_TEXT: Final = 2_000
"""Longest text that is written [characters]; longer ones are pictures and clouds as base64."""

MIN_MESSAGES: Final = 5
"""Messages of a topic with a rate; fewer are repeated only if they are slow."""

SLOW: Final = 2.0
"""A topic with fewer messages has a rate up to this one [Hz]; else it is latched, and several nodes publish on it."""

MAX_WORDS: Final = 8
"""Different texts of a field that are written."""

MAX_TRANSFORMS: Final = 1_000

_STEPS: Final = 20
"""Steps of a random walk from one end of its range to the other."""


def captured_topic(topic: SeenTopic, type_name: str) -> dict[str, JsonValue]:
    """Return the `topics: NAME:` of a mock's file for messages that came.

    Args:
        topic: at least one message.
        type_name: its type.
    """
    captured: dict[str, JsonValue] = {"type": type_name}
    rate = topic.rate
    if rate is not None and (topic.num >= MIN_MESSAGES or rate <= SLOW):
        captured["rate"] = float(f"{min(rate, MAX_TOPIC_RATE):.4g}")
    value = _value(topic, "", without_patterns(topic.sample))
    return captured | ({"value": value} if value else {})


def without_patterns(value: JsonValue, depth: int = 0) -> JsonValue:
    """Return a value of a stranger without what would be a pattern in a mock's file, and without what is too deep."""
    if isinstance(value, (list, dict)) and depth > MAX_DEPTH:
        return None
    if isinstance(value, list):
        return [without_patterns(one, depth + 1) for one in value]
    if isinstance(value, dict):
        return {name: without_patterns(one, depth + 1) for name, one in value.items() if not name.startswith("$")}
    return value


def _value(topic: SeenTopic, path: str, sample: JsonValue) -> JsonValue:
    """Return a constant or a pattern for a field; None to leave it out.

    Left out are stamps and numbers of headers, which the mock has of its own, and what is too long.
    """
    if isinstance(sample, dict):
        is_header = "stamp" in sample and "frame_id" in sample
        is_rotation = sample.keys() == {"x", "y", "z", "w"}  # a quaternion is no four walks
        parts = {
            name: one if is_rotation else _value(topic, f"{path}.{name}".lstrip("."), one)
            for name, one in sample.items()
            if not (is_header and name in {"stamp", "seq"})
        }
        return {name: one for name, one in parts.items() if one is not None}
    if isinstance(sample, list):
        entries = [_value(topic, f"{path}[]", one) for one in sample[:MAX_LIST]]
        return entries if len(sample) <= MAX_LIST and None not in entries else None
    if isinstance(sample, str) and len(sample) > MAX_LONG_TEXT:
        return None
    if isinstance(sample, float):
        sample = _short(sample)
    seen = topic.fields.get(path)
    if seen is None or "[]" in path or seen.is_constant or len(seen.kinds) != 1 or _is_of_time(topic, path):
        return sample
    return _pattern(seen, sample)


def _is_of_time(topic: SeenTopic, path: str) -> bool:
    above = topic.fields.get(parent_of(path))
    return above is not None and above.is_time


def _pattern(seen: SeenField, sample: JsonValue) -> JsonValue:
    """Return the pattern for a field that changed, or the sample if no pattern is plain."""
    if seen.words:
        return sample if seen.is_open or len(seen.words) > MAX_WORDS else {"$list": list(seen.words)}
    if seen.num_not_finite or not seen.is_number or max(-seen.low, seen.high) > _LARGEST:
        return sample
    if seen.is_counter and seen.step is not None and seen.step < _LARGEST_STEP:
        return {"$counter": {"start": int(sample), "step": int(seen.step)}}
    low, high = _short(seen.low), _short(seen.high)
    options = {"start": min(max(low, sample), high), "step": _short((high - low) / _STEPS), "low": low, "high": high}
    return {"$random_walk": options} if options["step"] > 0 else sample


def _short(number: float) -> float:
    """Return a number with ten digits: a millimetre of a latitude."""
    return number if isinstance(number, int) else float(f"{number:.10g}")


_LARGEST: Final = 1e9
_LARGEST_STEP: Final = 2**31


class SeenTransforms:
    """The transforms of tf2_msgs/TFMessage, each with the last values and its rate.

    A mock has them as `transforms`, because one message of /tf has those of one node alone.
    """

    def __init__(self) -> None:
        self._latest: dict[tuple[str, str], tuple[JsonValue, bool]] = {}
        self._times: dict[tuple[str, str], SeenTopic] = {}

    def add(self, now: float, message: Mapping[str, JsonValue], *, is_static: bool) -> None:
        """Take a message.

        Args:
            now: when it came [s].
            message: the message, as JSON has it.
            is_static: it is one of /tf_static.
        """
        transforms = message.get("transforms")
        for one in transforms if isinstance(transforms, list) else ():
            try:
                key = (str(one["header"]["frame_id"]), str(one["child_frame_id"]))
                pose = one["transform"]["translation"], one["transform"]["rotation"]
            except (KeyError, TypeError):
                continue
            if key in self._latest or len(self._latest) < MAX_TRANSFORMS:
                self._latest[key] = pose, is_static
                self._times.setdefault(key, SeenTopic()).add(now, {})

    def captured(self) -> list[JsonValue]:
        """Return the `transforms:` of a mock's file."""
        found = []
        for (parent, child), ((translation, rotation), is_static) in sorted(self._latest.items()):
            entry: dict[str, JsonValue] = {"parent": parent, "child": child}
            rate = self._times[parent, child].rate
            if not is_static and rate is not None:
                entry["rate"] = float(f"{min(rate, MAX_TOPIC_RATE):.4g}")
            try:
                numbers = {name: float(translation[name]) for name in ("x", "y", "z")}
                numbers |= dict(
                    zip(("roll", "pitch", "yaw"), _angles(*(rotation[name] for name in "xyzw")), strict=True)
                )
            except (KeyError, TypeError, ValueError):
                continue
            found.append(entry | {name: _short(number) for name, number in numbers.items() if number})
        return found


def _angles(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of a quaternion [rad]."""
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    return roll, pitch, math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def leave_out_mistakes(
    document: dict[str, JsonValue], find: Callable[[dict[str, JsonValue]], Sequence[Mistake]]
) -> list[str]:
    """Remove from a document what a mock cannot do; return the mistakes.

    First a value is removed, then the topic, service, action or transform with it.

    Args:
        document: the document of a mock's file; changed in place.
        find: returns the mistakes of a document.
    """
    told: list[str] = []
    while mistakes := find(document):
        told += [mistake.text for mistake in mistakes]
        places = {(*mistake.place, None, None)[:3] for mistake in mistakes}
        for key, name, inner in sorted(places, key=repr, reverse=True):  # the last entry of a list first
            things = document.get(str(key))
            thing = things.get(name) if isinstance(things, dict) else None
            if isinstance(thing, dict) and inner in {"value", "answers"}:
                thing.pop(inner, None)
            elif isinstance(things, dict):
                things.pop(name, None)
            elif isinstance(things, list) and isinstance(name, int):
                del things[name:]
            if name is None or not things:
                document.pop(str(key), None)
    return told


def shorten(document: dict[str, JsonValue], longest: int, size: Callable[[JsonValue], int]) -> list[str]:
    """Remove the longest values of topics from a document until it is short enough; return the names of the topics.

    Args:
        document: the document of a mock's file; changed in place.
        longest: its largest size.
        size: returns the size of a part.
    """
    topics = document.get("topics", {})
    sizes = sorted((size(topic["value"]), name) for name, topic in topics.items() if "value" in topic)
    excess, left_out = size(document) - longest, []
    while excess > 0 and sizes:
        num, name = sizes.pop()
        del topics[name]["value"]
        excess -= num
        left_out.append(name)
    return left_out
