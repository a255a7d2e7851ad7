"""`python -m tests.far_side [--port N] ...`: a far side until it is ended; its first line says where it listens."""

from __future__ import annotations

import argparse
import asyncio
import logging
import signal

from tests.far_side.server import FarSide


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--release", default="22.R2", help="of morai_msgs")
    parser.add_argument("--without", action="append", default=[], metavar="PACKAGE", help="is not built there")
    parser.add_argument("--no-rosapi", action="store_true")
    parser.add_argument("--max-message-size", type=int, default=10_000_000, help="longer messages go out in fragments")
    parser.add_argument("--work", type=float, default=0.0, help="how long a thread takes for a frame [s]")
    parser.add_argument("--utf8-check", type=float, default=0.0, help="how long all sockets stand for a megabyte [s]")
    parser.add_argument("--rosapi-delay", type=float, default=0.0, help="how long rosapi takes for an answer [s]")
    parser.add_argument("--provide", action="append", default=[], metavar="NAME=TYPE", help="served by a node there")
    asyncio.run(_run(parser.parse_args()))


async def _run(options: argparse.Namespace) -> None:
    logging.basicConfig(format="%(message)s")
    logging.getLogger("websockets").setLevel(logging.CRITICAL)  # who comes and goes, and how, is no news here
    far_side = FarSide(
        options.port,
        release=options.release,
        without=options.without,
        has_rosapi=not options.no_rosapi,
        max_message_size=options.max_message_size,
        work=options.work,
        utf8_check=options.utf8_check,
        rosapi_delay=options.rosapi_delay,
    )
    await far_side.listen()
    for entry in options.provide:
        name, _, kind = entry.partition("=")
        far_side.provide(name, kind)
    stopped = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, stopped.set)
    print(f"far side listening on {far_side.url}", flush=True)  # noqa: T201 - the one line on stdout
    await stopped.wait()
    await far_side.stop()


if __name__ == "__main__":
    main()
