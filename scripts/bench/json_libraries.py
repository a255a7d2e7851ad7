"""Comparison of JSON libraries that read and write message bodies, for the choice of one.

Each candidate takes the text of a body and returns the text for the subscribers. msgspec uses our compiled types, with
all rules: unknown fields are refused, missing ones filled, ranges checked, float32 rounded. orjson and the
standard library check nothing.

    ./.venv/bin/python scripts/bench/json_libraries.py [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import sys
import timeit
from collections.abc import Callable
from pathlib import Path
from statistics import median

import orjson

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.definitions import read_definitions
from scripts.bench import bodies
from scripts.bench.program import machine

BODIES = {
    "morai_msgs/CtrlCmd": bodies.control(),
    "morai_msgs/EgoVehicleStatus": bodies.ego(),
    "morai_msgs/ObjectStatusList": bodies.objects(20),
}

REPEATS = 41
SECONDS = 0.02
"""Duration of a repeat [s]: long enough for the clock, short enough to fall between two bursts of other programs."""

_store = Store(read_definitions("22.R2"), leniency=LENIENCY)


def ways(name: str, text: bytes) -> dict[str, Callable[[], object]]:
    """Return the candidates.

    Args:
        name: of the type.
        text: of a body.

    Returns:
        Name of the library -> function that returns the new text.
    """
    message_type: MessageType = _store.message(name)
    return {
        "msgspec, our types": lambda: message_type.encode_json(message_type.decode_json(text, 0)),
        "orjson, unchecked": lambda: orjson.dumps(orjson.loads(text)),
        "json, unchecked": lambda: json.dumps(json.loads(text)).encode(),
    }


def _microseconds(way: Callable[[], object]) -> float:
    """Return the median of many short runs [us]."""
    num = max(1, int(SECONDS / timeit.timeit(way, number=10) * 10))
    return median(timeit.repeat(way, number=num, repeat=REPEATS)) / num * 1e6


def main() -> None:
    """Measure, print, write JSON if asked."""
    parser = argparse.ArgumentParser(description="Read and write message bodies with several JSON libraries")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the figures here too")
    args = parser.parse_args()
    figures: dict[str, dict[str, float]] = {}
    print(machine())
    print(f"decode and encode, median of {REPEATS} runs [us]")
    for name, body in BODIES.items():
        text = orjson.dumps(body)
        for way, run in ways(name, text).items():
            assert orjson.loads(run()) == body, f"{way} changed a {name}"  # type: ignore[arg-type] # bytes
        figures[name] = {way: _microseconds(run) for way, run in ways(name, text).items()}
        print(f"{name}, {len(text):,} bytes")
        for way, value in figures[name].items():
            print(f"  {way:20} {value:8.2f}")
    if args.json:
        args.json.write_text(json.dumps({"machine": machine(), "microseconds": figures}, indent=1))


if __name__ == "__main__":
    main()
