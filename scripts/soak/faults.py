#!/usr/bin/env python3
"""Break the connection, the disk and the machine of a server, case by case, and print what the user sees.

    python scripts/soak/faults.py [--short] [--only NAME]... [--seed 0]

A bad connection is a proxy that splits, delays, resets or closes one direction. A bad disk is a file that may not grow
(as on a full disk), a file instead of a folder, or a link to /dev/full. A bad machine has no descriptors or no memory
left, or kills the server while it records, loads or saves. Each case starts its own servers. Linux only.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import random
import resource
import subprocess
import sys
import tempfile
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import orjson
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

from rosbridge_sim.records import replace

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbags.highlevel import AnyReader  # noqa: E402

from scripts.soak.harness import PATIENCE, GoneError, Programs, RefusedError, SoakError, WatchedServer, until  # noqa: E402
from scripts.soak.scenes import write_scenes  # noqa: E402
from scripts.soak.soak_client import Client, census, differences, open_raw  # noqa: E402
from tests.broken_proxy import BrokenProxy, Fate  # noqa: E402

BURST = 10
"""Ticks that are requested without waiting, so that a proxy can join their frames."""

FRAME = 0.02
"""Simulated time of a frame [s]."""

LONGEST = 12_000
"""Bytes after which the last of the connections breaks: a session has about 4,000 bytes in each direction, or more."""

MAX_LOST = 1.5
"""Simulated time that a recording may lack at its end after a kill [s]: a second between two flushes, and delay."""

MAX_IDLE_CPU = 0.5
"""CPU time a second of a server without free descriptors: it must not spin on its listening socket."""

LEFT_MEMORY = (25, 40, 60, 100)
"""Free memory of a server [MB]: a message of 16 MB then fails while it is received or read, or does not fail."""


@dataclass(frozen=True, slots=True)
class Scale:
    """Size of a run.

    Attributes:
        num_ticks: of each drive through a proxy.
        num_resets: connections that are reset.
        num_kills: of a server, in each case that kills.
        seconds: length of a recording before the kill.
        is_long: all variants of a case, not only some.
        seed: random seed.
    """

    num_ticks: int
    num_resets: int
    num_kills: int
    seconds: float
    is_long: bool
    seed: int = 0


LONG = Scale(num_ticks=200, num_resets=300, num_kills=20, seconds=5.0, is_long=True)
SHORT = Scale(num_ticks=20, num_resets=20, num_kills=2, seconds=1.3, is_long=False)


@dataclass(slots=True)
class Verdict:
    """Result of a case.

    Attributes:
        seen: what the user saw, a line each.
        faults: what is wrong; empty is good.
    """

    seen: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)

    def expect(self, is_so: bool, fault: str) -> None:  # noqa: FBT001 - as an assert reads
        """Note a fault unless a condition holds.

        Args:
            is_so: the condition.
            fault: the text.
        """
        if not is_so:
            self.faults.append(fault)


async def _check_server(
    server: WatchedServer, verdict: Verdict, *, is_traceback_fine: bool = False, code: int = 0
) -> None:
    """Check that the server serves a new client, and that it stops with this code."""
    try:
        async with await Client.open(server.url) as client:
            await client.call("/rosapi/topics")
            await client.send("subscribe", topic="/clock")
            await client.next_message("/clock")
        ended = await asyncio.to_thread(server.stop)
    except (SoakError, RefusedError) as error:
        verdict.faults.append(f"afterwards: {error}")
        return
    verdict.expect(ended == code, f"the server ended with {ended} in place of {code}")
    verdict.expect(is_traceback_fine or "Traceback" not in server.log, f"a traceback in the log:\n{server.log[-2000:]}")


def _lines(log: str, *words: str) -> list[str]:
    """Return the lines of a log that contain one of these words, without their time."""
    return [line.partition(" ")[2] for line in log.splitlines() if any(word in line for word in words)]


def _serve_refused(verdict: Verdict, *flags: str) -> None:
    """Start a server that cannot start; it must give the reason in one line, with code 2."""
    _run_refused(verdict, "serve", "--port", "0", *flags)


def _run_refused(verdict: Verdict, *words: str, stdout: int = subprocess.PIPE) -> None:
    """Run a command that cannot run; it must give the reason in one line, with code 2."""
    done = Programs.run(words, stdout)
    lines = done.stderr.splitlines()
    told = [line for line in lines if line.startswith("rosbridge-sim: ")] or lines[-1:]
    verdict.seen.append(f"rosbridge-sim {words[0]}: code {done.returncode}: {' / '.join(told) or '(nothing)'}")
    verdict.expect(done.returncode == 2, f"{words}: expected code 2, got {done.returncode}")
    verdict.expect("Traceback" not in done.stderr, f"{words}: a traceback: {lines[-1:]}")
    verdict.expect(len(told) == 1 and bool(told[0]), f"{words}: expected one line, got {lines}")


# A bad line


async def _drive(url: str, num_ticks: int) -> list[str]:
    """Drive in synchronous mode, from a reset on, and return all received frames."""
    topics = ("/Ego_topic", "/Object_topic", "/CollisionData", "/clock", "/tf", "/gps", "/imu", "/IntscnTL_topic")

    def call(service: str, mark: str, **request: object) -> str:
        args = {"request": request} if request else {"seed": 0}
        return orjson.dumps({"op": "call_service", "service": service, "id": mark, "args": args}).decode()

    frames: list[str] = []
    async with connect(url, compression=None, max_size=None, ping_interval=None, proxy=None) as socket:

        async def hear(mark: str) -> None:
            async with asyncio.timeout(PATIENCE):
                while True:
                    frame = str(await socket.recv())
                    frames.append(frame)
                    if f'"id":"{mark}"' in frame.replace(" ", ""):
                        return

        await socket.send(call("/SyncModeCmd", "start", user_id="bad line", start_sync_mode=True, time_step=20))
        await hear("start")
        await socket.send(call("/sim/reset", "reset"))
        await hear("reset")
        frames.clear()
        for topic in topics:
            await socket.send(orjson.dumps({"op": "subscribe", "topic": topic}).decode())
        for i in range(0, num_ticks, BURST):
            for j in range(i, min(num_ticks, i + BURST)):
                command = {"longlCmdType": 2, "velocity": 30.0, "steering": 0.1}
                await socket.send(call("/SyncModeCtrlCmd", f"control-{j}", frame=0, command=command))
                await socket.send(call("/SyncModeWaitForTick", f"tick-{j}", user_id="bad line", frame=0))
            await hear(f"tick-{min(num_ticks, i + BURST) - 1}")
    return frames


async def bad_line_same_bytes(folder: Path, scale: Scale, verdict: Verdict) -> None:
    """Drive through a connection that splits at every byte, delays, or joins: the bytes are the same as without it."""
    fates = {
        "split at every byte": Fate(piece=1),
        "split anywhere up to 100 bytes, with pauses": Fate(piece=100, pause=0.0005, seed=scale.seed),
        "delayed by up to 20 ms and joined": Fate(pause=0.02, seed=scale.seed),
    }
    flags = ("--start=sync", "--sync-on-loss=wait", "--scenario=town")
    with WatchedServer(folder / "log", *flags) as server:
        plain = await _drive(server.url, scale.num_ticks)
        verdict.seen.append(f"without a proxy: {len(plain):,} frames, {sum(map(len, plain)):,} bytes")
        for name, fate in fates.items():
            async with BrokenProxy(server.port, [fate]) as proxy:
                frames = await _drive(proxy.url, scale.num_ticks)
            is_same = frames == plain
            verdict.seen.append(f"{name}: {'the same bytes' if is_same else 'OTHER BYTES'}")
            verdict.expect(is_same, f"{name}: {_first_difference(plain, frames)}")
        await _check_server_in_sync(server, verdict)


async def _check_server_in_sync(server: WatchedServer, verdict: Verdict) -> None:
    async with await Client.open(server.url) as client:
        await client.request("/SyncModeCmd", user_id="end", start_sync_mode=True, time_step=20)
        await client.request("/SyncModeCmd", user_id="end", start_sync_mode=False, time_step=20)
    await _check_server(server, verdict)


def _first_difference(one: Sequence[str], other: Sequence[str]) -> str:
    for a, b in zip(one, other, strict=False):
        if a != b:
            return f"first other frame: {b[:200]} in place of {a[:200]}"
    return f"{len(other)} frames in place of {len(one)}"


_SESSION: tuple[dict[str, Any], ...] = (
    {"op": "subscribe", "topic": "/Ego_topic", "throttle_rate": 20, "queue_length": 3},
    {"op": "subscribe", "topic": "/soak/own", "type": "std_msgs/String", "compression": "cbor"},
    {"op": "advertise", "topic": "/soak/own", "type": "std_msgs/String", "latch": True},
    {"op": "publish", "topic": "/soak/own", "msg": {"data": "x" * 2000}},
    {"op": "advertise_service", "service": "/soak/add", "type": "example_interfaces/AddTwoInts"},
    {"op": "call_service", "service": "/soak/add", "args": {"a": 1, "b": 2}, "id": "own"},
    {"op": "advertise_action", "action": "/soak/fibonacci", "type": "example_interfaces/Fibonacci"},
    {
        "op": "send_action_goal",
        "action": "/soak/fibonacci",
        "action_type": "example_interfaces/Fibonacci",
        "args": {"order": 5},
        "id": "goal",
    },
    {"op": "fragment", "id": "half", "num": 0, "total": 2, "data": '{"op":'},
    {"op": "call_service", "service": "/rosapi/topics", "id": "topics"},
    {
        "op": "call_service",
        "service": "/SyncModeCmd",
        "args": {"request": {"user_id": "reset", "start_sync_mode": True, "time_step": 20}},
    },
    {"op": "call_service", "service": "/SyncModeWaitForTick", "args": {"request": {"user_id": "reset", "frame": 0}}},
    {"op": "call_service", "service": "/rosapi/get_time", "id": "last"},
)
"""A session that uses one of everything."""


async def _live_through(proxy: BrokenProxy) -> int:
    """Play the session as long as the connection holds, and return the number of answers."""
    num = 0
    try:
        async with asyncio.timeout(PATIENCE), connect(proxy.url, ping_interval=None, proxy=None) as socket:
            for op in _SESSION:
                await socket.send(orjson.dumps(op).decode())
            async for frame in socket:
                num += isinstance(frame, str) and '"service_response"' in frame
                if isinstance(frame, str) and '"last"' in frame:
                    break
    except (OSError, EOFError, WebSocketException):
        pass  # what the proxy is for
    return num


async def resets_leave_no_trace(folder: Path, scale: Scale, verdict: Verdict) -> None:
    """Reset connections that hold one of everything (RST) after any number of bytes, in the handshake too."""
    chance = random.Random(scale.seed)  # noqa: S311 - to be repeated, no secret
    fates = [
        Fate(reset_at=chance.randrange(LONGEST), piece=chance.choice((1, 50, 1 << 16))) for _ in range(scale.num_resets)
    ]
    await _break_lines(folder, fates, verdict)


async def half_closes_leave_no_trace(folder: Path, scale: Scale, verdict: Verdict) -> None:
    """End the client's sending direction after any number of bytes, while it would still receive."""
    chance = random.Random(scale.seed)  # noqa: S311 - the same
    fates = [
        Fate(finish_at=chance.randrange(LONGEST), piece=chance.choice((1, 50, 1 << 16)))
        for _ in range(scale.num_resets)
    ]
    await _break_lines(folder, fates, verdict)


