"""All that can be set, and how each value is checked.

`Settings` is the only list. Each field carries its flag's group, check and help, and from that one place come
the command line, the names of environment variables, the keys of the file and what `--print-config` writes
(`sources.py` reads and writes those).

The checks are a few functions of our own. pydantic-settings was measured and turned down: it adds a tenth of a
second to a start that may take one, reads `--no-world` backwards, wants lists in JSON and answers a slip in the
file with a traceback.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar, cast

from rosbridge_sim.errors import DocumentError

if TYPE_CHECKING:
    from rosbridge_sim.morai.network_settings import Choice

from rosbridge_sim.shell.urls import DEFAULT_PORT, check_url

__all__ = [
    "FIELDS",
    "FILE",
    "FOLDER",
    "FOLDERS",
    "RATES",
    "SECRET",
    "SHORT_FORMS",
    "SWITCH",
    "URLS",
    "Flag",
    "Kind",
    "SettingError",
    "Settings",
    "flag_of",
    "show_size",
]

T = TypeVar("T")


class SettingError(DocumentError):
    """A flag, a variable, a key or an option that cannot be used."""


# How a value is checked


@dataclass(frozen=True, slots=True)
class Kind:
    """What values a setting takes.

    Attributes:
        expects: what a person should write, to stand after "expected".
        read: text, or a value of a TOML file or of Python -> the value; raises ValueError or TypeError.
        sign: how the value is called in `--help`.
        separator: of the parts of a value in the environment; the flag may then be repeated. Empty where there is one.
        is_table: it is a table of the file, and too much for a flag or a variable.
    """

    expects: str
    read: Callable[[object], object]
    sign: str
    separator: str = ""
    is_table: bool = False


def _text(expects: str, sign: str) -> Kind:
    def read(value: object) -> str:
        if isinstance(value, Path):
            value = str(value)
        if not isinstance(value, str) or not value or "\0" in value:
            raise ValueError
        return value

    return Kind(expects, read, sign)


def _choice(*words: str) -> Kind:
    def read(value: object) -> str:
        if value not in words:
            raise ValueError
        return str(value)

    return Kind(" or ".join(words), read, "|".join(words))


_SWITCH_WORDS = {
    "true": True,
    "yes": True,
    "on": True,
    "1": True,
    "false": False,
    "no": False,
    "off": False,
    "0": False,
}


def _read_switch(value: object) -> bool:
    if isinstance(value, bool):
        return value
    return _SWITCH_WORDS[cast("str", value).strip().lower()]  # anything but text raises, as it should


SWITCH = Kind("true or false", _read_switch, "")


def _number_of(value: object, as_type: type[int | float]) -> float:
    """A number from text or from a number; a bool, a fraction where a whole number belongs, and NaN are none."""
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise TypeError
    number = as_type(value)
    if number != number or (not isinstance(value, str) and number != value):  # noqa: PLR0124 - only NaN differs from itself
        raise ValueError
    return number


def _whole(low: int, high: int, sign: str = "N") -> Kind:
    def read(value: object) -> int:
        number = int(_number_of(value, int))
        if not low <= number <= high:
            raise ValueError
        return number

    return Kind(f"a whole number from {low:,} to {high:,}", read, sign)


def _seconds(high: float) -> Kind:
    """A duration; 0 and the word none mean that there is none."""

    def read(value: object) -> float | None:
        if value is None or _is_word(value, "none", "off"):
            return None
        number = float(_number_of(value, float))
        if not 0 <= number <= high:
            raise ValueError
        return number or None

    return Kind(f"seconds up to {high:,g}, or none", read, "SECONDS")


def _period(low: float, high: float) -> Kind:
    """A duration that there must be."""

    def read(value: object) -> float:
        number = float(_number_of(value, float))
        if not low <= number <= high:
            raise ValueError
        return number

    return Kind(f"seconds from {low:g} to {high:,g}", read, "SECONDS")


def _or_none(kind: Kind, word: str) -> Kind:
    """The same, or a word that means None."""

    def read(value: object) -> object:
        return None if value is None or _is_word(value, word) else kind.read(value)

    return Kind(f"{kind.expects}, or {word}", read, f"{kind.sign}|{word}")


def _is_word(value: object, *words: str) -> bool:
    return isinstance(value, str) and value.strip().lower() in words


FILE = _or_none(_text("a file", "FILE"), "none")

FOLDER = _text("a folder", "DIR")

_SIZE = re.compile(r"(\d+(?:\.\d+)?)\s*(?:([kmg])(i)?)?b?", re.IGNORECASE)


def _size(low: int, high: int) -> Kind:
    def read(value: object) -> int:
        size = _size_of(value) if isinstance(value, str) else int(_number_of(value, int))
        if not low <= size <= high:
            raise ValueError
        return size

    return Kind(f"a size from {show_size(low)} to {show_size(high)}, such as 16MiB", read, "SIZE")


def _size_of(text: str) -> int:
    match = _SIZE.fullmatch(text.strip())
    if match is None:
        raise ValueError
    number, prefix, is_binary = match.groups()
    power = "kmg".index(prefix.lower()) + 1 if prefix else 0
    return int(float(number) * (1024 if is_binary else 1000) ** power)


def show_size(size: int) -> str:
    """The size as a person writes it, and as the check reads it back."""
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


FOLDERS = Kind("folders", _read_folders, "DIR", os.pathsep)


def _read_patterns(value: object) -> tuple[str, ...]:
    texts = [value] if isinstance(value, str) else cast("Sequence[str]", value)
    patterns = tuple(text.strip() for text in texts)
    if not all(pattern.isprintable() and pattern and " " not in pattern for pattern in patterns):
        raise ValueError
    return patterns


_PATTERNS = Kind("patterns without blanks, such as /camera/*", _read_patterns, "PATTERN", ",")

_ORIGINS = Kind("origins without blanks, such as https://*.example.org", _read_patterns, "ORIGIN", ",")


def _read_urls(value: object) -> tuple[str, ...]:
    texts = [value] if isinstance(value, str) else cast("Sequence[str]", value)
    urls = tuple(check_url(text) for text in texts)
    if len(set(urls)) < len(urls):
        raise ValueError
    return urls


URLS = Kind(f"URLs of rosbridges, each once, such as ws://192.168.0.5:{DEFAULT_PORT}", _read_urls, "URL", ",")


def _read_token(value: object) -> str:
    if not isinstance(value, str) or not re.fullmatch(r"[!-~]+", value):
        raise ValueError
    return value


SECRET = _or_none(Kind("printable ASCII without blanks", _read_token, "TOKEN"), "none")


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
"""What MORAI's own panel allows [Hz]."""

