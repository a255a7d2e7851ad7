"""`bag info`: duration, size and topics of a bag."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from rosbridge_sim.cli.tools.text import put, put_json
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.shell.bags.bag_reader import open_reader


def show_bag(file: str, *, is_json: bool) -> None:
    """Print duration, size and topics of a bag, in the form of `ros2 bag info`.

    Raises:
        DocumentError: it is not a bag, or has no index.
    """
    path = Path(file)
    is_ros1 = path.suffix == ".bag"
    with open_reader(path) as bag:
        counts: dict[tuple[str, str], int] = {}
        for one in bag.connections:
            key = one.topic, one.msgtype.replace("/msg/", "/") if is_ros1 else one.msgtype
            counts[key] = counts.get(key, 0) + one.msgcount
        num_messages = bag.message_count
        start, end = (bag.start_time, bag.end_time) if num_messages else (0, 0)
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    size = sum(file.stat().st_size for file in files)
    topics = sorted(counts.items())
    if is_json:
        put_json(
            {
                "file": file,
                "size": size,
                "start": start / 1e9,
                "end": end / 1e9,
                "messages": num_messages,
                "topics": [{"topic": topic, "type": kind, "count": count} for (topic, kind), count in topics],
            }
        )
        return
    rows = {
        "Files": ", ".join(file.name for file in files if file.suffix != ".yaml"),
        "Bag size": f"{size / 1e3:,.1f} kB",
        "Duration": f"{(end - start) / 1e9:.3f} s",
        "Start": _moment(start),
        "End": _moment(end),
        "Messages": str(num_messages),
    }
    for title, text in rows.items():
        put(f"{f'{title}:':19}{safe(text)}")
    title = "Topic information: "
    for (topic, kind), count in topics:
        put(f"{title:19}Topic: {safe(topic)} | Type: {safe(kind)} | Count: {count}")
        title = ""


def _moment(stamp_ns: int) -> str:
    """Return a time of a bag in words; one of simulated time is in 1970."""
    return f"{datetime.fromtimestamp(stamp_ns // 10**9, UTC):%b %d %Y %H:%M:%S} UTC ({stamp_ns / 1e9:.3f})"