async def _break_lines(folder: Path, fates: Sequence[Fate], verdict: Verdict) -> None:
    with WatchedServer(folder / "log") as server:
        async with await Client.open(server.url) as client:
            before = await census(client)
        await until(lambda: server.figures().tasks <= 2)
        figures = server.figures()
        async with BrokenProxy(server.port, fates) as proxy:
            nums = [await _live_through(proxy) for _ in fates]
            verdict.seen.append(
                f"{len(fates)} connections, {proxy.num_ended} broken by the line, {sum(nums)} answers heard"
            )
        await until(lambda: server.figures().tasks <= figures.tasks)
        await until(lambda: server.figures().descriptors <= figures.descriptors)
        after = server.figures()
        for what in ("descriptors", "tasks"):
            was, now = getattr(figures, what), getattr(after, what)
            verdict.expect(now <= was, f"{what}: {was} before, {now} after")
        async with await Client.open(server.url) as client:
            verdict.faults += differences(before, await census(client))
            await client.send("subscribe", topic="/sim/clients")
            num = len((await client.next_message("/sim/clients"))["clients"])
            verdict.expect(num == 1, f"/sim/clients: expected only this client, got {num}")
        verdict.seen.append(f"afterwards the bus is as before, {after.descriptors} descriptors, {after.tasks} tasks")
        await _check_server(server, verdict)


