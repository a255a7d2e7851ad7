"""Where settings come from: flags, the environment, a TOML file; and how they go back into one.

A flag beats the environment, the environment beats the file, the file beats the default. A list or a table is
taken whole from the first place that has one. Every mistake is a `SettingError` of one line that says where,
what was expected and what came.
"""

from __future__ import annotations

import argparse
import difflib
import os
import re
import shutil
import tomllib
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.settings import (
    FIELDS,
    FILE,
    FOLDER,
    FOLDERS,
    RATES,
    SECRET,
    SWITCH,
    URLS,
    Settings,
    flag_of,
    show_size,
)

__all__ = [
    "PREFIX",
    "Parser",
    "SettingError",
    "check_options",
    "format_config",
    "hint",
    "layout",
    "looks_like_path",
    "read_settings",
    "strange_variables",
]

PREFIX = "ROSBRIDGE_SIM_"
"""What every environment variable of ours begins with."""

MAX_CONFIG_SIZE = 2**20
"""A longer file holds no settings [bytes]."""


class SettingError(DocumentError):
    """A flag, a variable, a key or an option that cannot be used."""


def read_settings(argv: Sequence[str], environ: Mapping[str, str], *, is_attaching: bool = False) -> Settings:
    """The settings of a command line, an environment, and the file that one of them names.

    Args:
        argv: flags, without the program's name and the command.
        environ: variables; an empty one counts as absent.
        is_attaching: the command is `attach`: its words without dashes are URLs, and it does not listen.

    Raises:
        SettingError: the first mistake.
        SystemExit: `--help` was asked for and printed.
    """
    return _merge(_from_flags(argv, is_attaching=is_attaching), _from_environment(environ))


def check_options(options: Mapping[str, object]) -> Settings:
    """The settings of keyword arguments. The environment plays no part; a `config` file does.

    Raises:
        SettingError: the first mistake.
    """
    values = {}
    for name, value in options.items():
        key = name.replace("_", "-")
        if key not in FIELDS:
            raise SettingError(f"no such option: {name}{hint(name, [one.name for one in FIELDS.values()])}")
        values[key] = None if value is None and FIELDS[key].default is None else _read(key, value, name)
    return _merge(values)


def strange_variables(environ: Mapping[str, str]) -> list[str]:
    """A line for each variable that looks like a misspelt one of ours.

    That is no mistake: Kubernetes gives its pods variables of this form for each service of their namespace.
    """
    known = [_variable(key) for key in _keys()]
    return [
        f"the environment variable {name} means nothing here{near}"
        for name in sorted(environ)
        if name.startswith(PREFIX) and name not in known and (near := hint(name, known, cutoff=0.9))
    ]


def format_config(settings: Settings) -> str:
    """The settings as a TOML file that gives them back."""
    lines: list[str] = []
    tables: list[str] = []
    group = ""
    for key, field in FIELDS.items():
        flag = flag_of(key)
        value = getattr(settings, field.name)
        if key == "config":
            continue
        if flag.kind is RATES:
            tables += [
                "",
                f"# {flag.text}",
                f"[{key}]",
                *(f"{_toml(name)} = {_toml(hz)}" for name, hz in value.items()),
            ]
            continue
        if flag.group != group:
            group = flag.group
            lines += ["", f"# {group}"]
        choice = f" ({flag.kind.expects})" if flag.kind not in (SWITCH, FOLDERS) else ""
        shown = show_size(value) if flag.kind.sign == "SIZE" else value
        none = flag.kind.sign.rpartition("|")[2] if "|" in flag.kind.sign else "none"
        lines += [f"# {flag.text}{choice}", f"{key} = {_toml(none if shown is None else shown)}"]
    return "\n".join([*lines[1:], *tables, ""])


