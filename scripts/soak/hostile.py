#!/usr/bin/env python3
"""Single hostile frames: the wait that they cause for an innocent client, and the CPU time and memory that they cost.

    python scripts/soak/hostile.py [--rows PATTERN]... [--runs 3] [--repeats 20]

Each row is an attack on a new server. A bystander in its own process measures its round trips before (idle) and during
the attack. Then the attack is repeated, and the memory is measured again. The exit code is 1 if a bound fails:

    the loop's longest pass         at most 50 ms of CPU time of its thread between two heartbeats (2 ms apart). Trust
                                    it on a busy machine, because the wait includes the work of other processes
    the bystander's longest wait    at most the idle one and 50 ms (150 ms more for an honest message of 16 MB)
    memory at its peak              at most that of the idle server and 7 times the largest frame
    memory ten seconds later        at most that of the idle server and 1.5 times the largest frame; after repeats, too
    the server's log                no traceback
"""

from __future__ import annotations

import argparse
import asyncio
import base64
import random
import sys
import tempfile
import zlib
from collections.abc import AsyncIterator, Callable, Iterable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import cbor2
import orjson
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from scripts.soak import bags, crowds
from scripts.soak.harness import Bystander, GoneError, SoakError, WatchedServer
from scripts.soak.soak_client import masked, open_raw

MB = 2**20
LARGEST = 16 * MB
"""The server's default limit for a frame."""

PAUSE_MS, HONEST_MS = 50.0, 150.0
"""Longest wait of the bystander above idle; and the addition for an honest message of 16 MB [ms].
A frame of the world is 20 ms, and a loss of two does no harm."""

MAX_PASS_MS = 50.0
"""Longest pass of the server's loop [ms of CPU time]; for all messages, also honest ones: others have their turn."""

PEAK, SETTLED = 7.0, 1.5
"""Memory above idle, in sizes of the largest frame: a frame, its text, its values and three encodings; then what an
allocator keeps."""

NOISE_MB = 8.0
"""Memory growth of a server in its first minute without any attack [MB]: caches, compiled types."""

SETTLING = 10.0
"""Time between an attack and the next measurement of memory [s]."""

DONE = b'"id":"the last one"'
PATIENCE = 300.0


class Attacker:
    """A connection that sends frames and ignores all answers."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writer = writer
        self._heard = asyncio.Event()
        self._reading = asyncio.get_running_loop().create_task(self._read(reader))

    @classmethod
    async def open(cls, port: int) -> Attacker:
        """Connect.

        Args:
            port: of the server.

        Returns:
            The connection.
        """
        return cls(*await open_raw(port))

    async def send(self, *frames: bytes) -> None:
        """Send whole WebSocket frames."""
        for frame in frames:
            self._writer.write(frame)
        with suppress(ConnectionError):
            await self._writer.drain()

    async def say(self, **op: object) -> None:
        """Send an op.

        Args:
            op: its fields.
        """
        await self.send(masked(orjson.dumps(op)))

    async def settle(self) -> None:
        """Wait until the server has handled everything, or has closed the connection."""
        self._heard.clear()
        await self.send(masked(b'{"op":"call_service","service":"/rosapi/get_time",' + DONE + b"}"))
        async with asyncio.timeout(PATIENCE):
            await self._heard.wait()

    async def close(self) -> None:
        """Close the connection."""
        self._writer.transport.abort()
        await self._reading

    async def _read(self, reader: asyncio.StreamReader) -> None:
        tail = b""
        with suppress(ConnectionError):
            while data := await reader.read(MB):
                tail += data
                if DONE in tail:
                    self._heard.set()
                tail = tail[-len(DONE) :]
        self._heard.set()


class CompressingAttacker(Attacker):
    """An attacker with compressed frames: it sends texts, and the library compresses them."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self._heard = asyncio.Event()
        self._reading = asyncio.get_running_loop().create_task(self._listen())

    @classmethod
    async def open(cls, port: int) -> CompressingAttacker:
        """Connect, with permessage-deflate.

        Args:
            port: of the server.

        Returns:
            The connection.
        """
        return cls(await connect(f"ws://127.0.0.1:{port}", max_size=None, ping_interval=None, proxy=None))

    async def send(self, *frames: bytes) -> None:
        """Send the texts of WebSocket frames."""
        for frame in frames:
            with suppress(ConnectionClosed):
                await self._connection.send(unmasked(frame), text=True)

    async def close(self) -> None:
        """Close the connection."""
        self._connection.transport.abort()
        await self._reading

    async def _listen(self) -> None:
        with suppress(ConnectionClosed):
            async for data in self._connection:
                if DONE in (data.encode() if isinstance(data, str) else data):
                    self._heard.set()
        self._heard.set()


