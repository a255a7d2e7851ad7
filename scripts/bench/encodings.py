"""Cost of writing a message body in each encoding, compared with libraries that could do it instead.

cbor2 gets plain objects, and rosbags gets its own dataclasses. Both are made before the measurement, so their figures
are the lowest possible.

    ./.venv/bin/python scripts/bench/encodings.py [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import sys
import timeit
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import cbor2
import orjson
from rosbags.typesys import Stores, get_typestore

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.definitions import read_definitions
from scripts.bench import bodies
from scripts.bench.program import machine

BODIES = {
    "std_msgs/String": bodies.text(),
    "morai_msgs/CtrlCmd": bodies.control(),
    "morai_msgs/EgoVehicleStatus": bodies.ego(),
    "morai_msgs/ObjectStatusList": bodies.objects(20),
    "nav_msgs/Odometry": bodies.odometry(),
    "sensor_msgs/CompressedImage": bodies.image(),
}

REPEATS = 41
SECONDS = 0.02
"""Duration of a repeat [s]: long enough for the clock, short enough to fall between two bursts of other programs."""

_TEXTS = read_definitions("22.R2")
_STORES = Store(_TEXTS, leniency=LENIENCY), Store(_TEXTS, leniency=LENIENCY, ros=2)


def ways(name: str, body: bodies.Json) -> dict[str, Callable[[], object]]:
    """Return the encoders of a body; a library only if it knows the type.

    Args:
        name: of the type.
        body: as JSON values.

    Returns:
        Name of the encoding -> function that returns the bytes.
    """
    first, second = (store.message(name) for store in _STORES)
    value, value2 = first.check(body, 0), second.check(body, 0)
    raw = first.encode_raw(value)
    items = cbor2.loads(first.encode_cbor(value))
    found: dict[str, Callable[[], object]] = {
        "JSON": lambda: first.encode_json(value),
        "CBOR": lambda: first.encode_cbor(value),
        "ROS 1 bytes": lambda: first.encode_raw(value),
        "CDR": lambda: second.encode_raw(value2),
        "CBOR, cbor2": lambda: cbor2.dumps(items),
    }
    types = get_typestore(Stores.ROS1_NOETIC)
    full = name.replace("/", "/msg/")
    if full in types.types:
        theirs: Any = types.deserialize_ros1(raw, full)
        found["ROS 1 bytes, rosbags"] = lambda: types.serialize_ros1(theirs, full)
    return found


def _microseconds(way: Callable[[], object]) -> float:
    """Return the median of many short runs [us]."""
    num = max(1, int(SECONDS / timeit.timeit(way, number=10) * 10))
    return median(timeit.repeat(way, number=num, repeat=REPEATS)) / num * 1e6


def main() -> None:
    """Measure, print, write JSON if asked."""
    parser = argparse.ArgumentParser(description="Write message bodies in every encoding")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the figures here too")
    args = parser.parse_args()
    figures: dict[str, dict[str, float]] = {}
    print(machine())
    print(f"one message, median of {REPEATS} runs [us]")
    for name, body in BODIES.items():
        figures[name] = {way: _microseconds(run) for way, run in ways(name, body).items()}
        print(f"{name}, {len(orjson.dumps(body)):,} bytes of JSON")
        for way, value in figures[name].items():
            print(f"  {way:20} {value:8.2f}")
    if args.json:
        args.json.write_text(json.dumps({"machine": machine(), "microseconds": figures}, indent=1))


if __name__ == "__main__":
    main()
