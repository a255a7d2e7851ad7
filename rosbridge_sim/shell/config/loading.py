"""Where settings come from: flags, the environment, a TOML file; and how they go back into one.

A flag beats the environment, the environment beats the file, the file beats the default. A list is taken whole from
the first place that has one; a rate that a flag gives is laid over what the file says of that publisher. A mistake is
a `SettingError` of one line that says where, what was expected and what came; those of a file are told together, one a
line.
"""

from __future__ import annotations

import argparse
import logging
import os
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.config.settings import FIELDS, SHORT_FORMS, Settings, flag_of
from rosbridge_sim.shell.config.toml_text import Lines, lines_of, place_of, read_toml
from rosbridge_sim.shell.config.value_types import (
    FILE,
    FOLDER_TYPE,
    FOLDERS,
    SECRET,
    SWITCH,
    URLS,
    SettingError,
    show_size,
)
from rosbridge_sim.shell.websocket.urls import hide_in_words, shown_url
from rosbridge_sim.suggestions import hint

if TYPE_CHECKING:
    from rosbridge_sim.morai.interfaces.network_settings import InterfaceChoice, NetworkSettings
    from rosbridge_sim.morai.interfaces.registry import ListedInterface

__all__ = [
    "PREFIX",
    "Parser",
    "SettingError",
    "check_options",
    "format_config",
    "hint",
    "layout",
    "looks_like_path",
    "read_network",
    "read_settings",
    "strange_variables",
]

_log = logging.getLogger("rosbridge_sim.storage")

PREFIX = "ROSBRIDGE_SIM_"
"""What every environment variable of ours begins with."""


def read_settings(argv: Sequence[str], environ: Mapping[str, str], *, is_attaching: bool = False) -> Settings:
    """The settings of a command line, an environment, and the file that one of them names.

    Args:
        argv: flags, without the program's name and the command.
        environ: variables; an empty one counts as absent, but for the token, where it is a mistake.
        is_attaching: the command is `attach`: its words without dashes are URLs, and it does not listen.

    Raises:
        SettingError: the first mistake, or all those of the file, one a line.
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
        if key not in FIELDS and key not in SHORT_FORMS:
            known = [*(one.name for one in FIELDS.values()), *SHORT_FORMS]
            raise SettingError(f"no such option: {name}{hint(name, known)}")
        is_none = value is None and key in FIELDS and FIELDS[key].default is None
        values[key] = None if is_none else _read(key, value, name)
    return _merge(values)


def strange_variables(environ: Mapping[str, str]) -> list[str]:
    """A line for each variable that looks like a misspelt one of ours.

    That is no mistake: Kubernetes gives its pods variables of this form for each service of their namespace.
    """
    known = [_variable(key) for key in _flags()]
    return [
        f"the environment variable {name} means nothing here{near}"
        for name in sorted(environ)
        if name.startswith(PREFIX) and name not in known and (near := hint(name, known, cutoff=0.9))
    ]


def format_config(settings: Settings, items: Sequence[ListedInterface]) -> str:
    """The settings as a TOML file that gives them back, but for what is secret: that is for its owner to fill in.

    Args:
        settings: those to write.
        items: what the simulator has on the bus with these settings; it is written out whole.
    """
    lines: list[str] = []
    group = ""
    for key, field in FIELDS.items():
        flag = flag_of(key)
        value = getattr(settings, field.name)
        if key == "config" or flag.kind.is_table:
            continue
        if flag.group != group:
            group = flag.group
            lines += ["", f"# {group}"]
        choice = f" ({flag.kind.expects})" if flag.kind not in (SWITCH, FOLDERS) else ""
        shown = show_size(value) if flag.kind.sign == "SIZE" else value
        none = flag.kind.sign.rpartition("|")[2] if "|" in flag.kind.sign else "none"
        lines.append(f"# {flag.text}{choice}")
        if flag.kind is SECRET and value is not None:
            lines.append(f"# {key} is set, and is not printed: write it here, or into {_variable(key)}")
            continue
        if flag.kind is URLS and value != (bare := tuple(_bare_url(url) for url in value)):
            lines.append("# a token or a password in a URL is not printed: write it where it belongs")
            shown = bare
        lines.append(f"{key} = {_toml(none if shown is None else shown)}")
    for key in _tables():
        lines += ["", f"# {flag_of(key).text}", f"[{key}]", *_entries(key, settings, items)]
    return "\n".join([*lines[1:], ""])


def _bare_url(url: str) -> str:
    return shown_url(url) if "?" in url or "@" in url else url


def _entries(key: str, settings: Settings, items: Sequence[ListedInterface]) -> list[str]:
    """The lines of one table: all items, then what is chosen about those that are not there at present."""
    entries = {one.default: (one.name, one.rate, one.is_on) for one in items if one.kind.value == key}
    for default, choice in getattr(settings, key).items():
        entries.setdefault(default, (choice.name, choice.rate, choice.is_on))
    lines = []
    for default, values in entries.items():
        said = [f"{k} = {_toml(v)}" for k, v in zip(("name", "rate", "on"), values, strict=True) if v is not None]
        lines.append(f"{_toml(default)} = {{ {', '.join(said)} }}" if said else f"{_toml(default)} = {{}}")
    return lines


def _toml(value: object) -> str:
    """A string, number, bool or list of strings as TOML; a whole number without its point."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        plain = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + re.sub(r"[\x00-\x1f\x7f]", lambda match: f"\\u{ord(match[0]):04x}", plain) + '"'
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(one) for one in value) + "]"
    return repr(int(value) if isinstance(value, float) and value.is_integer() else value)