RATES = Kind(f"TOPIC=HZ with at most {_MAX_RATE} Hz, such as /Ego_topic=10", _read_rates, "TOPIC=HZ", ",")


def _choices(name: str) -> Kind:
    """What is chosen about the simulator's publishers, subscribers or services."""

    def read(value: object) -> object:
        # Only who has such a table waits for what it takes to read one.
        from rosbridge_sim.morai.network_settings import ItemKind, read_choices  # noqa: PLC0415

        return read_choices(ItemKind(name), value)

    return Kind(f"a table of {name}", read, "", is_table=True)


# The settings


@dataclass(frozen=True, slots=True)
class Flag:
    """How a field shows itself to a person."""

    group: str
    kind: Kind
    text: str


def _flag(default: T, group: str, kind: Kind, text: str) -> T:
    """A field of `Settings`. Says T, as `dataclasses.field` does, for the checker's sake."""
    metadata = {"flag": Flag(group, kind, text)}
    if isinstance(default, dict):
        return field(default_factory=lambda: dict(default), metadata=metadata)  # type: ignore[return-value]
    return field(default=default, metadata=metadata, repr=kind not in (SECRET, URLS))


_LISTEN = "where it listens"
_ATTACH = "behind somebody else's bridge"
_ACCESS = "who may connect, and what clients may do"
_WORLD = "the world"
_NETWORK = "the simulator's topics and services"
_FACE = "what MORAI calls things"
_SYNC = "synchronous mode"
_TYPES = "message types"
_WIRE = "the wire"
_RECORD = "recording"
_LOG = "the rest"

