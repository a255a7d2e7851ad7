"""The contract that describes what was seen."""

from __future__ import annotations

import math
from collections.abc import Mapping

from msgspec import to_builtins

from rosbridge_sim.contracts.contract import TOLERANCE, Contract, FieldTerms, TopicTerms
from rosbridge_sim.contracts.seen_system import SeenField, SeenSystem, SeenTopic, parent_of
from rosbridge_sim.loose_types import JsonValue

MIN_MESSAGES = 5
"""Messages of a topic from which its rate is taken: fewer say little, and latched topics have one."""


MAX_ENUM = 8
"""Different texts of a field that a contract lists; a field with more of them may be any text."""


def record_contract(seen: SeenSystem, margin: float, tolerance: float = TOLERANCE) -> Contract:
    """Return the contract for what was seen: each range is as wide as seen, and wider by a margin on both sides.

    Args:
        seen: topics that came, and services.
        margin: share of the width of a range; of the number itself where it was always the same.
        tolerance: share by which the rates may differ.
    """
    types = seen.types or {}
    differing = {} if tolerance == TOLERANCE else {"tolerance": tolerance}
    return Contract(
        topics={
            name: _topic(topic, types.get(name, ""), margin, differing) for name, topic in sorted(seen.topics.items())
        },
        services=dict(sorted((seen.services or {}).items())),
    )


def _topic(topic: SeenTopic, kind: str, margin: float, differing: Mapping[str, float]) -> TopicTerms:
    rate = topic.rate if topic.num >= MIN_MESSAGES else None
    timing = {} if rate is None else {"rate": float(f"{rate:.4g}"), **differing}
    return TopicTerms(type=kind, fields=_fields(topic, margin), **timing)


def _fields(topic: SeenTopic, margin: float) -> dict[str, FieldTerms]:
    """Return the terms of all fields that were always there, outermost first.

    The `seq` of a header is left out, because ROS 2 has none, and what is in a time, because each generation has names
    of its own for that.
    """
    found: dict[str, FieldTerms] = {}
    for path, seen in topic.fields.items():
        holder = parent_of(path)
        is_seq = path.rpartition(".")[2] == "seq" and f"{holder}.frame_id".lstrip(".") in topic.fields
        if path and not is_seq and not topic.fields[holder].is_time and not topic.num_missing(path):
            terms = _terms(seen, margin)
            if terms is not None:
                found[path] = terms
    return found


def _terms(seen: SeenField, margin: float) -> FieldTerms | None:
    """Return the terms of a field; None for a message, whose parts say more."""
    if seen.kinds == {"message"} and not seen.is_time:
        return None
    if len(seen.kinds) != 1 or seen.is_time or seen.is_counter:
        return FieldTerms()
    if seen.words or seen.is_open:
        is_enum = not seen.is_open and len(seen.words) <= MAX_ENUM
        return FieldTerms(values=[False, True] if "flag" in seen.kinds else list(seen.words) if is_enum else None)
    if seen.longest >= 0:
        extra = math.ceil(margin * (seen.longest - seen.shortest))
        return FieldTerms(min_length=max(0, seen.shortest - extra), max_length=seen.longest + extra)
    if not seen.is_number:
        return FieldTerms(nan=True)
    width = margin * ((seen.high - seen.low) or abs(seen.low))
    low, high = _down(seen.low - width), 0.0 - _down(-seen.high - width)
    return FieldTerms(low=low, high=high, nan=bool(seen.num_not_finite))


def _down(number: float) -> float:
    """Return a number with six digits that is not larger."""
    if abs(number) < _SMALL:
        return -_SMALL if number < 0 else 0.0
    near = _rounded(number)
    if near > number:
        near = _rounded(number - 10.0 ** (math.floor(math.log10(abs(number))) - 5))
    return max(near, -_LARGEST)


_SMALL = 1e-9
"""Numbers below it are zero in a contract."""

_LARGEST = 1e300


def _rounded(number: float) -> float:
    return float(f"{number:.6g}")


def contract_document(contract: Contract) -> Mapping[str, JsonValue]:
    """Return the document of a contract, without keys that have their defaults."""
    document: Mapping[str, JsonValue] = to_builtins(contract)
    return document