# What they share


def _merge(*sources: Mapping[str, object]) -> Settings:
    """The settings of several sources, the first one strongest; the file that they name is the weakest."""
    values: dict[str, object] = {}
    for source in reversed(sources):
        values.update(source)
    config = values.get("config")
    mistakes: list[tuple[str, DocumentError]] = []
    if isinstance(config, str):
        read, mistakes = _from_file(Path(config))
        values = read | values
    rates = values.pop("rate", None)
    if rates is not None:
        values["publishers"] = _with_rates(values.get("publishers", {}), rates)
    checked: dict[str, Any] = {FIELDS[key].name: value for key, value in values.items()}  # Any: each went through _read
    settings = Settings(**checked)
    if settings.outbox_limit < settings.outbox_size and not _SIZES & {key for key, _ in mistakes}:
        text = (
            f"outbox-limit: expected at least outbox-size, {show_size(settings.outbox_size)};"
            f" got {show_size(settings.outbox_limit)}"
        )
        mistakes.append(("outbox-limit", SettingError(text)))
    if mistakes:
        raise _all_at_once(config, [*(str(error) for _, error in mistakes), *_mistakes_of_items(settings)])
    return settings


_SIZES = {"outbox-limit", "outbox-size"}
"""Settings that are compared with one another, unless one of them cannot be read."""

MAX_CONFIG_MISTAKES = 20
"""Mistakes that are told at once, one a line: a screen of a terminal."""


def _all_at_once(config: object, mistakes: Sequence[str]) -> SettingError:
    """Return the error of all mistakes in a file and between settings."""
    num_more = len(mistakes) - MAX_CONFIG_MISTAKES
    more = [f"{config}: {num_more:,} more mistakes"] if num_more > 0 else []
    return SettingError("\n".join([*mistakes[:MAX_CONFIG_MISTAKES], *more]))


def _mistakes_of_items(settings: Settings) -> list[str]:
    """Return what is wrong with the choices about topics and services, which is known once there is a simulator.

    It is looked for only where there are other mistakes to tell: a simulator finds it anyhow.
    """
    if not any(getattr(settings, FIELDS[key].name) for key in _tables()):
        return []
    from rosbridge_sim.shell.app import list_items  # noqa: PLC0415 - it imports us

    try:
        list_items(settings)
    except DocumentError as error:
        return str(error).splitlines()
    return []


def _with_rates(publishers: Any, rates: Any) -> dict[str, InterfaceChoice]:  # noqa: ANN401 - both went through _read
    """What is chosen about publishers, with these rates laid over it."""
    from rosbridge_sim.morai.interfaces.network_settings import NetworkSettings  # noqa: PLC0415 - who has no rates does without

    return dict(NetworkSettings(publishers=rates).over(NetworkSettings(publishers=publishers)).publishers)


def _tables() -> list[str]:
    """The keys that are tables, which only a file has."""
    return [key for key in FIELDS if flag_of(key).kind.is_table]


