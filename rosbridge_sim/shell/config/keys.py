"""Keys of settings for each source (flags, environment, file), and the check of one value."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rosbridge_sim.errors import DocumentError, SettingError
from rosbridge_sim.link.arguments import PREFIX
from rosbridge_sim.link.urls import hide_in_words
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.shell.config.flag_table import FIELDS, FLAGS, SHORT_FORMS
from rosbridge_sim.shell.config.value_types import SECRET, SWITCH

if TYPE_CHECKING:  # saves `--help` a tenth of a second of imports
    from rosbridge_sim.simulator.bus.network_settings import InterfaceChoice


def tables() -> list[str]:
    """Return the keys that are tables, which only a file can have."""
    return [key for key in FIELDS if FLAGS[key].kind.is_table]


def flags_and_variables() -> list[str]:
    """Return the keys that can be a flag or a variable, with the no- form of switches."""
    of_files = tables()
    return [*(key for key in keys() if key not in of_files), *SHORT_FORMS]


def keys() -> list[str]:
    """Return all keys of a file, with the no- form of switches."""
    return [*FIELDS, *(f"no-{key}" for key in FIELDS if FLAGS[key].kind is SWITCH)]


def variable(key: str) -> str:
    """Return the name of a key's environment variable."""
    return PREFIX + key.upper().replace("-", "_")


def read_value(key: str, value: object, where: str) -> object:
    """Return the checked value of a setting.

    Args:
        where: place of the value, for errors.

    Raises:
        SettingError: the value is not valid.
    """
    kind = FLAGS[key].kind
    try:
        return _as_choices(kind.read(value), where) if key in SHORT_FORMS else kind.read(value)
    except DocumentError as error:
        raise SettingError(str(error)) from None
    except (ValueError, TypeError, KeyError, OverflowError, AttributeError):
        shown = show_value(value) if kind is not SECRET else "an empty text" if value == "" else "something else"
        raise SettingError(f"{where}: expected {kind.expects}; got {shown}") from None


def _as_choices(rates: JsonValue, where: str) -> dict[str, InterfaceChoice]:
    """Return the choices about publishers from a flag."""
    from rosbridge_sim.simulator.bus.network_settings import InterfaceChoice  # noqa: PLC0415 - see above

    return {name: InterfaceChoice(rate=rate, where=f"{where} {name}={rate:g}") for name, rate in rates.items()}


def read_switchable(key: str, value: object, where: str) -> tuple[str, object]:
    """Return a key without its no-, and the checked value.

    Args:
        key: key of the setting, perhaps with no-.
        where: place of the value, for errors.

    Raises:
        SettingError: the value is not valid.
    """
    if key in FLAGS:
        return key, read_value(key, value, where)
    key = key.removeprefix("no-")
    return key, not read_value(key, value, where)


def show_value(value: object) -> str:
    """Return a value for an error text: shortened, and without the secrets of a URL."""
    text = hide_in_words(repr(value))
    return text if len(text) <= 80 else text[:77] + "..."  # noqa: PLR2004 - a line of a terminal


def add_value(values: dict[str, object], key: str, value: object, where: str) -> None:
    """Add a value from one place. `world` and `no-world` in one place must not contradict each other.

    Args:
        values: values by key; changed.
        key: key of the setting, perhaps with no-.
        where: place of the value, for errors.

    Raises:
        SettingError: the value is not valid, or contradicts an earlier one.
    """
    if values.setdefault(key, value) != value:
        raise SettingError(f"{where}: {key} and no-{key} contradict each other")
