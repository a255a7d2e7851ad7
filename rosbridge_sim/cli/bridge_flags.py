"""The flags of all commands that talk to a rosbridge, and the connection that they describe."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable, Mapping

from rosbridge_sim.cli.command_line import ANSWER_PATIENCE, Work, add_json, group_of, make_number
from rosbridge_sim.cli.tools.text import note
from rosbridge_sim.link.arguments import PREFIX, Parser
from rosbridge_sim.link.urls import shown_url

DEFAULT_URL = "ws://127.0.0.1:9090"

CALL_PATIENCE = 30.0
"""Default of the longest wait for the answer of a called service [s]: loading a scenario takes a while."""

SECONDS = make_number(0.001, 1e6, "seconds", float)
"""Reader of a time on the command line [s]."""

SECONDS_OR_NONE = make_number(0, 1e6, "seconds, or 0", float)

COUNT = make_number(1, 1e9, "a number from 1 on", int)
"""Reader of a number of things on the command line."""

_QOS = "the rosbridge chooses the quality of service, and its clients get all messages in order over TCP"
_HIDDEN = "rosapi lists no hidden names"

_WITHOUT_EFFECT: dict[str, tuple[int | str | None, str]] = {
    "--node-name": (None, "the node of a client is the rosbridge"),
    "--no-daemon": (0, "there is no daemon: each command asks the rosbridge"),
    "--spin-time": (None, "nothing is discovered: --timeout is the longest wait for an answer"),
    "--use-sim-time": (0, "only `topic delay` needs a clock, and it takes /clock if that is there"),
    "--full-length": (0, "messages are never cut"),
    "--wall-time": (0, "rates are always measured in real time"),
    "--include-hidden-topics": (0, _HIDDEN),
    "--include-hidden-services": (0, _HIDDEN),
    **{f"--qos-{name}": (None, _QOS) for name in ("profile", "depth", "history", "reliability", "durability")},
}
"""Flag of the tools of ROS -> its number of values (None is one), and why it has no effect here."""


def bridge_group(
    name: str, text: str, absent: Mapping[str, str] | None = None
) -> tuple[Parser, Callable[..., Parser], Callable[..., Parser]]:
    """Return the parser of `rosbridge-sim NAME` and two functions that add a command to it.

    The first is that of `group_of`. The second, `row(command, work, text, **words)`, adds a command that talks to a
    server: `words` are its arguments, parameter -> word in the help.

    Args:
        text: description for the help.
        absent: see `Parser`.
    """
    group, add = group_of(name, text, absent)

    def row(command: str, work: Work, text: str, **words: str) -> Parser:
        parser = add(command, work, text)
        for parameter, word in words.items():
            parser.add_argument(parameter, metavar=word)
        add_bridge(parser)
        return parser

    return group, add, row


_TYPE = re.compile(r"[A-Za-z]\w*/(?:(?:srv|action)/)?[A-Za-z]\w*")
"""Name of a type; a name of a service or an action has a slash in front."""


def take_type(words: list[str]) -> str:
    """Remove the name of a type from the front of words, and return it; empty if there is none."""
    return words.pop(0) if words and _TYPE.fullmatch(words[0]) else ""


class _WithoutEffect(argparse.Action):
    """An accepted flag without an effect, which prints the reason."""

    def __call__(self, _parser: object, _options: object, _values: object, flag: str | None = None) -> None:
        note(f"{flag} has no effect: {self.const}")


def add_count(parser: Parser, things: str) -> None:
    """Add the flag that prints a number in place of a list."""
    parser.switch("-c", "--count", f"--count-{things}", f"print the number of {things}", dest="is_count")


def add_types(parser: Parser) -> None:
    """Add the flag that prints types behind names."""
    parser.switch("-t", "--types", "--show-types", "with types, in brackets")


def add_without_effect(parser: Parser, flags: Mapping[str, tuple[int | str | None, str]]) -> None:
    """Accept flags of the tools of ROS that have no effect.

    Args:
        flags: name -> its number of values, as argparse takes it, and why it has no effect.
    """
    for flag, (number, why) in flags.items():
        parser.add_argument(
            flag, action=_WithoutEffect, nargs=number, const=why, dest=argparse.SUPPRESS, help=argparse.SUPPRESS
        )


def add_bridge(
    parser: Parser, patience: float = ANSWER_PATIENCE, *, is_call: bool = False, is_waiting: bool = False
) -> None:
    """Add the flags of every command that talks to a server.

    Args:
        patience: default of the longest wait for an answer [s].
        is_waiting: the command waits for messages, by default for ever.
    """
    add_json(parser)
    add_server(parser)
    add_without_effect(parser, _WITHOUT_EFFECT)
    if is_waiting:
        text = "longest wait for a message, and for an answer; then end with code 1 and the reason"
        parser.option("--timeout", "SECONDS", f"{text} [for ever]", dest="patience", type=SECONDS)
        return
    add_patience(parser, patience, is_call=is_call)


def add_patience(parser: Parser, patience: float = ANSWER_PATIENCE, *, is_call: bool = False) -> None:
    """Add the flag with the longest wait for an answer."""
    text = "longest time for the service; 0 is no limit" if is_call else "longest wait for an answer"
    parser.option(
        "--timeout",
        "SECONDS",
        f"{text} [{patience:g}]",
        dest="patience",
        type=SECONDS_OR_NONE if is_call else SECONDS,
        default=patience,
    )


def add_server(parser: Parser) -> None:
    """Add the flags that select the server."""
    url = os.environ.get(f"{PREFIX}URL") or DEFAULT_URL
    text = f"any rosbridge, also as {PREFIX}URL [{shown_url(url)}]"  # a token may stand in it
    parser.add_argument("--url", default=url, help=text.replace("%", "%%"))
    add_token(parser)


def add_token(parser: Parser) -> None:
    """Add the flag with the token of the server."""
    token = os.environ.get(f"{PREFIX}TOKEN") or None
    parser.add_argument("--token", default=token, help=f"token of the server, also as {PREFIX}TOKEN")
