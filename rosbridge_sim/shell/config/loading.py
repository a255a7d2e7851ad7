"""Settings of one server, merged from flags, the environment and a TOML file.

A flag has priority over the environment, the environment over the file, and the file over the default. A list is taken
completely from the first source that has one. A rate from a flag is merged with the file's entry for that publisher. A
mistake is a `SettingError` of one line with the place, the expected value and the given value. Mistakes of a file are
reported together, one per line.
The sources are read by `command_flags.py` and `settings_file.py`; `toml_output.py` writes settings.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rosbridge_sim.errors import DocumentError, SettingError
from rosbridge_sim.link.arguments import PREFIX
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.shell.config.command_flags import ServerCommand, read_flags
from rosbridge_sim.shell.config.flag_table import FIELDS, FLAGS, SHORT_FORMS
from rosbridge_sim.shell.config.keys import add_value, flags_and_variables, read_switchable, read_value, variable
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.config.settings_file import read_file
from rosbridge_sim.shell.config.value_types import SWITCH, show_size
from rosbridge_sim.suggestions import hint

if TYPE_CHECKING:  # saves `--help` a tenth of a second of imports
    from rosbridge_sim.simulator.bus.network_settings import InterfaceChoice

FindMistakes = Callable[[Settings], Sequence[str]]
"""Returns mistakes in settings that only a simulator made from them can find, one line each."""


def _find_none(_settings: Settings) -> Sequence[str]:
    return ()


def read_settings(
    argv: Sequence[str],
    environ: Mapping[str, str],
    *,
    command: ServerCommand = "serve",
    find_more: FindMistakes = _find_none,
) -> Settings:
    """Return the settings from a command line, an environment, and the file that one of them names.

    Args:
        argv: flags, without the program's name and the command.
        environ: variables. An empty one counts as absent; only an empty token is a mistake.
        command: see `read_flags`.
        find_more: called if there are mistakes already, so that all of them are reported at once.

    Raises:
        SettingError: the first mistake, or all mistakes of the file, one per line.
        SystemExit: `--help` was given, and its text is printed.
    """
    settings = _merge(find_more, read_flags(argv, command), _from_environment(environ))
    if command == "mock run" and settings.mock is None:
        raise SettingError("mock run: expected the file of a mock, such as robot.yaml")
    return settings


_WORLD_VARIABLES: Final = frozenset(PREFIX + name for name in ("CONFIG", "MAP", "SCENARIO_PATH", "CATALOGUE"))


def read_world(argv: Sequence[str]) -> Settings:
    """Return settings for commands about scenarios and maps: mistakes in variables about other things do not matter.

    Raises:
        SettingError: as for `read_settings`.
    """
    return read_settings(argv, {name: value for name, value in os.environ.items() if name in _WORLD_VARIABLES})


def check_options(options: Mapping[str, object], find_more: FindMistakes = _find_none) -> Settings:
    """Return the settings from keyword arguments. The environment is ignored; a `config` file is read.

    Args:
        options: fields of `Settings` by name.
        find_more: as for `read_settings`.

    Raises:
        SettingError: the first mistake.
    """
    values = {}
    for name, value in options.items():
        key = name.replace("_", "-")
        if key not in FLAGS:
            known = [*(one.name for one in FIELDS.values()), *SHORT_FORMS]
            raise SettingError(f"no such option: {name}{hint(name, known)}")
        is_none = value is None and key in FIELDS and FIELDS[key].default is None
        values[key] = None if is_none else read_value(key, value, name)
    return _merge(find_more, values)


def strange_variables(environ: Mapping[str, str]) -> list[str]:
    """Return a line for each variable that looks like a misspelt one of this package.

    It is only a hint, because Kubernetes sets variables with such names for each service in the namespace of a pod.
    """
    known = [variable(key) for key in flags_and_variables()]
    return [
        f"the environment variable {name} means nothing here{near}"
        for name in sorted(environ)
        if name.startswith(PREFIX) and name not in known and (near := hint(name, known, cutoff=0.9))
    ]


# Merging


def _merge(find_more: FindMistakes, *sources: Mapping[str, object]) -> Settings:
    """Return the settings of several sources, the strongest first; the file that they name comes last."""
    values: dict[str, object] = {}
    for source in reversed(sources):
        values.update(source)
    config = values.get("config")
    mistakes: list[tuple[str, DocumentError]] = []
    if isinstance(config, str):
        read, mistakes = read_file(Path(config))
        values = read | values
    rates = values.pop("rate", None)
    if rates is not None:
        values["publishers"] = _with_rates(values.get("publishers", {}), rates)
    if values.get("mock") is not None:
        values.setdefault("world", False)
    checked: dict[str, JsonValue] = {FIELDS[key].name: value for key, value in values.items()}
    settings = Settings(**checked)
    if settings.outbox_limit < settings.outbox_size and not _SIZES & {key for key, _ in mistakes}:
        text = (
            f"outbox-limit: expected at least outbox-size, {show_size(settings.outbox_size)};"
            f" got {show_size(settings.outbox_limit)}"
        )
        mistakes.append(("outbox-limit", SettingError(text)))
    if mistakes:
        raise _all_at_once(config, [*(str(error) for _, error in mistakes), *find_more(settings)])
    return settings


_SIZES = {"outbox-limit", "outbox-size"}
"""Settings that are compared with each other, if both can be read."""

MAX_CONFIG_MISTAKES = 20
"""Mistakes that are shown at once, one per line: a terminal screen."""


def _all_at_once(config: object, mistakes: Sequence[str]) -> SettingError:
    """Return an error with all mistakes in a file and between settings."""
    num_more = len(mistakes) - MAX_CONFIG_MISTAKES
    more = [f"{config}: {num_more:,} more mistakes"] if num_more > 0 else []
    return SettingError("\n".join([*mistakes[:MAX_CONFIG_MISTAKES], *more]))


def _with_rates(publishers: JsonValue, rates: JsonValue) -> dict[str, InterfaceChoice]:
    """Return the choices about publishers, changed by the given rates."""
    from rosbridge_sim.simulator.bus.network_settings import NetworkSettings  # noqa: PLC0415 - only a setting with rates needs it

    return dict(NetworkSettings(publishers=rates).over(NetworkSettings(publishers=publishers)).publishers)


# The environment


def _from_environment(environ: Mapping[str, str]) -> dict[str, object]:
    values: dict[str, object] = {}
    for key in flags_and_variables():
        name = variable(key)
        text = environ.get(name, "").strip()
        if key == "token" and name in environ and not text:
            # `TOKEN=$SECRET` with an unset SECRET must not open the server to every client
            raise SettingError(f"{name}: expected a token, or none; got an empty text")
        if not text or (key == "port" and text.startswith("tcp://")):
            continue  # Kubernetes sets such a ROSBRIDGE_SIM_PORT for a service named rosbridge-sim
        kind = SWITCH if key.startswith("no-") else FLAGS[key].kind
        value: object = text
        if kind.separator:
            value = [part for part in text.split(kind.separator) if part.strip()]
        base, checked = read_switchable(key, value, name)
        add_value(values, base, checked, name)
    return values