def _toml(value: object) -> str:
    """A string, number, bool or list of strings as TOML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        plain = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + re.sub(r"[\x00-\x1f\x7f]", lambda match: f"\\u{ord(match[0]):04x}", plain) + '"'
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(one) for one in value) + "]"
    return repr(value)


# What they share


def _merge(*sources: Mapping[str, object]) -> Settings:
    """The settings of several sources, the first one strongest; the file that they name is the weakest."""
    values: dict[str, object] = {}
    for source in reversed(sources):
        values.update(source)
    config = values.get("config")
    if isinstance(config, str):
        values = _from_file(Path(config)) | values
    checked: dict[str, Any] = {FIELDS[key].name: value for key, value in values.items()}  # Any: each went through _read
    settings = Settings(**checked)
    if settings.outbox_limit < settings.outbox_size:
        raise SettingError(
            f"outbox-limit: expected at least outbox-size, {show_size(settings.outbox_size)};"
            f" got {show_size(settings.outbox_limit)}"
        )
    return settings


def _keys() -> list[str]:
    """All keys, with the no- form of switches."""
    return [*FIELDS, *(f"no-{key}" for key in FIELDS if flag_of(key).kind is SWITCH)]


def _read(key: str, value: object, where: str) -> object:
    """The checked value of a setting; `where` names the place that gave it."""
    kind = flag_of(key).kind
    try:
        return kind.read(value)
    except (ValueError, TypeError, KeyError, OverflowError, AttributeError):
        shown = "something else" if kind is SECRET else _show(value)
        if kind is URLS:
            shown = re.sub(r"\?[^'\"]*|//[^'\"/@]*@", "?...", shown)  # a token may stand there, or a password
        raise SettingError(f"{where}: expected {kind.expects}; got {shown}") from None


def _read_key(key: str, value: object, where: str) -> tuple[str, object]:
    """The key without its no-, and its checked value."""
    if key in FIELDS:
        return key, _read(key, value, where)
    key = key.removeprefix("no-")
    return key, not _read(key, value, where)


def _show(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."  # noqa: PLR2004 - a line of a terminal


def hint(name: str, known: Collection[str], cutoff: float = 0.7) -> str:
    """` (did you mean ...?)`, or nothing where no known name comes near."""
    close = difflib.get_close_matches(name, sorted(known), n=1, cutoff=cutoff)
    return f" (did you mean {close[0]}?)" if close else ""


# Flags


class Parser(argparse.ArgumentParser):
    """Raises where the library would print its usage and leave."""

    def error(self, message: str) -> NoReturn:
        """What the library calls at a mistake.

        Raises:
            SettingError: always.
        """
        raise SettingError(message.removeprefix("argument "))


def _from_flags(argv: Sequence[str], *, is_attaching: bool = False) -> dict[str, object]:
    given, rest = _make_parser(is_attaching=is_attaching).parse_known_args(argv)
    strange = next((word for word in rest if word.startswith("-")), None)
    if strange is not None:
        name = strange.partition("=")[0]
        raise SettingError(f"no such flag: {name}{hint(name, [f'--{key}' for key in _keys()])}; --help lists them all")
    values: dict[str, object] = {}
    if is_attaching:
        urls = [*getattr(given, "urls", ()), *rest]  # what stands behind a flag is in the rest
        if urls:
            values["attach"] = _read("attach", urls, "attach")
        values["listen"] = False
    elif rest:
        raise SettingError(f"expected flags; got {_show(rest[0])}")
    for name, value in vars(given).items():
        key = name.replace("_", "-")
        if key in FIELDS:
            values[key] = _read(key, value, f"--{key}")
    return values


def _make_parser(*, is_attaching: bool) -> argparse.ArgumentParser:
    parser = Parser(
        prog=f"rosbridge-sim {'attach' if is_attaching else 'serve'}",
        usage=f"rosbridge-sim {'attach URL [URL ...]' if is_attaching else '[serve]'} [flags]",
        description=_ATTACH_TEXT if is_attaching else _SERVE_TEXT,
        epilog="Each flag is also an environment variable (--sync-lease is ROSBRIDGE_SIM_SYNC_LEASE) and a key of the"
        " TOML file (sync-lease). A flag beats the environment, the environment beats the file. In the environment,"
        f" folders are separated by {os.pathsep!r}, rates, patterns and origins by ','.",
        allow_abbrev=False,
        argument_default=argparse.SUPPRESS,
        formatter_class=layout,
    )
    if is_attaching:
        parser.add_argument("urls", nargs="*", metavar="URL", help=flag_of("attach").kind.expects)
    groups: dict[str, argparse._ArgumentGroup] = {}  # the library has no public name for it
    for key, field in FIELDS.items():
        flag = flag_of(key)
        if is_attaching and (key == "attach" or flag.group in _OF_SERVERS):
            continue
        if flag.group not in groups:
            groups[flag.group] = parser.add_argument_group(flag.group)
        group = groups[flag.group]
        text = f"{flag.text}{_show_default(key, field.default)}".replace("%", "%%")
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
    " rosbridge-sim attach URL has the world stand behind somebody else's rosbridge, as MORAI SIM does. Other commands"
    " look at any rosbridge: rosbridge-sim topic, service, schema, record, bag (see --help)."
)

_ATTACH_TEXT = (
    "The driving world behind somebody else's rosbridge, as MORAI SIM itself stands there: it dials each URL,"
    " advertises its topics and services there and takes commands from there. It listens on no port of its own."
)

_OF_SERVERS = (flag_of("port").group, flag_of("token").group)
"""Groups of flags about clients of ours: who does not listen has none."""

_ASIDES = {
    "print-config": "print all settings as a TOML file and exit",
    "version": "print the version and exit",
}
"""Flags that are no settings: the command line looks for them itself."""


def layout(prog: str) -> argparse.HelpFormatter:
    """How all our help looks."""
    return argparse.HelpFormatter(prog, max_help_position=28, width=min(shutil.get_terminal_size().columns, 110))


def _show_default(key: str, default: object) -> str:
    """The default as it stands behind a flag's help."""
    kind = flag_of(key).kind
    if kind is SWITCH or kind.separator or key == "config":
        return f" [{'on' if default else 'off'}]" if kind is SWITCH else ""
    if default is None:
        return f" [{kind.sign.rpartition('|')[2] if '|' in kind.sign else 'none'}]"
    if isinstance(default, float):
        return f" [{default:g}]"
    return f" [{show_size(default) if kind.sign == 'SIZE' and isinstance(default, int) else default}]"


