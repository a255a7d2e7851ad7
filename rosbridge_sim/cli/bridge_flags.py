"""The flags of all commands that talk to a rosbridge, and the connection that they describe."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING

from rosbridge_sim.cli.command_line import Options, add_json, make_number
from rosbridge_sim.link.arguments import PREFIX, Parser
from rosbridge_sim.link.urls import shown_url

if TYPE_CHECKING:
    from rosbridge_sim.cli.tools.tool_client import Bridge

__all__ = [
    "ANSWER_PATIENCE",
    "CALL_PATIENCE",
    "COUNT",
    "SECONDS",
    "add_bridge",
    "add_server",
    "with_bridge",
]

DEFAULT_URL = "ws://127.0.0.1:9090"

ANSWER_PATIENCE = 5.0
"""Default of the longest wait for an answer [s]: rosbridge_suite's own time-out of a call."""

CALL_PATIENCE = 30.0
"""Default of the longest wait for the answer of a called service [s]: loading a scenario takes a while."""

SECONDS = make_number(0.001, 1e6, "seconds", float)
"""Reader of a time on the command line [s]."""

SECONDS_OR_NONE = make_number(0, 1e6, "seconds, or 0", float)

COUNT = make_number(1, 1e9, "a number from 1 on", int)
"""Reader of a number of things on the command line."""


def with_bridge(options: Options, work: Callable[[Bridge], Awaitable[int]]) -> int:
    """Connect to a server, run the work, and close the connection.

    Args:
        options: `url`, `token` and `patience`, or `wait` in place of it.
        work: gets the connection, and returns the exit code.

    Returns:
        The exit code.
    """
    from rosbridge_sim.cli.tools.tool_client import open_bridge  # noqa: PLC0415 - not needed for --help or after a mistake

    async def main() -> int:
        patience = vars(options).get("wait") or options.patience
        async with open_bridge(options.url, options.token, patience) as bridge:
            return await work(bridge)

    return asyncio.run(main())


def add_bridge(
    parser: Parser, patience: float = ANSWER_PATIENCE, *, is_call: bool = False, is_waiting: bool = False
) -> None:
    """Add the flags of every command that talks to a server.

    Args:
        patience: default of the longest wait for an answer [s].
        is_call: the answer is that of a service.
        is_waiting: the command waits for messages, by default for ever.
    """
    add_json(parser)
    add_server(parser)
    if is_waiting:
        text = "longest wait for a message, and for an answer; then end with code 1 and the reason"
        parser.add_argument("--timeout", dest="wait", type=SECONDS, metavar="SECONDS", help=f"{text} [for ever]")
        parser.set_defaults(patience=patience)
        return
    text = "longest time for the service; 0 is no limit" if is_call else "longest wait for an answer"
    parser.add_argument(
        "--timeout",
        dest="patience",
        type=SECONDS_OR_NONE if is_call else SECONDS,
        default=patience,
        metavar="SECONDS",
        help=f"{text} [{patience:g}]",
    )


def add_server(parser: Parser) -> None:
    """Add the flags that select the server."""
    url = os.environ.get(f"{PREFIX}URL") or DEFAULT_URL
    token = os.environ.get(f"{PREFIX}TOKEN") or None
    text = f"any rosbridge, also as {PREFIX}URL [{shown_url(url)}]"  # a token may stand in it
    parser.add_argument("--url", default=url, help=text.replace("%", "%%"))
    parser.add_argument("--token", default=token, help=f"token of the server, also as {PREFIX}TOKEN")