# A bad disk


async def recording_on_a_full_disk(folder: Path, scale: Scale, verdict: Verdict) -> None:
    """Stop the growth of a recording's file: the recording ends, the world goes on, and repair reads the rest."""
    del scale
    for name in ("drive.bag", "drive.mcap"):
        path = folder / name
        with WatchedServer(folder / f"log-{name}", f"--record={path}", is_log_piped=True) as server:
            server.limit(resource.RLIMIT_FSIZE, path.stat().st_size + 600_000)  # two seconds of the default scene
            has_ended = await until(lambda server=server: "the recording has ended" in server.log)
            verdict.expect(has_ended, f"{name}: the log does not say that the recording has ended")
            verdict.seen += _lines(server.log, "ERROR")
            await _check_server(server, verdict, code=2)
        verdict.seen.append(f"{name}: repaired, {await _repair(path, verdict)} messages")


async def recording_into_dev_full(folder: Path, scale: Scale, verdict: Verdict) -> None:
    """Record into a link to /dev/full."""
    del scale
    for name in ("drive.bag", "drive.mcap"):
        (folder / name).symlink_to("/dev/full")
        _serve_refused(verdict, f"--record={folder / name}")


async def captures_on_a_full_disk(folder: Path, scale: Scale, verdict: Verdict) -> None:
    """Save captures while no file may grow: the capture is refused with a reason, and no partial file stays."""
    del scale
    data = folder / "data"
    with WatchedServer(folder / "log", f"--data-dir={data}", is_log_piped=True) as server:
        server.limit(resource.RLIMIT_FSIZE, 64)
        async with await Client.open(server.url) as client:
            await _capture(client, "one")
            verdict.expect(len(client.told) == 1, f"expected one status, got {client.told}")
            verdict.seen += client.told
            verdict.expect(not _files(data), f"left behind: {_files(data)}")
            server.limit(resource.RLIMIT_FSIZE, -1)
            await _capture(client, "one")
            verdict.expect(len(_files(data)) == 3, f"there is room again, but {client.told[1:]}")
            verdict.seen.append(f"there is room again: {len(_files(data))} files")
        await _check_server(server, verdict)


