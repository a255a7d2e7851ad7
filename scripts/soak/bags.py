"""Recordings that a client has replayed: for the attacks of `hostile.py`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.bags.bag import open_bag
from rosbridge_sim.shell.bags.message_writer import BagMessageWriter
from rosbridge_sim.shell.files.definitions import read_definitions

FRAME_NS: Final = 20_000_000
NUM_FRAMES: Final = 100

LONG: Final = ("markers", "path", "cloud")
"""Names of topics below `/plan` with messages nearly as long as may be."""


def put_topics(path: Path) -> None:
    """Write a bag with 5,000 topics that viewers draw.

    Args:
        path: of the bag; one that is there stays.
    """
    _write(path, ((f"/plan/{i}", "nav_msgs/Path", {"poses": [{}]}) for i in range(5_000)), 1)


def put_messages(path: Path) -> None:
    """Write a bag with long messages in each fifth frame.

    Args:
        path: of the bag; one that is there stays.
    """
    point = {"x": 1.0, "y": 2.0, "z": 3.0}
    marks = {"markers": [{"ns": "candidates", "id": i, "points": [point] * 10} for i in range(3_500)]}
    poses = {"poses": [{"pose": {"position": point}}] * 15_000}
    topics = (
        ("/plan/markers", "visualization_msgs/MarkerArray", marks),
        ("/plan/path", "nav_msgs/Path", poses),
        ("/plan/cloud", "sensor_msgs/PointCloud2", {"data": "A" * 10_000_000}),
    )
    _write(path, topics, 5)


def _write(path: Path, topics: Iterable[tuple[str, str, dict[str, Any]]], num: int) -> None:
    """Write a drive of two seconds, and `num` times the message of each topic."""
    if path.exists():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    store = Store(read_definitions("22.R2"), leniency=LENIENCY)
    writer = BagMessageWriter(open_bag(path), store)
    ego = store.message("morai_msgs/EgoVehicleStatus")
    writer.add("/Ego_topic", ego.name)
    for i in range(1, NUM_FRAMES + 1):
        value = ego.check({"position": {"x": 0.1 * i}}, i * FRAME_NS)
        writer.write("/Ego_topic", Message(ego, value), i * FRAME_NS)
    for topic, type_name, fields in topics:
        message_type = store.message(type_name)
        message = Message(message_type, message_type.check(fields, 0))
        writer.add(topic, type_name)
        for i in range(num):
            writer.write(topic, message, (5 * i + 1) * FRAME_NS)
    writer.close()
