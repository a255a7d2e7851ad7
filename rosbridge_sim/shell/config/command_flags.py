"""Settings from the flags of a command line, and the text of `--help` about them."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence

from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import Parser, layout
from rosbridge_sim.shell.config.flag_table import FIELDS, FLAGS
from rosbridge_sim.shell.config.keys import flags_and_variables, read_value, show_value
from rosbridge_sim.shell.config.value_types import SWITCH, show_size
from rosbridge_sim.suggestions import hint


def read_flags(argv: Sequence[str], *, is_attaching: bool = False) -> dict[str, object]:
    """Return the checked values of a command line's flags, by their keys.

    Args:
        argv: flags, without the program's name and the command.
        is_attaching: the command is `attach`: its words without dashes are URLs, and it does not listen.

    Raises:
        SettingError: the first mistake.
        SystemExit: `--help` was given, and its text is printed.
    """
    given, rest = _make_parser(is_attaching=is_attaching).parse_known_args(argv)
    strange = next((word for word in rest if word.startswith("-")), None)
    if strange is not None:
        name = strange.partition("=")[0]
        if is_attaching and name.removeprefix("--") in flags_and_variables():
            raise SettingError(f"{name}: is a flag of serve; attach has no clients of its own")
        near = hint(name, [f"--{key}" for key in flags_and_variables()])
        raise SettingError(f"no such flag: {name}{near}; --help lists them all")
    values: dict[str, object] = {}
    if is_attaching:
        urls = [*getattr(given, "urls", ()), *rest]  # words after a flag are in the rest
        if urls:
            values["attach"] = read_value("attach", urls, "attach")
        values["listen"] = False
    elif rest:
        raise SettingError(f"expected flags; got {show_value(rest[0])}")
    for name, value in vars(given).items():
        key = name.replace("_", "-")
        if key in FLAGS:
            values[key] = read_value(key, value, f"--{key}")
    return values


def _make_parser(*, is_attaching: bool) -> argparse.ArgumentParser:
    parser = Parser(
        prog=f"rosbridge-sim {'attach' if is_attaching else 'serve'}",
        usage=f"rosbridge-sim {'attach URL [URL ...]' if is_attaching else '[serve]'} [flags]",
        description=_ATTACH_TEXT if is_attaching else _SERVE_TEXT,
        epilog="Each flag is also an environment variable (--sync-lease is ROSBRIDGE_SIM_SYNC_LEASE) and a key of the"
        " TOML file (sync-lease). A flag beats the environment, the environment beats the file. In the environment,"
        f" folders are separated by {os.pathsep!r}, rates, patterns, origins and hosts by ','. The file alone has the"
        " tables [publishers], [subscribers] and [services]: --print-config writes them with the rest.",
        allow_abbrev=False,
        argument_default=argparse.SUPPRESS,
        formatter_class=layout,
    )
    if is_attaching:
        parser.add_argument("urls", nargs="*", metavar="URL", help=FLAGS["attach"].kind.expects)
    groups: dict[str, argparse._ArgumentGroup] = {}  # private, because the library has no public name for it
    for key in FLAGS:
        flag = FLAGS[key]
        if flag.kind.is_table or (is_attaching and (key == "attach" or flag.group in _OF_SERVERS)):
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
    " check a rosbridge: doctor. Each has its own --help."
)

_ATTACH_TEXT = (
    "Connect the simulator to existing rosbridges as a client, the way MORAI SIM does: it advertises its topics and"
    " services at each URL and takes commands from there. It listens on no port of its own."
)

_OF_SERVERS = (FLAGS["port"].group, FLAGS["token"].group)
"""Groups of flags about clients of this server; a simulator that does not listen has none of them."""

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