async def _capture(client: Client, name: str) -> None:
    msg = {"is_custom_file_name": True, "custom_file_name": name, "file_dir": ""}
    await client.send("publish", topic="/SaveSensorData", type="morai_msgs/SaveSensorData", msg=msg)
    await client.send("subscribe", topic="/clock")
    for _ in range(3):  # it is saved in the next frame
        await client.next_message("/clock")
    await client.send("unsubscribe", topic="/clock")
    await client.call("/rosapi/get_time")


def _files(folder: Path) -> list[Path]:
    """Return the files under their final names; a hidden file is one that is being written."""
    return sorted(path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("."))


async def file_in_place_of_a_folder(folder: Path, scale: Scale, verdict: Verdict) -> None:
    """Put a file where a folder should be."""
    del scale
    file = folder / "file"
    file.write_text("precious")
    _serve_refused(verdict, f"--scenario-path={file}")
    _serve_refused(verdict, f"--schema-path={file}")
    _serve_refused(verdict, f"--map={file}")
    _serve_refused(verdict, f"--record={file / 'drive.bag'}")
    _serve_refused(verdict, f"--record={file / 'drive.mcap'}")
    _serve_refused(verdict, f"--data-dir={file}", f"--record={file / 'drive.mcap'}")
    (folder / "data").mkdir()
    for name in ("SensorData", "Network", "Replay"):
        (folder / "data" / name).write_text("precious")
    for data in (file, folder / "data"):
        with WatchedServer(folder / f"log-{data.name}", f"--data-dir={data}") as server:
            async with await Client.open(server.url) as client:
                await _capture(client, "one")
                replay = {"sim_process_status": 1, "replay_option": 1, "rosbag_file_name": "drive"}
                answer = await client.request("/Morai_SimProc", **replay)
                verdict.expect(not answer["result"], f"a replay out of a file was begun: {answer}")
                load = {"file_name": "demo", "load_network_connection_data": True}
                loaded = await client.request("/Service_MoraiSL", **load)
                verdict.seen.append(f"--data-dir {data.name}: a load with network settings: {loaded['result']}")
                verdict.seen += [f"--data-dir {data.name}: {text}" for text in client.told]
                verdict.expect(len(client.told) >= 2, "expected a status for the capture and one for the replay")
            await _check_server(server, verdict)
    verdict.expect(file.read_text() == "precious", "the file was written over")