def unmasked(frame: bytes) -> bytes:
    """Return the payload of a frame that `masked` has made.

    Returns:
        The payload.
    """
    size = frame[1] & 0x7F
    return frame[2 + {126: 2, 127: 8}.get(size, 0) + 4 :]


@dataclass(slots=True)
class Row:
    """One attack.

    Attributes:
        name: for the table.
        frames: the attacker's whole WebSocket frames; made before the clock starts.
        before, listeners: ops that are sent first: by the attacker, and by a listener each.
        flags: of the server.
        is_compressing: messages of the attacker and of the listeners are compressed.
        allowed_ms: longest wait of the bystander above idle.
        kept_mb: memory that the server keeps for good reason [MB].
        fill: puts files into the server's data folder before it starts.
    """

    name: str
    frames: Callable[[], Sequence[bytes]]
    before: Sequence[dict[str, Any]] = ()
    listeners: Sequence[dict[str, Any]] = ()
    flags: tuple[str, ...] = ()
    is_compressing: bool = False
    allowed_ms: float = PAUSE_MS
    kept_mb: float = 0.0
    fill: Callable[[Path], None] = lambda _folder: None


def glued(op: bytes, size: int = LARGEST) -> bytes:
    """Return as many copies of an op as fit into a frame.

    Args:
        op: JSON text.
        size: of the frame [bytes].

    Returns:
        The payload.
    """
    return op * (size // len(op))


def op(**fields: object) -> bytes:
    """Return the JSON text of an op.

    Args:
        fields: of the op.
    """
    frame: bytes = orjson.dumps(fields)
    return frame


def png(text: bytes) -> bytes:
    """Return a png op whose picture holds a text, as small as possible.

    Returns:
        JSON text of the op.
    """
    width = 2048
    height = -(-len(text) // (3 * width))
    lines = text.ljust(3 * width * height, b"\n")
    rows = b"".join(b"\0" + lines[i : i + 3 * width] for i in range(0, len(lines), 3 * width))
    parts = (
        (b"IHDR", width.to_bytes(4, "big") + height.to_bytes(4, "big") + b"\x08\2\0\0\0"),
        (b"IDAT", zlib.compress(rows, 9)),
        (b"IEND", b""),
    )
    file = b"\x89PNG\r\n\x1a\n" + b"".join(
        len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big") for kind, data in parts
    )
    return b'{"op":"png","data":"' + base64.b64encode(file) + b'"}'


def list_of(topic: str, message_type: str, name: str) -> bytes:
    """Return a publish of five million empty elements.

    Args:
        message_type: its type.
        name: of the list's field.

    Returns:
        JSON text of the op.
    """
    head = b'{"op":"publish","topic":"' + topic.encode() + b'","type":"' + message_type.encode() + b'","msg":{"'
    return head + name.encode() + b'":[' + b"{}," * 5_000_000 + b"{}]}}"


def cbor_floats() -> bytes:
    """Return two million float64 for an unknown type.

    Returns:
        A frame.
    """
    msg = {"data": cbor2.CBORTag(86, bytes(16 * 10**6 - 1_000))}
    return masked(cbor2.dumps({"op": "publish", "topic": "/mine", "type": "mine/Mine", "msg": msg}), 0x82)


ZZZ = b'{"op":"zzz"}'
TIME = b'{"op":"call_service","service":"/rosapi/get_time"}'
SENSOR_LISTENERS = [
    {"op": "subscribe", "topic": "/image_jpeg/compressed", "type": "sensor_msgs/CompressedImage"},
    {"op": "subscribe", "topic": "/velodyne_points", "type": "sensor_msgs/PointCloud2"},
]
LARGE_SENSORS = orjson.dumps(
    {
        "camera": [{"topic": "/large", "encoding": "raw", "width": 2000, "height": 600, "rate": 50}],
        "lidar3d": [{"frame_id": "many", "topic": "/many", "model": "OS1-128", "columns": 2_600, "rate": 50}],
    }
).decode()
"""As many bytes of a frame as an ego may have: 3.6 MB of pixels, 7.3 MB of points, and the lidar of the preset."""
STRING = {"op": "advertise", "topic": "/s", "type": "std_msgs/String"}
LISTEN = {"op": "subscribe", "topic": "/s", "type": "std_msgs/String"}


def string() -> bytes:
    """Return a String nearly as long as a frame may be.

    Returns:
        JSON text of the op.
    """
    return masked(op(op="publish", topic="/s", msg={"data": "x" * (LARGEST - 1_000)}))


def image() -> bytes:
    """Return a camera picture of 16 MB, as an honest client sends it.

    Returns:
        A frame.
    """
    data = base64.b64encode(bytes(range(256)) * (12 * MB // 256 - 100)).decode()
    fields = {"height": 2_000, "width": 2_000, "encoding": "rgb8", "step": 6_000, "data": data}
    return masked(op(op="publish", topic="/s", type="sensor_msgs/Image", msg=fields))


def calls(service: str, num: int, args: dict[str, Any] | None = None) -> bytes:
    """Return calls of a service, glued into one frame.

    Args:
        num: number of calls.
        args: of each call.

    Returns:
        A frame.
    """
    return masked(op(op="call_service", service=service, args=args or {}) * num)


def radars(egos: Iterable[int]) -> list[bytes]:
    """Return frames that give egos as many radars as they may have, hear all of them, and ask for five ticks.

    Args:
        egos: their numbers.

    Returns:
        The frames.
    """
    wide = {"near_range": 1_000, "far_range": 1_000, "near_fov": 170, "far_fov": 170, "vertical_fov": 90, "rate": 50}
    add = op(radar=[{"frame_id": f"r{i}", "topic": f"/r{i}", "yaw": 11 * i, **wide} for i in range(32)]).decode()
    heard = b"".join(op(op="subscribe", topic=f"/Ego-{ego}/r{i}") for ego in egos for i in range(32))
    frames = [calls("/sim/sensors", 1, {"ego": ego, "add": add}) for ego in egos]
    return [*frames, masked(heard), calls("/SyncModeWaitForTick", 5, {"request": {"user_id": "m"}})]


def replay(name: str) -> bytes:
    """Return a call that replays a recording.

    Args:
        name: of the recording.

    Returns:
        A frame.
    """
    fields = {"sim_process_status": 1, "replay_option": 1, "rosbag_file_name": name}
    return calls("/Morai_SimProc", 1, {"request": fields})


def parameters() -> list[bytes]:
    """Return frames that set a hundred thousand parameters, a thousand each, and a call about all of them.

    Returns:
        The frames.
    """
    frames = []
    for i in range(100):
        ops = [
            {"op": "call_service", "service": "/rosapi/set_param", "args": {"name": f"/a{i}/b{j}", "value": "1"}}
            for j in range(1_000)
        ]
        frames.append(masked(b"".join(map(orjson.dumps, ops))))
    return frames


def floats(number: bytes) -> bytes:
    """Return a list of 16 MB that repeats one number.

    Args:
        number: JSON text.

    Returns:
        A frame.
    """
    head = b'{"op":"publish","topic":"/f","type":"std_msgs/Float64MultiArray","msg":{"data":['
    return masked(head + (number + b",") * ((LARGEST - 1_000) // (len(number) + 1)) + b"1]}}")


def numbers(number: bytes, num: int) -> bytes:
    """Return a list that repeats one number.

    Args:
        number: JSON text.
        num: how often.

    Returns:
        A frame.
    """
    head = b'{"op":"publish","topic":"/f","type":"std_msgs/Float64MultiArray","msg":{"data":['
    return masked(head + (number + b",") * (num - 1) + number + b"]}}")


def noise() -> bytes:
    """Return a String of 14 MB that hardly compresses.

    Returns:
        A frame.
    """
    text = base64.b64encode(random.Random(0).randbytes(10 * MB)).decode()  # noqa: S311 - the same each time
    return masked(op(op="publish", topic="/s", msg={"data": text}))


def pieces() -> bytes:
    """Return fragments of 64 messages that are never complete.

    Returns:
        A frame.
    """
    parts = (op(op="fragment", id=f"f{i % 64}", num=i // 64, total=9_999, data="x" * 200) for i in range(9_999))
    return masked(b"".join(parts))


def many_topics() -> bytes:
    """Return advertisements of as many topics as one client may have, of a type with a long definition.

    Returns:
        A frame.
    """
    kind = "visualization_msgs/MarkerArray"
    return masked(b"".join(op(op="advertise", topic=f"/many/{i}", type=kind) for i in range(9_900)))


SAVE = {"request": {"is_custom_file_name": False, "custom_file_name": "", "file_dir": ""}}
ROWS: tuple[Row, ...] = (
    Row("16 MB of glued unknown ops", lambda: [masked(glued(ZZZ))]),
    Row("16 MB of glued calls", lambda: [masked(glued(TIME))]),
    Row("10,000 glued calls", lambda: [masked(TIME * 10_000)]),
    Row("png of 16 MB of glued ops", lambda: [masked(png(glued(ZZZ)))]),
    Row(
        "permessage-deflate of 16 MB of glued ops",
        lambda: [masked(glued(ZZZ))],
        flags=("--compression",),
        is_compressing=True,
    ),
    Row("130,000 pings behind 10,000 glued calls", lambda: [masked(TIME * 10_000), masked(b"", 0x89) * 130_000]),
    Row("4.4 M plain numbers as Float64MultiArray", lambda: [numbers(b"1", 4_400_000)]),
    Row("300,000 NaN", lambda: [numbers(b"NaN", 300_000)]),
    Row("500,000 integers of 30 digits", lambda: [numbers(b"1" * 30, 500_000)]),
    Row(
        "4.4 M values by position",
        lambda: [
            masked(b'{"op":"call_service","service":"/rosapi/topic_type","args":[' + b"1," * 4_400_000 + b'{"a":1}]}')
        ],
    ),
    Row("10,000 glued captures", lambda: [calls("/SaveSensorData", 10_000, SAVE)]),
    Row("2,000 glued resets", lambda: [calls("/sim/reset", 2_000)]),
    Row("CBOR: 16 M empty lists", lambda: [masked(b"\xa1\x61a\x9a\x00\xf4\x24\x00" + b"\x80" * 16_000_000, 0x82)]),
    Row("CBOR: 2 M float64 of an unknown type", lambda: [cbor_floats()]),
    Row(
        "16 MB String to a listener with fragment_size 10",
        lambda: [string()],
        before=[STRING],
        listeners=[{**LISTEN, "fragment_size": 10}],
    ),
    Row("NpcGhostCmd of 5 M {}", lambda: [masked(list_of("/NpcGhost_Topic", "morai_msgs/NpcGhostCmd", "npc_list"))]),
    Row("ReplayInfo of 5 M {}", lambda: [masked(list_of("/ReplayInfo_topic", "morai_msgs/ReplayInfo", "npc_list"))]),
    Row("TFMessage of 5 M {}", lambda: [masked(list_of("/tf", "tf2_msgs/TFMessage", "transforms"))]),
    Row(
        "has_param after 100,000 set_param",
        lambda: [*parameters(), calls("/rosapi/has_param", 1, {"name": "/"})],
        kept_mb=30.0,  # 50,000 parameters of one client
    ),
    Row(
        "9,990 subscription ids on one topic",
        lambda: [masked(b"".join(op(**LISTEN, id=f"i{i}", throttle_rate=i) for i in range(9_990)))],
        before=[STRING],
    ),
    Row(
        "9,990 advertisements of one topic, and back",
        lambda: [
            masked(b"".join(op(**STRING, id=f"i{i}") for i in range(9_980))),
            masked(b"".join(op(op="unadvertise", topic="/s", id=f"i{i}") for i in range(9_980))),
        ],
    ),
    Row(
        "8 M ints as UInt8MultiArray",
        lambda: [
            masked(
                b'{"op":"publish","topic":"/u","type":"std_msgs/UInt8MultiArray","msg":{"data":['
                + b"1," * 7_999_900
                + b"1]}}"
            )
        ],
    ),
    Row(
        "16 MB String to 5 png listeners",
        lambda: [string()],
        before=[STRING],
        listeners=[{**LISTEN, "compression": "png"}] * 5,
    ),
    Row(
        "2 MB String to 200 listeners",
        lambda: [masked(op(op="publish", topic="/s", msg={"data": "x" * 2 * MB}))],
        before=[STRING],
        listeners=[LISTEN] * 200,
    ),
    Row("16 MB of 1e308", lambda: [floats(b"1e308")]),
    Row("16 MB of integers of 4,000 digits", lambda: [floats(b"1" * 4_000)]),
    Row("9,999 glued pieces, eight times", lambda: [pieces()] * 8),
    Row(
        "MarkerArray of 149,990 {} to a listener of each kind",
        lambda: [
            masked(
                b'{"op":"publish","topic":"/m","type":"visualization_msgs/MarkerArray","msg":{"markers":['
                + b"{}," * 149_989
                + b"{}]}}"
            )
        ],
        before=[{"op": "advertise", "topic": "/m", "type": "visualization_msgs/MarkerArray"}],
        listeners=[
            {"op": "subscribe", "topic": "/m", "compression": kind} for kind in ("none", "cbor", "cbor-raw", "png")
        ],
        kept_mb=8.0,  # 150,000 elements are counted before they are refused, at 56 bytes each
    ),
    Row(
        "16 MB String in pieces to 20 listeners",
        lambda: [string()],
        before=[STRING],
        listeners=[{**LISTEN, "fragment_size": 100_000}] * 20,
    ),
    Row(
        "14 MB of noise to 3 compressing listeners",
        lambda: [noise()],
        before=[STRING],
        listeners=[LISTEN] * 3,
        flags=("--compression",),
        is_compressing=True,
    ),
    Row(
        "definitions of 9,900 topics, three times",
        lambda: [many_topics(), calls("/rosapi/topics_and_raw_types", 3)],
        kept_mb=10.0 * 8.0,  # an answer has `rosapi.MAX_RAW_CHARS`; three are held as values, text and frame
    ),
    Row("19,000 ghosts in one place", lambda: [masked(op(**crowds.ghosts(19_000)))], kept_mb=80.0),  # the vehicles
    Row("first load of rush_hour", lambda: crowds.loads("rush_hour"), kept_mb=30.0),  # a map
    Row("forty loads of five scenarios", crowds.load_flood, kept_mb=55.0),  # five maps: 36 to 57 MB
    Row(
        "forty loads of five scenarios with --traffic 300",
        crowds.load_flood,
        flags=("--traffic", "300"),
        kept_mb=55.0,  # the same; more of them is read at once on a busy machine
    ),
    Row("30 egos in one spawn", lambda: crowds.egos(30), kept_mb=10.0),  # their topics
    Row("8,000 pedestrians", lambda: crowds.people(8_000), kept_mb=40.0),  # repeats fill the world: 20,000, 2 kB each
    Row(
        "snapshot of 8,000 cars, and back",
        crowds.snapshots,
        before=[crowds.ghosts(8_000, 12.0)],
        kept_mb=100.0,  # one snapshot is kept; its bytes are held as 12 MB, as text and frame of 15 MB each
    ),
    Row(
        "20 glued ticks of 50 frames, and three listeners",
        lambda: [calls("/SyncModeWaitForTick", 20, {"request": {"user_id": "m"}})],
        before=[
            {
                "op": "call_service",
                "service": "/SyncModeCmd",
                "args": {"request": {"user_id": "m", "start_sync_mode": True, "time_step": 1_000}},
            }
        ],
        listeners=[{"op": "subscribe", "topic": topic} for topic in ("/Object_topic", "/Ego_topic", "/tf")],
        flags=("--scenario", "town"),
    ),
    Row(
        "the largest camera and the largest lidar, both heard",
        lambda: [calls("/sim/sensors", 1, {"add": LARGE_SENSORS})],
        listeners=[
            {"op": "subscribe", "topic": "/large", "type": "sensor_msgs/Image"},
            {"op": "subscribe", "topic": "/many", "type": "sensor_msgs/PointCloud2"},
        ],
        flags=("--sensors", "lidar"),
        kept_mb=40.0,  # a message of 12 MB as bytes, base64 and frame
    ),
    Row(
        "2,000 glued moves of sensors that are heard",
        lambda: [calls("/sim/sensors", 2_000, {"move": ['{"frame_id": "velodyne", "z": 1.5}']})],
        listeners=SENSOR_LISTENERS,
        flags=("--sensors", "teaching"),
    ),
    Row(
        "five ticks of 20 egos with a camera and a lidar, all heard",
        lambda: [calls("/SyncModeWaitForTick", 5, {"request": {"user_id": "m"}})],
        before=[
            crowds.egos_at_once(20),
            {
                "op": "call_service",
                "service": "/SyncModeCmd",
                "args": {"request": {"user_id": "m", "start_sync_mode": True, "time_step": 20}},
            },
        ],
        listeners=[{**each, "topic": f"/Ego-{i}{each['topic']}"} for i in range(2, 60) for each in SENSOR_LISTENERS],
        flags=("--sensors", "teaching"),
        kept_mb=40.0,  # their topics, and a cloud of 0.4 MB of each
    ),
    Row(
        "five ticks of 20 egos with 32 radars, all heard",
        lambda: radars(range(18, 58, 2)),  # the numbers that spawned egos get
        before=[
            crowds.egos_at_once(20),
            crowds.ghosts(300, 12.0),
            {
                "op": "call_service",
                "service": "/SyncModeCmd",
                "args": {"request": {"user_id": "m", "start_sync_mode": True, "time_step": 20}},
            },
        ],
        kept_mb=10.0,  # 640 topics
    ),
    Row(
        "replay of a bag with 5,000 topics of plans",
        lambda: [replay("topics")],
        fill=lambda folder: bags.put_topics(folder / "topics.bag"),
        kept_mb=30.0,  # the library that reads bags
    ),
    Row(
        "replay of plans with long messages, all heard",
        lambda: [replay("messages")],
        listeners=[{"op": "subscribe", "topic": f"/plan/{name}"} for name in bags.LONG],
        fill=lambda folder: bags.put_messages(folder / "messages.bag"),
        kept_mb=110.0,  # the same, the recording, and a message of 10 MB as text and frame to each of three listeners
    ),
    Row("an honest image of 16 MB to a listener", lambda: [image()],
        before=[{"op": "advertise", "topic": "/s", "type": "sensor_msgs/Image"}],
        listeners=[{"op": "subscribe", "topic": "/s"}], allowed_ms=PAUSE_MS + HONEST_MS),
)  # fmt: skip


@dataclass(slots=True)
class Scene:
    """A server with its bystander, the attacker and the listeners."""

    server: WatchedServer
    bystander: Bystander
    attacker: Attacker
    listeners: list[Attacker]


@asynccontextmanager
async def scene(row: Row, folder: Path) -> AsyncIterator[Scene]:
    """Start the server, bystander, attacker and listeners of a row.

    Args:
        row: the attack.
        folder: for the server's files.

    Yields:
        All of them.
    """
    log = folder / "server.log"
    log.unlink(missing_ok=True)
    row.fill(folder / "data")
    with WatchedServer(log, "--data-dir", str(folder / "data"), *row.flags) as server:
        bystander = Bystander(server.url)
        attackers: list[Attacker] = []
        try:
            kind = CompressingAttacker if row.is_compressing else Attacker
            attacker = await kind.open(server.port)
            attackers.append(attacker)
            for fields in row.before:
                await attacker.say(**fields)
            await attacker.settle()
            for fields in row.listeners:
                attackers.append(await kind.open(server.port))
                await attackers[-1].say(**fields)
                await attackers[-1].settle()
            await bystander.waits()
            yield Scene(server, bystander, attacker, attackers[1:])
        finally:
            for one in attackers:
                await one.close()
            bystander.stop()


@dataclass(slots=True)
class Seen:
    """Result of a row.

    Attributes:
        idle_ms, longest_ms: waits of the bystander.
        pass_ms: longest pass of the loop [ms of CPU time].
        seconds: duration of the attack.
        peak_mb, settled_mb, repeated_mb: memory above idle.
        faults: a line for each bound that is exceeded.
    """

    idle_ms: float
    longest_ms: float
    pass_ms: float
    seconds: float
    peak_mb: float
    settled_mb: float
    repeated_mb: float
    faults: list[str]


async def play(row: Row, folder: Path, repeats: int, settling: float, *, idle: float = 2.0) -> Seen:
    """Carry out an attack once, measure, and repeat it.

    Args:
        row: the attack.
        folder: for the server's files.
        repeats: further attacks.
        settling: time before memory is measured [s].
        idle: time of the bystander before the attack [s].

    Returns:
        The result.

    Raises:
        SoakError: the server has ended.
    """
    loop = asyncio.get_running_loop()
    frames = list(row.frames())
    async with scene(row, folder) as there:
        server = there.server
        await asyncio.sleep(idle)
        idle_ms = (await there.bystander.waits()).longest
        idle_mb = server.figures().memory
        server.forget_peak()
        server.longest_pass()
        begun = loop.time()
        await _attack(there, frames)
        seconds = loop.time() - begun
        await asyncio.sleep(0.5)  # for work that the attack causes later, for example at each step of the world
        longest_ms = (await there.bystander.waits()).longest
        peak_mb = server.peak() - idle_mb
        await asyncio.sleep(settling)
        settled_mb = repeated_mb = server.figures().memory - idle_mb
        if repeats:
            for _ in range(repeats):
                with suppress(GoneError):
                    await _attack(there, frames)
            await asyncio.sleep(settling)
            repeated_mb = server.figures().memory - idle_mb
        largest = max(map(len, frames)) / MB
        if row.is_compressing or row.name.startswith("png"):
            largest = LARGEST / MB
        faults = []
        if longest_ms > idle_ms + row.allowed_ms:
            faults.append(f"the bystander waited {longest_ms:.0f} ms, idle {idle_ms:.0f} ms")
        spare_mb = NOISE_MB + row.kept_mb
        if peak_mb > PEAK * largest + spare_mb:
            faults.append(f"memory rose by {peak_mb:.0f} MB, for a frame of {largest:.1f} MB")
        for name, grown in (("settled", settled_mb), ("repeated", repeated_mb)):
            if grown > SETTLED * largest + spare_mb:
                faults.append(f"memory {name} at {grown:.0f} MB above idle, for a frame of {largest:.1f} MB")
        pass_ms = server.longest_pass()  # with the repeats, and with giving memory back
        if pass_ms > MAX_PASS_MS:
            faults.append(f"a pass of the loop took {pass_ms:.0f} ms of CPU time")
        if "Traceback" in server.log:
            faults.append("a traceback in the log: " + server.log[server.log.index("Traceback") :][-300:])
        return Seen(idle_ms, longest_ms, pass_ms, seconds, peak_mb, settled_mb, repeated_mb, faults)


async def _attack(there: Scene, frames: Sequence[bytes]) -> None:
    await there.attacker.send(*frames)
    await there.attacker.settle()
    for listener in there.listeners:
        await listener.settle()


async def run(patterns: Sequence[str], runs: int, repeats: int, settling: float, out: Callable[[str], None]) -> int:
    """Play the rows that match.

    Args:
        patterns: of names; none means all.
        runs: of each row.
        repeats: further attacks.
        settling: time before memory is measured [s].
        out: prints a line.

    Returns:
        Number of failed rows.
    """
    failed = 0
    out(f"{'row':50}{'idle':>7}{'longest':>9}{'pass':>8}{'took':>8}{'peak':>8}{'later':>8}{'again':>8}")
    out(f"{'':50}{'ms':>7}{'ms':>9}{'ms':>8}{'s':>8}{'MB':>8}{'MB':>8}{'MB':>8}")
    with tempfile.TemporaryDirectory() as name:
        for row in ROWS:
            if patterns and not any(fnmatchcase(row.name, pattern) for pattern in patterns):
                continue
            for _ in range(runs):
                try:
                    seen = await play(row, Path(name), repeats, settling)
                except (SoakError, TimeoutError) as error:
                    out(f"{row.name:50} FAILED: {error or 'no end of it'}")
                    failed += 1
                    continue
                out(
                    f"{row.name:50}{seen.idle_ms:7.1f}{seen.longest_ms:9.1f}{seen.pass_ms:8.1f}{seen.seconds:8.2f}"
                    f"{seen.peak_mb:8.0f}{seen.settled_mb:8.1f}{seen.repeated_mb:8.1f}"
                )
                for fault in seen.faults:
                    out(f"    FAILED: {fault}")
                failed += bool(seen.faults)
    return failed


def main() -> int:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", action="append", default=[], metavar="PATTERN", help="rows whose name matches [all]")
    parser.add_argument("--runs", type=int, default=3, help="how often each row is played [3]")
    parser.add_argument("--repeats", type=int, default=20, help="further attacks before memory is looked at again [20]")
    parser.add_argument("--settling", type=float, default=SETTLING, metavar="S", help="wait before memory is looked at")
    options = parser.parse_args()
    failed = asyncio.run(run(options.rows, options.runs, options.repeats, options.settling, print))
    print("all within bounds" if not failed else f"{failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
