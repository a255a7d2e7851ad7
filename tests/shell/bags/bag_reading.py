"""Helper for tests of bags: read a bag back with the library's reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader

__all__ = ["Seen", "read_bag"]

Seen = list[tuple[str, int, Any]]
"""(topic, stamp [ns], message), in the bag's order; Any: a class that the reader makes from the bag's definitions."""


def read_bag(path: Path) -> Seen:
    """Everything in a bag of any format."""
    with AnyReader([path]) as reader:
        return [(c.topic, stamp_ns, reader.deserialize(raw, c.msgtype)) for c, stamp_ns, raw in reader.messages()]
