"""A contract beside what was seen: a claim for each of its terms, with what was expected and what was seen."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice

from rosbridge_sim.contracts.contract import Contract, FieldTerms, TopicTerms
from rosbridge_sim.contracts.seen_system import SeenField, SeenSystem, SeenTopic
from rosbridge_sim.records import Record
from rosbridge_sim.schema.definitions.names import canonical_type
from rosbridge_sim.suggestions import hint

MIN_FOR_RATE = 3
"""Messages from which a rate is judged."""


class Claim(Record):
    """One term of a contract.

    Attributes:
        name: topic or service.
        term: `type`, `rate`, `messages`, or the path of a field.
        expected: in words.
        seen: in words.
        is_broken: what was seen is not what was expected.
    """

    name: str
    term: str
    expected: str
    seen: str
    is_broken: bool

    def __str__(self) -> str:
        """Return the claim in one line."""
        return f"{self.name}: {self.term}: expected {self.expected}, got {self.seen}"


def judge_contract(contract: Contract, seen: SeenSystem) -> list[Claim]:
    """Return the claims of a contract, topics first.

    Args:
        contract: the contract.
        seen: what was seen of its topics, and of all services.
    """
    claims = [claim for name, terms in contract.topics.items() for claim in _judge_topic(name, terms, seen)]
    return claims + [_judge_type(name, kind, seen.services, "service") for name, kind in contract.services.items()]


def _judge_type(name: str, kind: str, types: Mapping[str, str] | None, what: str) -> Claim:
    """Judge whether there is a topic or a service, and of which type."""
    expected = kind or f"a {what}"
    if types is None:
        return Claim(name, "type", expected, "no answer of rosapi, so types are not judged", is_broken=False)
    if name not in types:
        return Claim(name, "type", expected, f"no such {what}{hint(name, types)}", is_broken=True)
    is_other = bool(kind and types[name]) and canonical_type(kind) != canonical_type(types[name])
    return Claim(name, "type", expected, types[name] or "a type that rosapi does not tell", is_broken=is_other)


def _judge_topic(name: str, terms: TopicTerms, seen: SeenSystem) -> Iterator[Claim]:
    topic = seen.topics.get(name)
    claim = _judge_type(name, terms.type, seen.types, "topic")
    yield claim
    if claim.is_broken or (terms.rate is None and not terms.fields):
        return
    if topic is None or not topic.num:
        is_late = terms.rate is None or terms.rate * seen.seconds > 1
        yield Claim(name, "messages", "at least one", f"none within {seen.seconds:.3g} s", is_broken=is_late)
        return
    if terms.rate is not None:
        yield _judge_rate(name, terms.rate, terms.tolerance, topic, seen.seconds)
    for path, one in terms.fields.items():
        yield _judge_field(name, path, one, topic)


def _judge_rate(name: str, rate: float, tolerance: float, topic: SeenTopic, seconds: float) -> Claim:
    expected = f"{rate * (1 - tolerance):.4g} to {rate * (1 + tolerance):.4g} Hz"
    if topic.rate is None or topic.num < MIN_FOR_RATE:
        is_late = rate * (1 - tolerance) * seconds > MIN_FOR_RATE
        words = f"{topic.num} message{'s' * (topic.num > 1)} within {seconds:.3g} s"
        return Claim(name, "rate", expected, words, is_broken=is_late)
    is_other = abs(topic.rate - rate) > tolerance * rate
    return Claim(name, "rate", expected, f"{topic.rate:.4g} Hz", is_broken=is_other)


def _judge_field(name: str, path: str, terms: FieldTerms, topic: SeenTopic) -> Claim:
    seen = topic.fields.get(path)
    expected = _expected(terms)
    num_missing = topic.num_missing(path)
    if num_missing:
        near = hint(path, topic.fields) if seen is None else ""
        words = f"no such field in {num_missing} of {max(num_missing, topic.num)} messages{near}"
        return Claim(name, path, expected, words, is_broken=True)
    if seen is None:
        return Claim(name, path, expected, "no element, because the lists were empty", is_broken=False)
    return Claim(name, path, expected, _shown(seen), is_broken=not _fits(terms, seen))


def _expected(terms: FieldTerms) -> str:
    """Return the terms of a field in words."""
    if terms.has_range:
        return _span(terms.low, terms.high) + (", or NaN" if terms.nan else "")
    if terms.values is not None:
        return f"{'one of ' * (len(terms.values) > 1)}{_words(terms.values)}"
    if terms.has_length:
        return f"{_span(terms.min_length, terms.max_length)} elements"
    return "to be there"


def _span(low: float | None, high: float | None) -> str:
    if low is None or high is None:
        return f"at least {low:.6g}" if low is not None else f"at most {high:.6g}"
    return f"{low:.6g} to {high:.6g}" if low != high else f"{low:.6g}"


def _words(values: Iterable[str | bool]) -> str:
    shown = [json.dumps(value, ensure_ascii=False) for value in islice(values, MAX_SHOWN + 1)]
    return ", ".join([*shown[:MAX_SHOWN], "..."] if len(shown) > MAX_SHOWN else shown)


MAX_SHOWN = 8
"""Texts of a field that a claim shows."""


def _fits(terms: FieldTerms, seen: SeenField) -> bool:
    """Return whether all values of a field are as the terms say."""
    if terms.has_range:
        low, high = -math.inf if terms.low is None else terms.low, math.inf if terms.high is None else terms.high
        is_within = not seen.is_number or low <= seen.low <= seen.high <= high
        return is_within and (terms.nan or not seen.num_not_finite) and seen.kinds <= {"number"}
    if terms.values is not None:
        return not seen.is_open and seen.words.keys() <= set(terms.values) and seen.kinds <= {"text", "flag"}
    if terms.has_length:
        most = math.inf if terms.max_length is None else terms.max_length
        return (terms.min_length or 0) <= seen.shortest and seen.longest <= most and seen.kinds == {"list"}
    return True


def _shown(seen: SeenField) -> str:
    """Return the values of a field in words."""
    parts = []
    if "number" in seen.kinds:
        nan = [f"{seen.num_not_finite} times NaN"] if seen.num_not_finite else []
        parts += [_span(seen.low, seen.high)] * seen.is_number + nan
    if seen.words or seen.is_open:
        parts.append(_words(seen.words) + (", and others" if seen.words else "long texts") * seen.is_open)
    if "list" in seen.kinds:
        parts.append(f"lists of {_span(seen.shortest, seen.longest)} elements")
    return ", ".join([*parts, *["a message"] * ("message" in seen.kinds)])