# The environment


def _variable(key: str) -> str:
    return PREFIX + key.upper().replace("-", "_")


def _from_environment(environ: Mapping[str, str]) -> dict[str, object]:
    values: dict[str, object] = {}
    for key in _keys():
        name = _variable(key)
        text = environ.get(name, "").strip()
        if not text or (key == "port" and text.startswith("tcp://")):
            continue  # Kubernetes sets ROSBRIDGE_SIM_PORT so for a service named rosbridge-sim
        kind = flag_of(key).kind if key in FIELDS else SWITCH
        value: object = text
        if kind.separator:
            value = [part for part in text.split(kind.separator) if part.strip()]
        base, checked = _read_key(key, value, name)
        _add(values, base, checked, name)
    return values


def _add(values: dict[str, object], key: str, value: object, where: str) -> None:
    """Add what one place says; `world` and `no-world` in one place may agree but not differ."""
    if values.setdefault(key, value) != value:
        raise SettingError(f"{where}: {key} and no-{key} contradict each other")


# The file


def _from_file(path: Path) -> dict[str, object]:
    text = _read_text(path)
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        message, where = _split_place(str(error))
        raise SettingError(f"{path}{where}: not valid TOML: {message}") from None
    values: dict[str, object] = {}
    for name, value in document.items():
        key = name.replace("_", "-")
        where = f"{path}{_place_of(text, name)}: {name}"
        if key == "config":
            raise SettingError(f"{where}: a settings file cannot name another one")
        if key not in _keys():
            raise SettingError(f"{where}: no such setting{hint(key, _keys())}")
        base, checked = _read_key(key, value, where)
        _add(values, base, _beside(base, checked, path.parent), where)
    return values


def _read_text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(MAX_CONFIG_SIZE + 1)
    except OSError as error:
        raise SettingError(f"{path}: cannot be read: {error.strerror}") from None
    if len(content) > MAX_CONFIG_SIZE:
        raise SettingError(f"{path}: expected a settings file; it is longer than {show_size(MAX_CONFIG_SIZE)}")
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise SettingError(f"{path}:{line}: expected UTF-8 text") from None


_PLACE = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")


def _split_place(message: str) -> tuple[str, str]:
    """What tomllib says, and where, as `:line:column`; it puts both into one text."""
    match = _PLACE.search(message)
    if match is None:
        return message, ""
    line, column = match.groups()
    text = message[: match.start()]
    return (text, f":{line}:{column}") if line else (f"{text} at its end", "")


def _place_of(text: str, name: str) -> str:
    """`:line` of a key or table in a TOML text; nothing where it is written in a way that is hard to find."""
    match = re.search(rf"^[ \t]*\[?[ \t]*[\"']?{re.escape(name)}[\"']?[ \t]*[\]=.]", text, re.MULTILINE)
    return f":{text.count(chr(10), 0, match.start()) + 1}" if match else ""


def _beside(key: str, value: object, folder: Path) -> object:
    """The value with its paths taken from `folder`, so that a file means the same wherever the server starts."""
    if flag_of(key).kind is FOLDERS and isinstance(value, tuple):
        return tuple(str(folder / one) for one in value)
    if flag_of(key).kind in (FILE, FOLDER) and isinstance(value, str):
        return str(folder / value)
    if key in {"scenario", "map"} and isinstance(value, str) and looks_like_path(value):
        return str(folder / value)
    return value


def looks_like_path(name: str) -> bool:
    """Whether a scenario or map is meant as a file and not as a name."""
    return "/" in name or os.sep in name or name.endswith(".json") or name in {".", ".."}
