"""Estimates of the memory of values: close, and never far too low."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
import orjson
import pytest

from rosbridge_sim.schema.sizes import size_of
from tests.graph.bus_fixture import make_store

STORE = make_store()
LAST = "x" * 1_000_000


def real_size(make: Callable[[], Any]) -> int:
    """What making a value takes."""
    tracemalloc.start()
    value = make()
    size, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert value is not None
    return size


@pytest.mark.parametrize(
    ("name", "body"),
    [
        ("std_msgs/String", {"data": "x" * 100_000}),
        ("std_msgs/String", {"data": "é한" * 50_000}),
        ("std_msgs/Float64MultiArray", {"data": [0.5 + i for i in range(10_000)]}),
        ("std_msgs/Int32MultiArray", {"data": [1_000 + i for i in range(10_000)]}),
        ("nav_msgs/OccupancyGrid", {"data": [0, 100, -1] * 10_000}),
        ("visualization_msgs/MarkerArray", {"markers": [{}] * 500}),
        ("tf2_msgs/TFMessage", {"transforms": [{"child_frame_id": f"frame {i}"} for i in range(1_000)]}),
        ("sensor_msgs/Image", {"data": "AAAA" * 30_000}),
        ("my_package/Unknown", {"a": ["text"] * 3_000, "b": {f"key {i}": [i] for i in range(1_000)}}),
    ],
)
def test_an_estimate_is_near_what_python_takes(name: str, body: dict[str, Any]) -> None:
    text = orjson.dumps(body)
    if name.startswith("my_package"):
        value, real = body, real_size(lambda: orjson.loads(text))
    else:
        message_type = STORE.message(name)
        message_type.decode_json(text, 0)
        value = message_type.decode_json(text, 0)
        real = real_size(lambda: message_type.decode_json(text, 0))
    assert 0.5 < size_of(value, len(text)) / real < 4.0


def test_estimate_covers_at_least_half_the_text_of_unequal_elements() -> None:
    names = [""] * 1_000
    names[17] = LAST
    assert size_of({"names": names}, 1_003_000) >= 2_000_000


def test_arrays_and_bytes_count_by_their_bytes() -> None:
    assert 8_000_000 <= size_of(np.zeros(1_000_000)) <= 8_000_200
    assert 1_000_000 <= size_of({"data": bytes(1_000_000)}) <= 1_000_500


def test_depth_of_nesting_is_bounded() -> None:
    value: list[Any] = []
    for _ in range(100_000):
        value = [value]
    assert size_of(value) < 100_000