async def output_nowhere(folder: Path, scale: Scale, verdict: Verdict) -> None:
    """Use a full stdout: a tool reports it and ends. Use a full stderr: a server goes on without its log."""
    del scale
    full = os.open("/dev/full", os.O_WRONLY)
    _run_refused(verdict, "schema", "show", "std_msgs/String", stdout=full)
    _run_refused(verdict, "scenario", "check", "town", stdout=full)
    os.close(full)
    log = folder / "log"
    log.symlink_to("/dev/full")
    with WatchedServer(log) as server:
        async with await Client.open(server.url) as client:
            await client.send_raw("{")
            await client.call("/rosapi/topics")
        code = await asyncio.to_thread(server.stop)
        verdict.expect(code == 0, f"without a log the server ended with {code}")
        verdict.seen.append("a server whose log goes to /dev/full serves, and ends with 0")


# A bad machine


async def no_descriptors_left(folder: Path, scale: Scale, verdict: Verdict) -> None:
    """Let clients use all descriptors: connected clients are served, new ones wait or are refused, and files fail."""
    del scale
    scenes = folder / "scenes"
    scenes.mkdir()
    write_scenes(scenes)
    flags = (f"--scenario-path={scenes}", f"--data-dir={folder / 'data'}")
    with WatchedServer(folder / "log", *flags) as server:
        figures = server.figures()
        server.limit(resource.RLIMIT_NOFILE, figures.descriptors + 10)
        crowd = []
        async with await Client.open(server.url) as client:
            try:
                for _ in range(40):
                    _reader, writer = await open_raw(server.port, is_greeting=False)
                    crowd.append(writer)
                await until(lambda: server.figures().descriptors >= figures.descriptors + 10, 5.0)
                await _use_what_is_left(server, client, verdict)
            finally:
                for writer in crowd:
                    writer.transport.abort()
            has_room = await until(lambda: server.figures().descriptors <= figures.descriptors + 3)
            verdict.expect(has_room, "the descriptors do not come back")
        server.limit(resource.RLIMIT_NOFILE, 1024)
        num_lines = len(server.log.splitlines())
        trouble = _lines(server.log, "ERROR", "WARNING", "CRITICAL")
        verdict.seen.append(f"{num_lines} lines of log, of which {len(trouble)} are warnings and errors:")
        verdict.seen += sorted(set(trouble))[:5]
        verdict.expect(num_lines < 100, f"the log has {num_lines} lines")
        await _check_server(server, verdict)


async def _use_what_is_left(server: WatchedServer, client: Client, verdict: Verdict) -> None:
    """Let a connected client use services that need a file, and others that need none."""
    begun = server.figures()
    for topic in ("/clock", "/gps"):  # the first position needs a library and its database
        await client.send("subscribe", topic=topic)
    for _ in range(50):
        await client.next_message("/clock")
    used = server.figures().cpu - begun.cpu
    verdict.seen.append(f"{begun.descriptors} descriptors; a second of it costs {used:.2f} s of CPU")
    verdict.expect(used < MAX_IDLE_CPU, f"it spins: {used:.2f} s of CPU in a second")
    loaded = (await client.request("/Service_MoraiSL", file_name="busy", delete_all=True))["result"]
    await _capture(client, "one")
    verdict.seen.append(f"a load: {loaded}; told: {client.told}")
    verdict.expect(loaded or bool(client.told), "a load was refused without a reason")