def _flags() -> list[str]:
    """What can be a flag or a variable, with the no- form of switches."""
    return [*(key for key in _keys() if key not in _tables()), *SHORT_FORMS]


def _keys() -> list[str]:
    """All keys of a file, with the no- form of switches."""
    return [*FIELDS, *(f"no-{key}" for key in FIELDS if flag_of(key).kind is SWITCH)]


def _read(key: str, value: object, where: str) -> object:
    """The checked value of a setting; `where` names the place that gave it."""
    kind = flag_of(key).kind
    try:
        return _as_choices(kind.read(value), where) if key in SHORT_FORMS else kind.read(value)
    except DocumentError as error:
        raise SettingError(str(error)) from None
    except (ValueError, TypeError, KeyError, OverflowError, AttributeError):
        shown = "something else" if kind is SECRET else _show(value)
        raise SettingError(f"{where}: expected {kind.expects}; got {shown}") from None


def _as_choices(rates: Any, where: str) -> dict[str, InterfaceChoice]:  # noqa: ANN401 - what RATES reads
    """What a flag chooses about publishers."""
    from rosbridge_sim.morai.interfaces.network_settings import InterfaceChoice  # noqa: PLC0415 - as above

    return {name: InterfaceChoice(rate=rate, where=f"{where} {name}={rate:g}") for name, rate in rates.items()}


def _read_key(key: str, value: object, where: str) -> tuple[str, object]:
    """The key without its no-, and its checked value."""
    if key in FIELDS or key in SHORT_FORMS:
        return key, _read(key, value, where)
    key = key.removeprefix("no-")
    return key, not _read(key, value, where)


def _show(value: object) -> str:
    text = hide_in_words(repr(value))
    return text if len(text) <= 80 else text[:77] + "..."  # noqa: PLR2004 - a line of a terminal


# Flags


class Parser(argparse.ArgumentParser):
    """Raises where the library would print its usage and leave."""

    def error(self, message: str) -> NoReturn:
        """What the library calls at a mistake.

        Raises:
            SettingError: always.
        """
        raise SettingError(_without_values(message.removeprefix("argument ")))


_STRANGE_WORDS = "unrecognized arguments: "


def _without_values(message: str) -> str:
    """A message of the library's without words that may be secrets: of words that mean nothing, the flags alone."""
    if message.startswith(_STRANGE_WORDS):
        words = message.removeprefix(_STRANGE_WORDS).split()
        flags = [word.partition("=")[0] for word in words if word.startswith("-")]
        message = _STRANGE_WORDS + " ".join(flags or words)
    return hide_in_words(message)


def _from_flags(argv: Sequence[str], *, is_attaching: bool = False) -> dict[str, object]:
    given, rest = _make_parser(is_attaching=is_attaching).parse_known_args(argv)
    strange = next((word for word in rest if word.startswith("-")), None)
    if strange is not None:
        name = strange.partition("=")[0]
        if is_attaching and name.removeprefix("--") in _flags():
            raise SettingError(f"{name}: is a flag of serve; attach has no clients of its own")
        raise SettingError(f"no such flag: {name}{hint(name, [f'--{key}' for key in _flags()])}; --help lists them all")
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
        if key in FIELDS or key in SHORT_FORMS:
            values[key] = _read(key, value, f"--{key}")
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
        parser.add_argument("urls", nargs="*", metavar="URL", help=flag_of("attach").kind.expects)
    groups: dict[str, argparse._ArgumentGroup] = {}  # the library has no public name for it
    for key in [*FIELDS, *SHORT_FORMS]:
        flag = flag_of(key)
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
    " rosbridge-sim attach URL has the world stand behind somebody else's rosbridge, as MORAI SIM does. Other commands"
    " talk to any rosbridge: rosbridge-sim topic, service, tick, wait, schema, record; or look at files: bag, scenario,"
    " map; rosbridge-sim docs lists the documentation (--help)."
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


def _show_default(key: str) -> str:
    """The default as it stands behind a flag's help."""
    kind = flag_of(key).kind
    default = FIELDS[key].default if key in FIELDS else None
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
    for key in _flags():
        name = _variable(key)
        text = environ.get(name, "").strip()
        if key == "token" and name in environ and not text:
            # `TOKEN=$SECRET` where SECRET is not set must not open the server to everybody
            raise SettingError(f"{name}: expected a token, or none; got an empty text")
        if not text or (key == "port" and text.startswith("tcp://")):
            continue  # Kubernetes sets ROSBRIDGE_SIM_PORT so for a service named rosbridge-sim
        kind = SWITCH if key.startswith("no-") else flag_of(key).kind
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


