"""Mutations of valid documents, for tests of decoders.

An edit is a few plain numbers that hypothesis draws and shrinks; `spoil` and `damage` apply edits to a document that is
known to be good. `examples` says how many of them a test tries: few in the quick run, more with `--long`, and most by
`scripts/soak/fuzz.py`.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from rosbridge_sim.loose_types import JsonValue

__all__ = ["ODD", "Edit", "Flip", "damage", "edits", "examples", "flips", "spoil"]

FACTOR = int(os.environ.get("FUZZ_FACTOR", "0"))
"""How many times as many examples as tests say; 0: as many with `--long`, and an eighth of them otherwise."""

ODD: tuple[Any, ...] = (
    *(None, True, False, 0, 1, -1, 2**31, 2**32 - 1, 2**63, 2**64, -(2**63) - 1, 10**30, 0.5, -0.0, 1e-320),
    *(1e9, 1e30, 1e308, -1e308, float("nan"), float("inf"), -float("inf")),
    *("", " ", "x", "\x00", "\n", "nan", "1e400", "9" * 5_000, "x" * 5_000, "\u00fc", "-1", "1,000", "True", "../x"),
    *([], [None], [[]], {}, {"x": 1}, [0.0, 0.0, 0.0], [0] * 200),
)
"""Values that fit nowhere, or everywhere but for their size."""


def examples(num: int, *, quick: int | None = None) -> settings:
    """Settings of a test that tries so many documents with `--long`, or a multiple of that; else `quick`, an eighth."""
    is_quick = not FACTOR and settings.get_current_profile_name() != "long"
    tried = (quick or max(num // 8, 5)) if is_quick else num * max(FACTOR, 1)
    return settings(max_examples=tried, deadline=None, suppress_health_check=list(HealthCheck))


@dataclass(frozen=True)
class Edit:
    """One change of a JSON document: where, how, and the odd value that comes in."""

    where: int
    how: int
    value: Any


@dataclass(frozen=True)
class Flip:
    """One change of bytes: where [a share of the length], how, and the bytes that come in."""

    where: float
    how: int
    data: bytes


def edits(max_size: int = 4) -> st.SearchStrategy[list[Edit]]:
    """A few changes of a JSON document."""
    one = st.builds(Edit, st.integers(0, 2**20), st.integers(0, 6), st.sampled_from(ODD))
    return st.lists(one, min_size=1, max_size=max_size)


def flips(max_size: int = 4) -> st.SearchStrategy[list[Flip]]:
    """A few changes of bytes."""
    data = st.binary(min_size=1, max_size=8) | st.sampled_from([b"\xff" * 4, b"\xff" * 8, b"\0" * 8, b"\x7f", b"\x80"])
    one = st.builds(Flip, st.floats(0, 1, exclude_max=True), st.integers(0, 9), data)
    return st.lists(one, min_size=1, max_size=max_size)


def spoil(document: JsonValue, changes: list[Edit]) -> JsonValue:
    """A copy of the document with these changes: values lost, doubled, replaced, exchanged, buried."""
    document = copy.deepcopy(document)
    for change in changes:
        places = list(_places(document))
        if not places:
            return document
        holder, key = places[change.where % len(places)]
        value = holder[key]
        if change.how == 0:
            del holder[key]
        elif change.how == 1 and isinstance(holder, list):
            holder.insert(key, copy.deepcopy(value))
        elif change.how == 2:  # as MORAI writes many numbers
            holder[key] = str(value)
        elif change.how == 3:
            other, name = places[(change.where * 7919) % len(places)]
            holder[key] = copy.deepcopy(other[name])
        elif change.how == 4:
            holder[key] = [value] if change.where % 2 else {"x": value}
        elif change.how == 5 and isinstance(value, (int, float)) and not isinstance(value, bool):
            holder[key] = -value if change.where % 2 else value * 1e6
        else:
            holder[key] = copy.deepcopy(change.value)
    return document


def _places(value: JsonValue) -> Iterator[tuple[Any, Any]]:
    """Each value within a document: what holds it, and its key there."""
    entries = list(value.items()) if isinstance(value, dict) else list(enumerate(value))
    for key, inner in entries:
        yield value, key
        if isinstance(inner, (dict, list)):
            yield from _places(inner)


def damage(data: bytes, changes: list[Flip]) -> bytes:
    """The bytes with these changes: some overwritten, added or lost, some moved; mostly overwritten."""
    bent = bytearray(data)
    for change in changes:
        at = int(change.where * len(bent))
        if change.how == 0:
            bent[at:at] = change.data
        elif change.how == 1:
            del bent[at : at + len(change.data)]
        elif change.how == 2:
            del bent[at:]
        elif change.how == 3:
            bent[at:at] = bent[: len(change.data) * 10]
        else:
            bent[at : at + len(change.data)] = change.data
    return bytes(bent)
