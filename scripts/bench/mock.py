"""What a mock of many topics costs, beside a server whose clients publish the same messages.

Both servers have one subscriber of all topics. Measured is the CPU time of the server's process per message that the
subscriber gets; the servers run in turn. The messages of the other server are those that the mock has sent, so both
send the same bytes.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import orjson
from websockets.asyncio.client import ClientConnection, connect

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from scripts.bench.reference import reference_line

VALUE = "{header: {frame_id: odom}, pose: {pose: {position: {x: {$sine: {period: 10}}, y: 1}}}}"
TICKS = os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Print the CPU time per message of both servers, and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--topics", type=int, default=200)
    parser.add_argument("--rate", type=int, default=50, help="of each topic [Hz]")
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    print(reference_line())
    ratios = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.yaml"
        lines = [
            f"  /t{i}: {{type: nav_msgs/Odometry, rate: {options.rate}, value: {VALUE}}}" for i in range(options.topics)
        ]
        file.write_text("topics:\n" + "\n".join(lines))
        for _ in range(options.rounds):
            mock = asyncio.run(_measure(["mock", "run", str(file)], options, is_publishing=False))
            clients = asyncio.run(_measure(["serve", "--no-world"], options, is_publishing=True))
            ratios.append(mock / clients)
            print(f"mock {mock:.1f} us, clients {clients:.1f} us for each message: {ratios[-1]:.2f}", flush=True)
    print(f"median {median(ratios):.2f}")


async def _measure(words: list[str], options: argparse.Namespace, *, is_publishing: bool) -> float:
    """Return the CPU time of the server for each message that the subscriber gets [us]."""
    flags = ["--port", "0", "--no-page", "--log-level", "error"]
    command = [sys.executable, "-m", "rosbridge_sim", *words, *flags]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)  # noqa: ASYNC220, S603 - our own, started once
    try:
        assert server.stdout is not None
        url = server.stdout.readline().split()[-1]
        listener = await connect(url, compression=None, max_size=None, ping_interval=None)
        for i in range(options.topics):
            op = {"op": "subscribe", "topic": f"/t{i}", "type": "nav_msgs/Odometry"}
            await listener.send(orjson.dumps(op).decode())
        publisher = (
            subprocess.Popen(  # noqa: ASYNC220, S603 - as above
                [sys.executable, __file__, "publish", url, str(options.topics), str(options.rate)]
            )
            if is_publishing
            else None
        )
        await _count(listener, 2.0)
        before, began = _cpu(server.pid), time.monotonic()
        num = await _count(listener, options.seconds)
        used, wall = _cpu(server.pid) - before, time.monotonic() - began
        if num < 0.5 * options.topics * options.rate * wall:
            print(f"only {num / wall:,.0f} messages a second came: the machine is too busy", file=sys.stderr)
        if publisher is not None:
            publisher.send_signal(signal.SIGKILL)
            publisher.wait()
        await listener.close()
        return 1e6 * used / num
    finally:
        server.send_signal(signal.SIGINT)
        server.wait()


async def _count(listener: ClientConnection, seconds: float) -> int:
    num, until = 0, time.monotonic() + seconds
    while time.monotonic() < until:
        await listener.recv(decode=False)
        num += 1
    return num


def _cpu(pid: int) -> float:
    """Return the CPU time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


async def _publish(url: str, num_topics: int, rate: int) -> None:
    """Publish what the mock sends, with a client that costs as little as possible."""
    zeros = ",".join(["0.0"] * 36)
    text = (
        '{"op":"publish","topic":"/t%d","msg":{"header":{"seq":%d,"stamp":{"secs":1700000000,"nsecs":123456789},'
        '"frame_id":"odom"},"child_frame_id":"","pose":{"pose":{"position":{"x":0.12345678901234,"y":1.0,"z":0.0},'
        '"orientation":{"x":0.0,"y":0.0,"z":0.0,"w":0.0}},"covariance":[' + zeros + ']},"twist":{"twist":{"linear":'
        '{"x":0.0,"y":0.0,"z":0.0},"angular":{"x":0.0,"y":0.0,"z":0.0}},"covariance":[' + zeros + "]}}}"
    )
    async with connect(url, compression=None, ping_interval=None) as socket:
        for i in range(num_topics):
            op = {"op": "advertise", "topic": f"/t{i}", "type": "nav_msgs/Odometry"}
            await socket.send(orjson.dumps(op).decode())
        number, began = 0, time.monotonic()
        while True:
            for i in range(num_topics):
                await socket.send(text % (i, number))
            number += 1
            await asyncio.sleep(max(0.0, began + number / rate - time.monotonic()))


if __name__ == "__main__":
    if sys.argv[1:2] == ["publish"]:
        asyncio.run(_publish(sys.argv[2], int(sys.argv[3]), int(sys.argv[4])))
    else:
        main()
