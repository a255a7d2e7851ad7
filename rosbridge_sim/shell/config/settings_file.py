"""Settings from a TOML file, or from a network file of MORAI. Each mistake names the file and the line."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

import orjson

from rosbridge_sim.errors import DocumentError, SettingError
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.shell.config.flag_table import FLAGS, SHORT_FORMS
from rosbridge_sim.shell.config.keys import add_value, keys, read_switchable, tables
from rosbridge_sim.shell.config.toml_text import Lines, lines_of, place_of, read_text, read_toml
from rosbridge_sim.shell.config.value_types import FILE, FOLDER_TYPE, FOLDERS
from rosbridge_sim.suggestions import hint

if TYPE_CHECKING:  # saves `--help` a tenth of a second of imports
    from rosbridge_sim.simulator.bus.network_settings import NetworkSettings

JSON_SUFFIX: Final = ".json"
"""End of the name of a network file of MORAI."""

MAX_UNUSED: Final = 20
"""Unused parts of such a file that are listed; the rest is counted."""

_log = logging.getLogger("rosbridge_sim.storage")


def read_file(path: Path) -> tuple[dict[str, object], list[tuple[str, DocumentError]]]:
    """Return the valid settings of a file, and its mistakes, each with the key of its setting."""
    from rosbridge_sim.simulator.bus.network_settings import path_text  # noqa: PLC0415 - see above

    values: dict[str, object] = {}
    mistakes: list[tuple[str, DocumentError]] = []
    if path.suffix.lower() == JSON_SUFFIX:
        network = _read_morai(path)
        return {key: dict(getattr(network, key)) for key in tables() if getattr(network, key)}, mistakes
    text, document = read_toml(path)
    lines = lines_of(text)
    for name, value in document.items():
        key = name.replace("_", "-")

        def note(error: DocumentError, key: str = key.removeprefix("no-")) -> None:
            mistakes.append((key, error))

        where = f"{path}{place_of(lines, (name,))}: {path_text((name,))}"
        try:
            _check_key(key, where)
            if key in tables():
                add_value(values, key, _read_table(key, value, path, lines, note), where)
            else:
                base, checked = read_switchable(key, value, where)
                add_value(values, base, _beside(base, checked, path.parent), where)
        except SettingError as error:
            note(error)
    return values, mistakes


def _check_key(key: str, where: str) -> None:
    """Check that a key of a file is a setting.

    Raises:
        SettingError: it is not.
    """
    if key == "config":
        raise SettingError(f"{where}: a settings file cannot name another settings file")
    if key in SHORT_FORMS:
        raise SettingError(f'{where}: expected [publishers] with lines such as "/Ego_topic" = {{ rate = 10 }}')
    if key not in keys():
        raise SettingError(f"{where}: no such setting{hint(key, keys())}")


def _read_morai(path: Path) -> NetworkSettings:
    """Return the settings of a network file of MORAI; log what in it is not used.

    Raises:
        SettingError: it is not such a file, or has a mistake.
    """
    from rosbridge_sim.simulator.bus.morai_network import is_morai_network, read_morai_network  # noqa: PLC0415 - see above

    try:
        document = orjson.loads(read_text(path))
    except orjson.JSONDecodeError as error:
        raise SettingError(f"{path}:{error.lineno}:{error.colno}: not valid JSON: {error.msg}") from None
    if not is_morai_network(document):
        raise SettingError(f"{path}: expected a network file of MORAI with a list egoNetworkData, or a TOML file")
    try:
        network, unused = read_morai_network(document, str(path))
    except DocumentError as error:
        raise SettingError(str(error)) from None
    if unused:
        more = f" and {len(unused) - MAX_UNUSED} more" if len(unused) > MAX_UNUSED else ""
        _log.warning("%s: not used here: %s%s", path, ", ".join(unused[:MAX_UNUSED]), more)
    return network


def read_network(path: Path) -> NetworkSettings:
    """Return the network settings in a file of ours or of MORAI.

    In a complete settings file, other keys are ignored and logged.

    Raises:
        SettingError: the first mistake.
    """
    from rosbridge_sim.simulator.bus.network_settings import NetworkSettings  # noqa: PLC0415 - see above

    values, mistakes = read_file(path)
    own = [error for key, error in mistakes if key in tables() or key not in keys()]
    if own:
        raise SettingError(str(own[0]))
    others = [key for key in values if key not in tables()]
    if others:
        _log.info("%s: ignored keys that are not network settings: %s", path, ", ".join(others))
    choices: dict[str, JsonValue] = {key: values[key] for key in tables() if key in values}
    return NetworkSettings(**choices)


def _read_table(
    key: str, value: object, path: Path, lines: Lines, on_mistake: Callable[[DocumentError], None]
) -> object:
    """Return the choices of one table of a file; mistakes name the line."""
    from rosbridge_sim.simulator.bus.network_settings import InterfaceKind, path_text, read_choices  # noqa: PLC0415 - see above

    def place(keys: tuple[str, ...]) -> str:
        return f"{path}{place_of(lines, keys)}: {path_text(keys)}"

    return read_choices(InterfaceKind(key), value, place, on_mistake)


def _beside(key: str, value: object, folder: Path) -> object:
    """Return a value with its paths relative to `folder`, so that the server's working directory does not matter."""
    if FLAGS[key].kind is FOLDERS and isinstance(value, tuple):
        return tuple(str(folder / one) for one in value)
    if FLAGS[key].kind in (FILE, FOLDER_TYPE) and isinstance(value, str):
        return str(folder / value)
    if key in {"scenario", "map", "sensor_noise", "sensors"} and isinstance(value, str) and looks_like_path(value):
        return str(folder / value)
    if key == "sensors" and isinstance(value, str) and value.endswith(".toml"):
        return str(folder / value)
    return value


def looks_like_path(name: str) -> bool:
    """Return True if a scenario or map is given as a path, not as a name."""
    return "/" in name or os.sep in name or name.endswith((".json", ".xosc", ".xodr")) or name in {".", ".."}
