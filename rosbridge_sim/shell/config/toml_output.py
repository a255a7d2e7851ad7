"""Settings as a TOML file, for `--print-config`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rosbridge_sim.link.urls import shown_url
from rosbridge_sim.shell.config.flag_table import FIELDS, FLAGS
from rosbridge_sim.shell.config.keys import tables, variable
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.config.value_types import FOLDERS, SECRET, SWITCH, URLS, show_size

if TYPE_CHECKING:  # saves `--help` a tenth of a second of imports
    from rosbridge_sim.simulator.bus.interface_registry import ListedInterface


def format_config(settings: Settings, items: Sequence[ListedInterface]) -> str:
    """Return the settings as a TOML file that can be read again; secrets are left out and must be added by the user.

    Args:
        items: topics and services of a simulator with these settings; all of them are written.
    """
    lines: list[str] = []
    group = ""
    for key, field in FIELDS.items():
        flag = FLAGS[key]
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
            lines.append(f"# {key} is set, and is not printed: write it here, or into {variable(key)}")
            continue
        if flag.kind is URLS and value != (bare := tuple(_bare_url(url) for url in value)):
            lines.append("# a token or a password in a URL is not printed: add it to the URL here")
            shown = bare
        lines.append(f"{key} = {_toml(none if shown is None else shown)}")
    for key in tables():
        lines += ["", f"# {FLAGS[key].text}", f"[{key}]", *_entries(key, settings, items)]
    return "\n".join([*lines[1:], ""])


def _bare_url(url: str) -> str:
    return shown_url(url) if "?" in url or "@" in url else url


def _entries(key: str, settings: Settings, items: Sequence[ListedInterface]) -> list[str]:
    """Return the lines of one table: all present items, then the choices about absent ones."""
    entries = {one.default: (one.name, one.rate, one.is_on) for one in items if one.kind.value == key}
    for default, choice in getattr(settings, key).items():
        entries.setdefault(default, (choice.name, choice.rate, choice.is_on))
    lines = []
    for default, values in entries.items():
        said = [f"{k} = {_toml(v)}" for k, v in zip(("name", "rate", "on"), values, strict=True) if v is not None]
        lines.append(f"{_toml(default)} = {{ {', '.join(said)} }}" if said else f"{_toml(default)} = {{}}")
    return lines


def _toml(value: object) -> str:
    """Return a string, number, bool or list of strings as TOML; a whole number without a decimal point."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        plain = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + re.sub(r"[\x00-\x1f\x7f]", lambda match: f"\\u{ord(match[0]):04x}", plain) + '"'
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(one) for one in value) + "]"
    return repr(int(value) if isinstance(value, float) and value.is_integer() else value)