def _from_file(path: Path) -> tuple[dict[str, object], list[tuple[str, DocumentError]]]:
    """Return what is right in a file, and its mistakes, each with the key of its setting."""
    from rosbridge_sim.morai.interfaces.network_settings import path_text  # noqa: PLC0415 - as above

    text, document = read_toml(path)
    lines = lines_of(text)
    values: dict[str, object] = {}
    mistakes: list[tuple[str, DocumentError]] = []
    for name, value in document.items():
        key = name.replace("_", "-")

        def note(error: DocumentError, key: str = key.removeprefix("no-")) -> None:
            mistakes.append((key, error))

        where = f"{path}{place_of(lines, (name,))}: {path_text((name,))}"
        try:
            _check_key(key, where)
            if key in _tables():
                _add(values, key, _read_table(key, name, value, path, lines, on_mistake=note), where)
            else:
                base, checked = _read_key(key, value, where)
                _add(values, base, _beside(base, checked, path.parent), where)
        except SettingError as error:
            note(error)
    return values, mistakes


def _check_key(key: str, where: str) -> None:
    """Check that a key of a file is a setting.

    Raises:
        SettingError: it is none.
    """
    if key == "config":
        raise SettingError(f"{where}: a settings file cannot name another one")
    if key in SHORT_FORMS:
        raise SettingError(f'{where}: expected [publishers] with lines such as "/Ego_topic" = {{ rate = 10 }}')
    if key not in _keys():
        raise SettingError(f"{where}: no such setting{hint(key, _keys())}")


def read_network(path: Path) -> NetworkSettings:
    """The network settings in a file; of a whole settings file, these alone, and the log is told so.

    Raises:
        SettingError: the first mistake.
    """
    from rosbridge_sim.morai.interfaces.network_settings import NetworkSettings, path_text  # noqa: PLC0415 - as above

    text, document = read_toml(path)
    lines = lines_of(text)
    tables: dict[str, Any] = {}  # Any: each is a table of choices
    others = []
    for name, value in document.items():
        if name in _tables():
            tables[name] = _read_table(name, name, value, path, lines)
        elif name.replace("_", "-") in _keys():
            others.append(name)
        else:
            raise SettingError(
                f"{path}{place_of(lines, (name,))}: {path_text((name,))}: expected {', '.join(_tables())}"
                f"{hint(name, _tables())}"
            )
    if others:
        _log.info("%s: passed over what is no network setting: %s", path, ", ".join(others))
    return NetworkSettings(**tables)


def _read_table(
    key: str,
    name: str,
    value: object,
    path: Path,
    lines: Lines,
    *,
    on_mistake: Callable[[DocumentError], None] | None = None,
) -> object:
    """The choices of one table of a file; errors have their lines.

    Raises:
        SettingError: the first mistake, unless `on_mistake` hears of them.
    """
    from rosbridge_sim.morai.interfaces.network_settings import InterfaceKind, path_text, read_choices  # noqa: PLC0415 - as above

    def place(keys: tuple[str, ...]) -> str:
        at = (name, *keys[1:])
        return f"{path}{place_of(lines, at)}: {path_text(at)}"

    if on_mistake is not None:
        return read_choices(InterfaceKind(key), value, place, on_mistake)
    try:
        return read_choices(InterfaceKind(key), value, place)
    except DocumentError as error:
        raise SettingError(str(error)) from None


def _beside(key: str, value: object, folder: Path) -> object:
    """The value with its paths taken from `folder`, so that a file means the same wherever the server starts."""
    if flag_of(key).kind is FOLDERS and isinstance(value, tuple):
        return tuple(str(folder / one) for one in value)
    if flag_of(key).kind in (FILE, FOLDER_TYPE) and isinstance(value, str):
        return str(folder / value)
    if key in {"scenario", "map"} and isinstance(value, str) and looks_like_path(value):
        return str(folder / value)
    return value


def looks_like_path(name: str) -> bool:
    """Whether a scenario or map is meant as a file and not as a name."""
    return "/" in name or os.sep in name or name.endswith(".json") or name in {".", ".."}
