"""The types of values of settings, and their checks, which are the same for all sources.

The checks are a few functions of this module. pydantic-settings was measured and not chosen: it adds a tenth of a
second to a start that may take one, reads `--no-world` the wrong way round, needs lists in JSON, and reports a typing
mistake in the file with a traceback.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast
from urllib.parse import urlsplit

from rosbridge_sim.graph.gateway.quality import PROFILES, read_choice
from rosbridge_sim.graph.ros2.ros2_names import is_name
from rosbridge_sim.link.urls import DEFAULT_PORT, check_url


@dataclass(frozen=True, slots=True)
class ValueType:
    """The values that a setting accepts.

    Attributes:
        expects: description of valid values, to follow "expected".
        read: converts text, or a value of a TOML file or of Python; raises ValueError or TypeError.
        sign: placeholder for the value in `--help`.
        separator: separates several values in the environment; the flag may then be repeated. Empty for a single value.
        is_table: it is a table of the file, too large for a flag or a variable.
        accepts: type of the values from Python; empty for that of the setting.
    """

    expects: str
    read: Callable[[object], object]
    sign: str
    separator: str = ""
    is_table: bool = False
    accepts: str = ""


def text_of(expects: str, sign: str, accepts: str = "str | Path") -> ValueType:
    """Return the type of any text that is not empty.

    Args:
        expects: description of valid values.
        sign: placeholder in `--help`.
        accepts: as of `ValueType`.
    """

    def read(value: object) -> str:
        if isinstance(value, Path):
            value = str(value)
        if not isinstance(value, str) or not value or "\0" in value:
            raise ValueError
        return value

    return ValueType(expects, read, sign, accepts=accepts)


def choice_of(*words: str) -> ValueType:
    """Return the type of one of some words."""

    def read(value: object) -> str:
        if value not in words:
            raise ValueError
        return str(value)

    return ValueType(" or ".join(words), read, "|".join(words))


_SWITCH_WORDS = {
    **dict.fromkeys(("true", "yes", "on", "1"), True),
    **dict.fromkeys(("false", "no", "off", "0"), False),
}


def _read_switch(value: object) -> bool:
    if isinstance(value, bool):
        return value
    return _SWITCH_WORDS[cast("str", value).strip().lower()]  # a value that is not text raises, as it should


SWITCH = ValueType("true or false", _read_switch, "")


def _number_of(value: object, as_type: type[int | float]) -> float:
    """Return a number from a text or a number; a bool, NaN, or a fraction for a whole number is refused."""
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise TypeError
    number = as_type(value)
    if number != number or (not isinstance(value, str) and number != value):  # noqa: PLR0124 - only NaN differs from itself
        raise ValueError
    return number


def _within(low: float, high: float, as_type: type[int | float] = float) -> Callable[[object], Any]:
    """Return a function that reads a number within limits."""

    def read(value: object) -> int | float:
        number = as_type(_number_of(value, as_type))
        if not low <= number <= high:
            raise ValueError
        return number

    return read


def whole_number(low: int, high: int, sign: str = "N") -> ValueType:
    """Return the type of a whole number within limits.

    Args:
        sign: placeholder in `--help`.
    """
    return ValueType(f"a whole number from {low:,} to {high:,}", _within(low, high, int), sign)


def seconds(high: float) -> ValueType:
    """Return the type of a duration; 0 and the word none mean None.

    Args:
        high: largest value [s].
    """
    return _up_to(high, "seconds")


def metres(high: float) -> ValueType:
    """Return the type of a distance; 0 and the word none mean None.

    Args:
        high: largest value [m].
    """
    return _up_to(high, "metres")


def _up_to(high: float, unit: str) -> ValueType:
    read_number = _within(0, high)

    def read(value: object) -> float | None:
        return None if value is None or _is_word(value, "none", "off") else read_number(value) or None

    return ValueType(f"{unit} up to {high:,g}, or none", read, unit.upper())


def period(low: float, high: float) -> ValueType:
    """Return the type of a duration that cannot be None.

    Args:
        low: smallest value [s].
        high: largest value [s].
    """
    return ValueType(f"seconds from {low:g} to {high:,g}", _within(low, high), "SECONDS")


def factor(low: float, high: float) -> ValueType:
    """A factor within bounds, or 0."""

    def read(value: object) -> float:
        number = float(_number_of(value, float))
        if number and not low <= number <= high:
            raise ValueError
        return number

    return ValueType(f"a number from {low:g} to {high:g}, or 0", read, "FACTOR")


MAX_SHARE = 1e6
"""Largest share, so that sums of shares stay exact enough."""


def shares(sign: str) -> ValueType:
    """Return the type of a few shares, which are kept as one text such as `1,2.5,0`; not all of them may be 0.

    Args:
        sign: placeholder in `--help`: their names, with commas between them.
    """
    num = len(sign.split(","))

    def read(value: object) -> str:
        parts = value.split(",") if isinstance(value, str) else list(cast("Sequence[object]", value))
        numbers = [_number_of(part, float) for part in parts]
        if len(numbers) != num or not all(0 <= number <= MAX_SHARE for number in numbers) or not any(numbers):
            raise ValueError
        return ",".join(f"{number:.12g}" for number in numbers)

    return ValueType(
        f"{num} numbers up to {MAX_SHARE:,.0f} with commas between them, not all 0",
        read,
        sign,
        accepts="Sequence[float] | str",
    )


def or_none(kind: ValueType, word: str) -> ValueType:
    """Return a type that also accepts a word for None."""

    def read(value: object) -> object:
        return None if value is None or _is_word(value, word) else kind.read(value)

    accepts = kind.accepts and f"{kind.accepts} | None"
    return ValueType(f"{kind.expects}, or {word}", read, f"{kind.sign}|{word}", accepts=accepts)


def _is_word(value: object, *words: str) -> bool:
    return isinstance(value, str) and value.strip().lower() in words


FILE = or_none(text_of("a file", "FILE"), "none")

FOLDER_TYPE = text_of("a folder", "DIR")

_SIZE = re.compile(r"(\d+(?:\.\d+)?)\s*(?:([kmg])(i)?)?b?", re.IGNORECASE)


def size(low: int, high: int) -> ValueType:
    """Return the type of a size within limits.

    Args:
        low: smallest value [bytes].
        high: largest value [bytes].
    """

    def read(value: object) -> int:
        size = _size_of(value) if isinstance(value, str) else int(_number_of(value, int))
        if not low <= size <= high:
            raise ValueError
        return size

    return ValueType(
        f"a size from {show_size(low)} to {show_size(high)}, such as 16MiB", read, "SIZE", accepts="int | str"
    )


def _size_of(text: str) -> int:
    match = _SIZE.fullmatch(text.strip())
    if match is None:
        raise ValueError
    number, prefix, is_binary = match.groups()
    power = "kmg".index(prefix.lower()) + 1 if prefix else 0
    return int(float(number) * (1024 if is_binary else 1000) ** power)


def show_size(size: int) -> str:
    """Return a size in the form that people write and that the check reads.

    Args:
        size: size [bytes].
    """
    for prefix, factor in (("GiB", 2**30), ("MiB", 2**20), ("KiB", 2**10)):
        if size and size % factor == 0:
            return f"{size // factor}{prefix}"
    return str(size)


def _read_folders(value: object) -> tuple[str, ...]:
    if isinstance(value, (str, Path)):
        value = [value]
    folders = tuple(os.fspath(folder) for folder in cast("Sequence[str]", value))
    if not all(isinstance(folder, str) and folder and "\0" not in folder for folder in folders):
        raise ValueError
    return folders


FOLDERS = ValueType("folders", _read_folders, "DIR", os.pathsep, accepts="Sequence[str | Path] | str | Path")


def _patterns_of(expects: str, sign: str, is_right: Callable[[str], object] = bool) -> ValueType:
    """Return the type of several texts without blanks.

    Args:
        expects, sign: as of `ValueType`.
        is_right: tells whether one of them may be such a text; it may raise ValueError instead.
    """

    def read(value: object) -> tuple[str, ...]:
        texts = [value] if isinstance(value, str) else cast("Sequence[str]", value)
        found = tuple(text.strip() for text in texts)
        if not all(text.isprintable() and text and " " not in text and is_right(text) for text in found):
            raise ValueError
        return found

    return ValueType(expects, read, sign, ",")


def _read_assignments(value: object) -> tuple[str, ...]:
    texts = (value,) if isinstance(value, str) else tuple(cast("Sequence[str]", value))
    if not all(text.partition("=")[0].strip() and "=" in text and text.isprintable() for text in texts):
        raise ValueError
    return texts


ASSIGNMENTS = ValueType("assignments NAME=VALUE", _read_assignments, "NAME=VALUE", "\n")

PATTERNS = _patterns_of("patterns without blanks, such as /camera/*", "PATTERN")

ORIGINS = _patterns_of("origins without blanks, such as https://*.example.org", "ORIGIN")

HOSTS = _patterns_of("host names without blanks, such as sim or *.lab.example", "HOST", {"/", "@"}.isdisjoint)


def _name_of(example: str, *, may_be_empty: bool = False) -> ValueType:
    def read(value: object) -> str:
        name = cast("str", value).strip().rstrip("/")  # a value that is not text raises, as it should
        if not is_name(name) and (name or not may_be_empty):
            raise ValueError
        return name

    return ValueType(f"an absolute name of ROS, such as {example}", read, "NAME")


NAMESPACE = _name_of("/sim1", may_be_empty=True)

NODE_NAME = _name_of("/rosbridge_sim")


def _read_master(value: object) -> str:
    text = cast("str", value).strip()
    if text != "env":
        parts = urlsplit(text)
        if parts.scheme != "http" or not parts.hostname or not parts.port or parts.path.strip("/"):
            raise ValueError
    return text


MASTER = or_none(ValueType("http://HOST:PORT or env", _read_master, "URL|env"), "none")


_PROFILES = " or ".join(PROFILES)
QUALITIES = _patterns_of(
    f"PATTERN=PROFILE with the profile {_PROFILES}, such as /camera*=sensor_data", "PATTERN=PROFILE", read_choice
)

_FRAME = re.compile(
    r"https?://(?:\*\.)?[\w.-]+(?::(?:[0-9]{1,5}|\*))?|https?://\[[0-9a-fA-F:.]+\](?::[0-9]{1,5})?", re.ASCII
)
"""A source of the Content-Security-Policy with a scheme; nothing else may enter that header."""

FRAMES = _patterns_of("origins of web pages, such as https://*.example.org", "ORIGIN", _FRAME.fullmatch)


def _read_urls(value: object) -> tuple[str, ...]:
    texts = [value] if isinstance(value, str) else cast("Sequence[str]", value)
    urls = tuple(check_url(text) for text in texts)
    if len(set(urls)) < len(urls):
        raise ValueError
    return urls


URLS = ValueType(f"URLs of rosbridges, each once, such as ws://192.168.0.5:{DEFAULT_PORT}", _read_urls, "URL", ",")


def _read_token(value: object) -> str:
    if not isinstance(value, str) or not re.fullmatch(r"[!-~]+", value):
        raise ValueError
    return value


SECRET = or_none(ValueType("printable ASCII without blanks", _read_token, "TOKEN"), "none")


def _read_rates(value: object) -> dict[str, float]:
    if not isinstance(value, Mapping):
        texts = [value] if isinstance(value, str) else cast("Sequence[str]", value)
        value = dict(text.split("=") for text in texts)
    rates = {}
    for name, text in value.items():
        rate = float(_number_of(text, float))
        if not isinstance(name, str) or not name.strip() or not 0 < rate <= _MAX_RATE:
            raise ValueError
        rates["/" + name.strip().removeprefix("/")] = rate
    return rates


_MAX_RATE = 120
"""Largest rate in MORAI's own panel [Hz]."""

_RATES = "Mapping[str, float] | Sequence[str] | str"
RATES = ValueType(
    f"TOPIC=HZ with at most {_MAX_RATE} Hz, such as /Ego_topic=10", _read_rates, "TOPIC=HZ", ",", accepts=_RATES
)


def item_choices(name: str) -> ValueType:
    """Return the type of a table of choices about publishers, subscribers or services."""

    def read(value: object) -> object:
        # Imported here because only a setting with such a table needs it.
        from rosbridge_sim.simulator.bus.network_settings import InterfaceKind, read_choices  # noqa: PLC0415

        return read_choices(InterfaceKind(name), value)

    return ValueType(f"a table of {name}", read, "", is_table=True, accepts="Mapping[str, object]")