async def no_memory_left(folder: Path, scale: Scale, verdict: Verdict) -> None:
    """Send messages of 16 MB with little memory left: the sender gets a status or is closed, and others go on."""
    start = '{"op":"publish","topic":"/soak/big","type":"soak_msgs/Own","msg":{"a":['
    bodies = {
        "text": '{"op":"publish","topic":"/soak/text","type":"std_msgs/String","msg":{"data":"%s"}}'
        % ("x" * 15_900_000),
        "numbers": start + ",".join(["1.5"] * 3_900_000) + "]}}",
        "lists": start + ",".join(["[]"] * 5_000_000) + "]}}",
    }
    for left in LEFT_MEMORY[:: 1 if scale.is_long else 3]:
        with WatchedServer(folder / f"log-{left}") as server:
            server.limit(resource.RLIMIT_AS, server.address_space() + left * 2**20)
            bystander = await Client.open(server.url)
            for name, body in bodies.items():
                ending = await _send_large(server.url, body)
                verdict.seen.append(f"{left} MB left, {name}: the sender {ending}")
                try:
                    await bystander.call("/rosapi/get_time")
                except SoakError as error:
                    await until(lambda server=server: not server.is_alive)
                    verdict.faults.append(f"{left} MB left, {name}: another client: {error}; exit code {server.code}")
                    break
            else:
                await bystander.close()
                await _check_server(server, verdict, is_traceback_fine=True)


async def _send_large(url: str, body: str) -> str:
    """Send a message three times, and return what the sender saw."""
    client = await Client.open(url)
    try:
        for _ in range(3):
            await client.send_raw(body)
        await client.call("/rosapi/get_time")
    except GoneError:
        return "was closed"
    finally:
        await client.cut()
    return f"was told {client.told[0][:100]!r}" if client.told else "was served"


async def killed_while_recording(folder: Path, scale: Scale, verdict: Verdict) -> None:
    """Kill -9 during a recording: repair restores all but the last second, in every format."""
    for name in ("drive.bag", "drive.mcap", "drive"):
        path = folder / name
        with WatchedServer(folder / f"log-{name}", f"--record={path}") as server:
            client = await Client.open(server.url)
            await client.send("subscribe", topic="/clock")
            last = 0.0
            while last < scale.seconds:
                clock = (await client.next_message("/clock"))["clock"]
                last = clock["secs"] + clock["nsecs"] * 1e-9
            server.kill()
            await client.cut()
        num = await _repair(path, verdict)
        stamps = _stamps(path.with_name(f"{path.stem}.repaired{path.suffix}"), "/Ego_topic")
        end = stamps[-1] * 1e-9 if stamps else 0.0
        verdict.seen.append(f"{name}: killed at {last:.2f} s, repaired up to {end:.2f} s, {num} messages")
        verdict.expect(last - end < MAX_LOST, f"{name}: more is lost than {MAX_LOST} s")
        is_whole = stamps == [round(frame * FRAME * 1e9) for frame in range(1, len(stamps) + 1)]
        verdict.expect(is_whole, f"{name}: not every frame is there")


async def _repair(path: Path, verdict: Verdict) -> int:
    """Run `rosbridge-sim bag repair`, and return the number of messages that it found."""
    done = await asyncio.to_thread(Programs.run, ["bag", "repair", str(path), "--json"], subprocess.PIPE)
    if done.returncode:
        verdict.faults.append(f"{path.name}: repair ended with {done.returncode}: {done.stderr.strip()}")
        return 0
    num: int = json.loads(done.stdout)["messages"]
    return num


def _stamps(path: Path, topic: str) -> list[int]:
    if not path.exists():
        return []
    with AnyReader([path]) as reader:
        return [stamp_ns for connection, stamp_ns, _ in reader.messages() if connection.topic == topic]


async def killed_while_loading(folder: Path, scale: Scale, verdict: Verdict) -> None:
    """Kill -9 while scenarios are loaded: the next server starts with the same folders and loads the same scenarios."""
    chance = random.Random(scale.seed)  # noqa: S311 - to be repeated, no secret
    scenes, data = folder / "scenes", folder / "data"
    scenes.mkdir()
    write_scenes(scenes)
    before = {path: path.read_bytes() for path in _files(scenes)}
    flags = (f"--scenario-path={scenes}", f"--data-dir={data}")
    for i in range(scale.num_kills):
        with WatchedServer(folder / f"log-{i}", *flags) as server:
            client = await Client.open(server.url)
            for name in ("town", "busy", "loop", "junction"):
                request = {"file_name": name, "delete_all": True, "load_surrounding_vehicle_data": True}
                args = {"request": request}
                await client.send("call_service", service="/Service_MoraiSL", args=args, id=name)
            await asyncio.sleep(chance.uniform(0.0, 0.4))
            server.kill()
            await client.cut()
    verdict.expect({path: path.read_bytes() for path in _files(scenes)} == before, "the scenarios are not as they were")
    with WatchedServer(folder / "log", *flags) as server:
        async with await Client.open(server.url) as client:
            for name in ("town", "busy"):
                answer = await client.request("/Service_MoraiSL", file_name=name, delete_all=True)
                verdict.expect(answer["result"], f"{name} cannot be loaded any more: {client.told}")
        await _check_server(server, verdict)
    verdict.seen.append(f"{scale.num_kills} kills; the next server loads as before; left in --data-dir: {_files(data)}")


