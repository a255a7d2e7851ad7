"""Settings from the flags of a command line, and the text of `--help` about them."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from typing import Final, Literal

from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import Parser, layout
from rosbridge_sim.shell.config.flag_table import FIELDS, FLAGS
from rosbridge_sim.shell.config.keys import flags_and_variables, read_value, show_value
from rosbridge_sim.shell.config.value_types import SWITCH, show_size
from rosbridge_sim.suggestions import hint

ServerCommand = Literal["serve", "attach", "mock run"]
"""Commands that run a server."""


def read_flags(argv: Sequence[str], command: ServerCommand = "serve") -> dict[str, object]:
    """Return the checked values of a command line's flags, by their keys.

    Args:
        argv: flags, without the program's name and the command.
        command: of `attach`, words without dashes are URLs, and it does not listen; of `mock run`, one is a file.

    Raises:
        SettingError: the first mistake.
        SystemExit: `--help` was given, and its text is printed.
    """
    given, rest = _make_parser(command).parse_known_args(argv)
    strange = next((word for word in rest if word.startswith("-")), None)
    if strange is not None:
        name = strange.partition("=")[0]
        if command != "serve" and name.removeprefix("--").removeprefix("no-") in FLAGS:
            raise SettingError(f"{name}: is a flag of serve; {_LACKS[command]}")
        near = hint(name, [f"--{key}" for key in flags_and_variables()])
        raise SettingError(f"no such flag: {name}{near}; --help lists them all")
    values = _values_of_words([*getattr(given, "words", ()), *rest], command)  # words after a flag are in the rest
    for name, value in vars(given).items():
        key = name.replace("_", "-")
        if key in FLAGS:
            values[key] = read_value(key, value, f"--{key}")
    return values


def _values_of_words(words: list[str], command: ServerCommand) -> dict[str, object]:
    """Return the values of words without dashes; for errors see `read_flags`."""
    if command == "attach":
        return {"listen": False, **({"attach": read_value("attach", words, "attach")} if words else {})}
    if command == "mock run" and len(words) == 1:
        return {"mock": read_value("mock", words[0], "mock run")}
    if command == "mock run" and words:
        raise SettingError(f"mock run: expected one file; got {show_value(words[0])} and {show_value(words[1])}")
    if words:
        raise SettingError(f"expected flags; got {show_value(words[0])}")
    return {}


def _make_parser(command: ServerCommand) -> argparse.ArgumentParser:
    usage, description = _USAGES[command]
    parser = Parser(
        prog=f"rosbridge-sim {command}",
        usage=f"rosbridge-sim {usage} [flags]",
        description=description,
        epilog="Each flag is also an environment variable (--sync-lease is ROSBRIDGE_SIM_SYNC_LEASE) and a key of the"
        " TOML file (sync-lease). A flag beats the environment, the environment beats the file. In the environment,"
        f" folders are separated by {os.pathsep!r}, rates, patterns, origins and hosts by ','. The file alone has the"
        " tables [publishers], [subscribers] and [services]: --print-config writes them with the rest.",
        allow_abbrev=False,
        argument_default=argparse.SUPPRESS,
        formatter_class=layout,
    )
    if command == "attach":
        parser.add_argument("words", nargs="*", metavar="URL", help=FLAGS["attach"].kind.expects)
    elif command == "mock run":
        parser.add_argument("words", nargs="*", metavar="FILE", help="the mock's file, YAML")
    groups: dict[str, argparse._ArgumentGroup] = {}  # private, because the library has no public name for it
    for key in FLAGS:
        flag = FLAGS[key]
        if flag.kind.is_table or (key in _LEFT_OUT[command] or (flag.group in _LEFT_OUT[command] and key != "seed")):
            continue
        if flag.group not in groups:
            groups[flag.group] = parser.add_argument_group(flag.group)
        group = groups[flag.group]
        text = f"{flag.text}{_show_default(key)}".replace("%", "%%")
        if flag.kind is SWITCH:
            group.add_argument(f"--{key}", action=argparse.BooleanOptionalAction, help=text)
        else:
            action = "append" if flag.kind.separator else "store"
            group.add_argument(f"--{key}", action=action, metavar=flag.kind.sign, help=text)
    for key, text in _ASIDES.items():
        parser.add_argument(f"--{key}", action="store_true", help=text)
    return parser


_SERVE_TEXT = (
    "A rosbridge v2 server that needs no ROS, with a driving world inside that answers like MORAI SIM: Drive."
    " rosbridge-sim attach URL connects the simulator to an existing rosbridge, as MORAI SIM does. Other commands talk"
    " to any rosbridge: rosbridge-sim topic, service, node, param, action, sync, tick, step, score, snapshot, restore,"
    " spawn, sensor, shot, layout, wait, record; or read files: bag, interface, schema, scenario, map, docs; or draw:"
    " clip, shot; or drive many scenarios: campaign; or look at a graph of ROS: ros1 check, ros2 check; or"
    " check a rosbridge: doctor, contract; or stand in for a robot: mock. Each has its own --help."
)

_ATTACH_TEXT = (
    "Connect the simulator to existing rosbridges as a client, the way MORAI SIM does: it advertises its topics and"
    " services at each URL and takes commands from there. It listens on no port of its own."
)

_MOCK_TEXT = (
    "Run a mock: a robot that a YAML file describes, to test programs and web pages without one. It is a rosbridge"
    " server like that of serve, without a world. A changed file is read anew. rosbridge-sim mock check FILE finds"
    " mistakes, rosbridge-sim mock fault switches faults."
)

_USAGES: Final[dict[ServerCommand, tuple[str, str]]] = {
    "serve": ("[serve]", _SERVE_TEXT),
    "attach": ("attach URL [URL ...]", _ATTACH_TEXT),
    "mock run": ("mock run FILE", _MOCK_TEXT),
}
"""Command -> its usage without flags, and its description."""


def _groups_of(*keys: str) -> frozenset[str]:
    return frozenset(FLAGS[key].group for key in keys)


_LEFT_OUT: Final[dict[ServerCommand, frozenset[str]]] = {
    "serve": frozenset(),
    "attach": _groups_of("port", "token", "mock") | {"attach"},
    "mock run": _groups_of("attach", "world", "publishers", "profile", "sync-lease") | {"mock", "listen"},
}
"""Command -> groups of flags, and single ones, that it does not have."""

_LACKS: Final = {
    "attach": "attach has no clients of its own",
    "mock run": "a mock has no world",
}
"""Command -> why it does not have them."""

_ASIDES = {
    "print-config": "print all settings as a TOML file and exit",
    "version": "print the version and exit",
}
"""Flags that are not settings: the command line handles them itself."""


def _show_default(key: str) -> str:
    """Return the default as the help text shows it."""
    kind = FLAGS[key].kind
    default = FIELDS[key].default if key in FIELDS else None
    if kind is SWITCH or kind.separator or key == "config":
        return f" [{'on' if default else 'off'}]" if kind is SWITCH else ""
    if default is None:
        return f" [{kind.sign.rpartition('|')[2] if '|' in kind.sign else 'none'}]"
    if isinstance(default, float):
        return f" [{default:g}]"
    return f" [{show_size(default) if kind.sign == 'SIZE' and isinstance(default, int) else default}]"