_GIB = 2**30
_DAY = 86_400.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """All that can be set, checked. Durations in seconds, sizes in bytes, None where something is off.

    The field `sync_lease` is the flag `--sync-lease`, the variable `ROSBRIDGE_SIM_SYNC_LEASE` and the key `sync-lease`.
    """

    host: str = _flag("127.0.0.1", _LISTEN, _text("a host name or address", "HOST"), "address; 0.0.0.0 is every one")
    port: int = _flag(9090, _LISTEN, _whole(0, 65_535), "TCP port; 0 takes a free one")
    certfile: str | None = _flag(None, _LISTEN, FILE, "certificate in PEM: clients then connect to wss://")
    keyfile: str | None = _flag(None, _LISTEN, FILE, "its private key in PEM, if the same file does not hold it")

    listen: bool = _flag(
        default=True, group=_LISTEN, kind=SWITCH, text="listen at all; without it, it is only to be found by --attach"
    )

    attach: tuple[str, ...] = _flag(
        (),
        _ATTACH,
        URLS,
        "be the simulator behind this rosbridge, too: dial it and advertise everything there; repeatable",
    )
    attach_sockets: Literal["one", "per-topic"] = _flag(
        "one",
        _ATTACH,
        _choice("one", "per-topic"),
        "one socket keeps a tick's topics ahead of its answer; one for each topic and service keeps them apart",
    )
    attach_retry: float = _flag(
        10.0, _ATTACH, _period(0.1, 3_600.0), "longest wait between two attempts to reach a bridge"
    )

    token: str | None = _flag(
        None,
        _ACCESS,
        SECRET,
        "what every client must show; set as a variable or in the file, no list of processes has it",
    )
    allow_origin: tuple[str, ...] = _flag(
        (),
        _ACCESS,
        _ORIGINS,
        "web pages that may connect, in place of all on loopback, else of the same host; repeatable",
    )
    allow_publish: tuple[str, ...] = _flag(
        (), _ACCESS, _PATTERNS, "topics to which clients may publish, in place of all; repeatable"
    )
    deny_publish: tuple[str, ...] = _flag(
        (), _ACCESS, _PATTERNS, "topics to which they may not, even if allowed; repeatable"
    )
    allow_subscribe: tuple[str, ...] = _flag(
        (), _ACCESS, _PATTERNS, "topics to which clients may subscribe, in place of all; repeatable"
    )
    deny_subscribe: tuple[str, ...] = _flag((), _ACCESS, _PATTERNS, "topics to which they may not; repeatable")
    allow_service: tuple[str, ...] = _flag(
        (),
        _ACCESS,
        _PATTERNS,
        "services and actions that clients may call and offer, in place of all; /rosapi/* stays; repeatable",
    )
    deny_service: tuple[str, ...] = _flag((), _ACCESS, _PATTERNS, "services and actions that they may not; repeatable")
    allow_param: tuple[str, ...] = _flag(
        (), _ACCESS, _PATTERNS, "parameters that clients may use, in place of all; repeatable"
    )
    deny_param: tuple[str, ...] = _flag((), _ACCESS, _PATTERNS, "parameters that they may not; repeatable")
    max_clients: int | None = _flag(1_000, _ACCESS, _or_none(_whole(1, 1_000_000), "none"), "clients at once")
    max_rate: int | None = _flag(
        None, _ACCESS, _or_none(_whole(1, 1_000_000), "none"), "frames a second from one client, after a burst"
    )
    max_held: int = _flag(
        10_000, _ACCESS, _whole(1, 1_000_000), "subscriptions, advertisements and services of one client"
    )
    max_calls: int = _flag(1_000, _ACCESS, _whole(1, 1_000_000), "calls of one client in flight, and goals")

    world: bool = _flag(
        default=True, group=_WORLD, kind=SWITCH, text="have the driving world inside; without it this is a bare gateway"
    )
    scenario: str = _flag(
        "demo", _WORLD, _text("a scenario's name or file", "NAME|FILE"), "what stands and drives in the world"
    )
    map: str | None = _flag(
        None,
        _WORLD,
        _or_none(_text("a map's name or folder", "NAME|DIR"), "none"),
        "in place of the scenario's own map",
    )
    scenario_path: tuple[str, ...] = _flag(
        (), _WORLD, FOLDERS, "folder in which clients' scenarios are found; may be repeated"
    )
    data_dir: str = _flag(
        "SaveFile",
        _WORLD,
        FOLDER,
        "folder of sensors' data, network settings and recordings to replay; made when it is needed",
    )
    start: Literal["run", "sync"] = _flag(
        "run", _WORLD, _choice("run", "sync"), "run in real time, or stand at frame 0 until a first master comes"
    )
    seed: int = _flag(0, _WORLD, _whole(0, 2**32 - 1), "of all chance in the world")

    publishers: Mapping[str, Choice] = _flag(
        cast("Mapping[str, Choice]", {}),
        _NETWORK,
        _choices("publishers"),
        "what the simulator publishes: each topic's name, its rate [Hz, at most 120], and whether it is there",
    )
    subscribers: Mapping[str, Choice] = _flag(
        cast("Mapping[str, Choice]", {}), _NETWORK, _choices("subscribers"), "the topics that it listens to"
    )
    services: Mapping[str, Choice] = _flag(
        cast("Mapping[str, Choice]", {}), _NETWORK, _choices("services"), "the services that it offers"
    )

    release: Literal["22.R2", "26.R1"] = _flag(
        "22.R2", _FACE, _choice("22.R2", "26.R1"), "MORAI SIM release whose message fields are used"
    )
    profile: Literal["manual", "field"] = _flag(
        "manual", _FACE, _choice("manual", "field"), "where both differ: as the manual says, or as clients read"
    )
    wheel_angle_unit: Literal["rad", "deg"] | None = _flag(
        None, _FACE, _or_none(_choice("rad", "deg"), "profile"), "unit of the ego's wheel_angle"
    )
    object_size_order: Literal["width-length-height", "length-width-height"] | None = _flag(
        None,
        _FACE,
        _or_none(_choice("width-length-height", "length-width-height"), "profile"),
        "what x, y, z of an object's size are",
    )
    object_limit: int | None = _flag(
        None,
        _FACE,
        _or_none(_whole(0, 1_000_000), "profile"),
        "how many objects are published, the nearest; 0 is all",
    )
    object_velocity_unit: Literal["km/h", "m/s"] | None = _flag(
        None, _FACE, _or_none(_choice("km/h", "m/s"), "profile"), "unit of objects' velocity"
    )
    start_mode: Literal["external", "keyboard"] = _flag(
        "external", _FACE, _choice("external", "keyboard"), "whether /ctrl_cmd moves the ego from the start"
    )

    sync_frames: Literal["lenient", "strict"] = _flag(
        "lenient", _SYNC, _choice("lenient", "strict"), "whether a tick may name any frame, or the next one alone"
    )
    sync_lease: float | None = _flag(
        None, _SYNC, _seconds(_DAY), "silence after which the master has lost the mode; closing always loses it"
    )
    sync_on_loss: Literal["run", "pause", "wait"] = _flag(
        "run", _SYNC, _choice("run", "pause", "wait"), "what the world does when the master is lost"
    )
    anyone_may_stop: bool = _flag(
        default=False, group=_SYNC, kind=SWITCH, text="let others than the master stop the mode"
    )

    ros: Literal[1, 2] = cast(
        "Literal[1, 2]",
        _flag(1, _TYPES, _whole(1, 2, "1|2"), "ROS generation whose names, times and bytes go out; both are taken in"),
    )
    schema_path: tuple[str, ...] = _flag(
        (), _TYPES, FOLDERS, "folder with ROS packages whose messages are to be known; may be repeated"
    )
    strict_types: bool = _flag(
        default=False, group=_TYPES, kind=SWITCH, text="refuse types of unknown packages in place of relaying them"
    )

    service_timeout: float | None = _flag(
        None, _WIRE, _seconds(_DAY), "how long a call waits for a client's service if it does not say"
    )
    max_frame_size: int = _flag(16 * 2**20, _WIRE, _size(1024, _GIB), "a longer frame closes the connection (1009)")
    outbox_burst: int = _flag(
        100, _WIRE, _whole(1, 1_000_000), "newest messages of each topic kept for a client that does not read"
    )
    outbox_size: int = _flag(4 * 2**20, _WIRE, _size(1024, 4 * _GIB), "oldest topic messages are dropped beyond this")
    outbox_limit: int = _flag(
        64 * 2**20, _WIRE, _size(1024, 16 * _GIB), "a client that leaves more unread is closed (1008)"
    )
    ping_interval: float | None = _flag(20.0, _WIRE, _seconds(_DAY), "between pings")
    ping_timeout: float | None = _flag(20.0, _WIRE, _seconds(_DAY), "a ping unanswered for so long closes")
    compression: bool = _flag(
        default=False, group=_WIRE, kind=SWITCH, text="permessage-deflate for clients that offer it"
    )
    status: bool = _flag(default=True, group=_WIRE, kind=SWITCH, text="send status frames at all")

    record: str | None = _flag(
        None,
        _RECORD,
        FILE,
        "record into this bag: NAME.bag is ROS 1, NAME.mcap ROS 2, any other name a folder of ROS 2",
    )
    record_topics: tuple[str, ...] = _flag(
        (), _RECORD, _PATTERNS, "topics to record, in place of the simulator's and its commands'; repeatable"
    )

    log_level: Literal["debug", "info", "warning", "error"] = _flag(
        "info", _LOG, _choice("debug", "info", "warning", "error"), "least level of the log on stderr"
    )
    config: str | None = _flag(
        None, _LOG, _text("a TOML file", "FILE.toml"), "settings by their flags' names; paths are from its folder"
    )


FIELDS: dict[str, Field[Any]] = {one.name.replace("_", "-"): one for one in fields(Settings)}
"""Key, which is the flag without its dashes, -> field."""


SHORT_FORMS: dict[str, Flag] = {
    "rate": Flag(_NETWORK, RATES, "publish a topic of the simulator's so often, whatever the file says; repeatable"),
}
"""Flags and variables that say a part of a setting that is a table: `rate` one of `publishers`."""


def flag_of(key: str) -> Flag:
    """How the setting or short form of that key shows itself."""
    if key in SHORT_FORMS:
        return SHORT_FORMS[key]
    flag: Flag = FIELDS[key].metadata["flag"]
    return flag