async def killed_while_saving(folder: Path, scale: Scale, verdict: Verdict) -> None:
    """Kill -9 while captures are saved: no file under its final name is incomplete."""
    chance = random.Random(scale.seed)  # noqa: S311 - the same
    num_files = 0
    halves: list[str] = []
    for i in range(scale.num_kills):
        data = folder / f"data-{i}"
        with WatchedServer(folder / f"log-{i}", f"--data-dir={data}") as server:
            client = await Client.open(server.url)
            msg = {"is_custom_file_name": True, "custom_file_name": "one", "file_dir": ""}
            save = {"op": "publish", "topic": "/SaveSensorData", "type": "morai_msgs/SaveSensorData", "msg": msg}
            frame = orjson.dumps(save).decode()
            for _ in range(2000):
                await client.send_raw(frame)
            await until(lambda data=data: bool(_files(data)), 5.0)
            await asyncio.sleep(chance.uniform(0.0, 0.2))
            server.kill()
            await client.cut()
        files = _files(data)
        num_files += len(files)
        cut = [path.name for path in files if not _is_whole(path)]
        verdict.expect(not cut, f"cut off: {cut}")
        halves += cut
    verdict.seen.append(
        f"{scale.num_kills} kills, {num_files:,} files, cut off under their final name: {halves or 'none'}"
    )


def _is_whole(path: Path) -> bool:
    """Return whether a file of a capture is complete."""
    if path.suffix not in {".csv", ".txt"}:
        return True  # a temporary file, under a hidden name
    text = path.read_text()
    return text.endswith("\n") and (path.suffix != ".csv" or text.count("\n") == 2)


Case = Callable[[Path, Scale, Verdict], Awaitable[None]]

CASES: tuple[Case, ...] = (
    bad_line_same_bytes,
    resets_leave_no_trace,
    half_closes_leave_no_trace,
    recording_on_a_full_disk,
    recording_into_dev_full,
    captures_on_a_full_disk,
    file_in_place_of_a_folder,
    output_nowhere,
    no_descriptors_left,
    no_memory_left,
    killed_while_recording,
    killed_while_loading,
    killed_while_saving,
)


async def run_case(case: Case, folder: Path, scale: Scale) -> Verdict:
    """Run a case in an empty folder.

    Args:
        scale: size of the run.

    Returns:
        Its result.
    """
    verdict = Verdict()
    try:
        await case(folder, scale, verdict)
    except (SoakError, RefusedError) as error:
        verdict.faults.append(str(error))
    return verdict


def main() -> int:
    """Run the cases and print the result of each."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--short", action="store_true", help="with the numbers of the tests")
    parser.add_argument("--only", action="append", metavar="NAME", help="only cases whose name holds this")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    scale = replace(SHORT if options.short else LONG, seed=options.seed)
    cases = [case for case in CASES if not options.only or any(part in case.__name__ for part in options.only)]
    if not cases:
        parser.error("no such case; there are: " + ", ".join(case.__name__ for case in CASES))
    num_bad = 0
    for case in cases:
        with tempfile.TemporaryDirectory() as name:
            verdict = asyncio.run(run_case(case, Path(name), scale))
        num_bad += bool(verdict.faults)
        print(f"{case.__name__}: {'NOT GOOD' if verdict.faults else 'good'}")
        print(f"    done: {(case.__doc__ or '').strip()}")
        for line in verdict.seen:
            print(f"    seen: {line.replace(name, '...')}")
        for line in verdict.faults:
            print(f"    NOT GOOD: {line.replace(name, '...')}")
        sys.stdout.flush()
    print(f"{len(cases) - num_bad} of {len(cases)} cases are good")
    return 1 if num_bad else 0


if __name__ == "__main__":
    sys.exit(main())
