"""All that can be set.

`Settings` is the only list. Each field carries its flag's group, check and help, and from that one place come
the command line, the names of environment variables, the keys of the file and what `--print-config` writes
(`loading.py` reads and writes those; `value_types.py` has the checks).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal, TypeVar, cast

from rosbridge_sim.shell.config.value_types import (
    FILE,
    FOLDER_TYPE,
    FOLDERS,
    HOSTS,
    ORIGINS,
    PATTERNS,
    RATES,
    SECRET,
    SWITCH,
    URLS,
    ValueType,
    choice_of,
    item_choices,
    or_none,
    period,
    seconds,
    size,
    text_of,
    whole_number,
)

if TYPE_CHECKING:
    from rosbridge_sim.morai.interfaces.network_settings import InterfaceChoice

__all__ = ["FIELDS", "SHORT_FORMS", "Flag", "Settings", "flag_of"]

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Flag:
    """How a field shows itself to a person."""

    group: str
    kind: ValueType
    text: str


def _flag(default: T, group: str, kind: ValueType, text: str) -> T:
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

    host: str = _flag("127.0.0.1", _LISTEN, text_of("a host name or address", "HOST"), "address; 0.0.0.0 is every one")
    port: int = _flag(9090, _LISTEN, whole_number(0, 65_535), "TCP port; 0 takes a free one")
    certfile: str | None = _flag(None, _LISTEN, FILE, "certificate in PEM: clients then connect to wss://")
    keyfile: str | None = _flag(None, _LISTEN, FILE, "its private key in PEM, if the same file does not hold it")

    port_file: str | None = _flag(
        None,
        _LISTEN,
        FILE,
        "write the port into this file once the server listens, and remove it at the end; for --port 0",
    )
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
        choice_of("one", "per-topic"),
        "one socket keeps a tick's topics ahead of its answer; one for each topic and service keeps them apart",
    )
    attach_retry: float = _flag(
        10.0, _ATTACH, period(0.1, 3_600.0), "longest wait between two attempts to reach a bridge"
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
        ORIGINS,
        "web pages that may connect, beside those of localhost and of the server's own address; repeatable",
    )
    allow_host: tuple[str, ...] = _flag(
        (),
        _ACCESS,
        HOSTS,
        "names by which web pages may call the server, beside localhost, IP addresses and its own; repeatable",
    )
    allow_publish: tuple[str, ...] = _flag(
        (), _ACCESS, PATTERNS, "topics to which clients may publish, in place of all; repeatable"
    )
    deny_publish: tuple[str, ...] = _flag(
        (), _ACCESS, PATTERNS, "topics to which they may not, even if allowed; repeatable"
    )
    allow_subscribe: tuple[str, ...] = _flag(
        (), _ACCESS, PATTERNS, "topics to which clients may subscribe, in place of all; repeatable"
    )
    deny_subscribe: tuple[str, ...] = _flag((), _ACCESS, PATTERNS, "topics to which they may not; repeatable")
    allow_service: tuple[str, ...] = _flag(
        (),
        _ACCESS,
        PATTERNS,
        "services and actions that clients may call and offer, in place of all; /rosapi/* stays; repeatable",
    )
    deny_service: tuple[str, ...] = _flag((), _ACCESS, PATTERNS, "services and actions that they may not; repeatable")
    allow_param: tuple[str, ...] = _flag(
        (), _ACCESS, PATTERNS, "parameters that clients may use, in place of all; repeatable"
    )
    deny_param: tuple[str, ...] = _flag((), _ACCESS, PATTERNS, "parameters that they may not; repeatable")
    max_clients: int | None = _flag(1_000, _ACCESS, or_none(whole_number(1, 1_000_000), "none"), "clients at once")
    max_strangers: int = _flag(
        100,
        _ACCESS,
        whole_number(1, 100_000),
        "connections at once that have not shown the token yet; the oldest one is closed for a new one",
    )
    max_rate: int | None = _flag(
        None, _ACCESS, or_none(whole_number(1, 1_000_000), "none"), "frames a second from one client, after a burst"
    )
    max_held: int = _flag(
        10_000, _ACCESS, whole_number(1, 1_000_000), "subscriptions, advertisements and services of one client"
    )
    max_calls: int = _flag(1_000, _ACCESS, whole_number(1, 1_000_000), "calls of one client in flight, and goals")

    world: bool = _flag(
        default=True, group=_WORLD, kind=SWITCH, text="have the driving world inside; without it this is a bare gateway"
    )
    scenario: str = _flag(
        "demo", _WORLD, text_of("a scenario's name or file", "NAME|FILE"), "what stands and drives in the world"
    )
    map: str | None = _flag(
        None,
        _WORLD,
        or_none(text_of("a map's name or folder", "NAME|DIR"), "none"),
        "in place of the scenario's own map",
    )
    scenario_path: tuple[str, ...] = _flag(
        (), _WORLD, FOLDERS, "folder in which clients' scenarios are found; may be repeated"
    )
    catalogue: str | None = _flag(
        None,
        _WORLD,
        FILE,
        "your own table of models, *.toml or *.csv, asked before the built-in one: DataID, name, class, length, width,"
        " height, wheelbase, rear_overhang [m], max_steer [deg], mass [kg]",
    )
    data_dir: str = _flag(
        "SaveFile",
        _WORLD,
        FOLDER_TYPE,
        "folder of sensors' data, network settings and recordings to replay; made when it is needed",
    )
    data_quota: int | None = _flag(
        10 * _GIB,
        _WORLD,
        or_none(size(1024, 2**20 * _GIB), "none"),
        "size that --data-dir may reach by what clients have written there; beyond it they are refused",
    )
    data_quota_files: int | None = _flag(
        200_000,
        _WORLD,
        or_none(whole_number(1, 1_000_000_000), "none"),
        "files and folders that --data-dir may come to hold in the same way",
    )
    start: Literal["run", "sync"] = _flag(
        "run", _WORLD, choice_of("run", "sync"), "run in real time, or stand at frame 0 until a first master comes"
    )
    seed: int = _flag(0, _WORLD, whole_number(0, 2**32 - 1), "of all chance in the world")
    on_world_failure: Literal["exit", "serve"] = _flag(
        "exit",
        _WORLD,
        choice_of("exit", "serve"),
        "after a bug of ours in a step of the world: end with code 1, or go on serving clients without the world",
    )

    publishers: Mapping[str, InterfaceChoice] = _flag(
        cast("Mapping[str, InterfaceChoice]", {}),
        _NETWORK,
        item_choices("publishers"),
        "what the simulator publishes: each topic's name, its rate [Hz, at most 120], and whether it is there",
    )
    subscribers: Mapping[str, InterfaceChoice] = _flag(
        cast("Mapping[str, InterfaceChoice]", {}),
        _NETWORK,
        item_choices("subscribers"),
        "the topics that it listens to",
    )
    services: Mapping[str, InterfaceChoice] = _flag(
        cast("Mapping[str, InterfaceChoice]", {}), _NETWORK, item_choices("services"), "the services that it offers"
    )

    replay_info: bool = _flag(
        default=False,
        group=_NETWORK,
        kind=SWITCH,
        text="publish /ReplayInfo_topic of each drive for bridges and --record, too; a subscriber has it anyhow",
    )

    release: Literal["22.R2", "26.R1"] = _flag(
        "22.R2", _FACE, choice_of("22.R2", "26.R1"), "MORAI SIM release whose message fields are used"
    )
    profile: Literal["manual", "field"] = _flag(
        "manual", _FACE, choice_of("manual", "field"), "where both differ: as the manual says, or as clients read"
    )
    wheel_angle_unit: Literal["rad", "deg"] | None = _flag(
        None, _FACE, or_none(choice_of("rad", "deg"), "profile"), "unit of the ego's wheel_angle"
    )
    object_size_order: Literal["width-length-height", "length-width-height"] | None = _flag(
        None,
        _FACE,
        or_none(choice_of("width-length-height", "length-width-height"), "profile"),
        "what x, y, z of an object's size are",
    )
    object_limit: int | None = _flag(
        None,
        _FACE,
        or_none(whole_number(0, 1_000_000), "profile"),
        "how many objects are published, the nearest; 0 is all",
    )
    object_velocity_unit: Literal["km/h", "m/s"] | None = _flag(
        None, _FACE, or_none(choice_of("km/h", "m/s"), "profile"), "unit of objects' velocity"
    )
    stamps: Literal["sim", "wall", "auto"] | None = _flag(
        None,
        _FACE,
        or_none(choice_of("sim", "wall", "auto"), "default"),
        "time in headers, /clock and tf: simulated, of day, or as /use_sim_time of the first bridge says;"
        " sim for serve and auto for attach by default",
    )
    start_mode: Literal["external", "keyboard"] = _flag(
        "external", _FACE, choice_of("external", "keyboard"), "whether /ctrl_cmd moves the ego from the start"
    )

    sync_frames: Literal["lenient", "strict"] = _flag(
        "lenient", _SYNC, choice_of("lenient", "strict"), "whether a tick may name any frame, or the next one alone"
    )
    sync_lease: float | None = _flag(
        None, _SYNC, seconds(_DAY), "silence after which the master has lost the mode; closing always loses it"
    )
    sync_on_loss: Literal["run", "pause", "wait"] = _flag(
        "run", _SYNC, choice_of("run", "pause", "wait"), "what the world does when the master is lost"
    )
    anyone_may_stop: bool = _flag(
        default=False, group=_SYNC, kind=SWITCH, text="let others than the master stop the mode"
    )

    ros: Literal[1, 2] = cast(
        "Literal[1, 2]",
        _flag(
            1,
            _TYPES,
            whole_number(1, 2, "1|2"),
            "ROS generation whose names, times and bytes go out",
        ),
    )
    schema_path: tuple[str, ...] = _flag(
        (), _TYPES, FOLDERS, "folder with ROS packages whose messages are to be known; may be repeated"
    )
    strict_types: bool = _flag(
        default=False, group=_TYPES, kind=SWITCH, text="refuse types of unknown packages in place of relaying them"
    )

    service_timeout: float | None = _flag(
        None, _WIRE, seconds(_DAY), "how long a call waits for a client's service if it does not say"
    )
    max_frame_size: int = _flag(16 * 2**20, _WIRE, size(1024, _GIB), "a longer frame closes the connection (1009)")
    outbox_burst: int = _flag(
        100, _WIRE, whole_number(1, 1_000_000), "newest messages of each topic kept for a client that does not read"
    )
    outbox_size: int = _flag(4 * 2**20, _WIRE, size(1024, 4 * _GIB), "oldest topic messages are dropped beyond this")
    outbox_limit: int = _flag(
        64 * 2**20, _WIRE, size(1024, 16 * _GIB), "a client that leaves more unread is closed (1008)"
    )
    client_memory: int = _flag(
        256 * 2**20,
        _WIRE,
        size(2**20, 64 * _GIB),
        "what one client may make the server hold: throttle queues, latched messages, calls in flight, parts of frames",
    )
    memory_budget: int | None = _flag(
        None,
        _WIRE,
        or_none(size(2**20, 1024 * _GIB), "auto"),
        "what all clients together may; beyond it the one that holds most is closed [half of the machine's or"
        " container's memory]",
    )
    ping_interval: float | None = _flag(20.0, _WIRE, seconds(_DAY), "between pings")
    ping_timeout: float | None = _flag(20.0, _WIRE, seconds(_DAY), "a ping unanswered for so long closes")
    compression: bool = _flag(
        default=False, group=_WIRE, kind=SWITCH, text="permessage-deflate for clients that offer it"
    )
    websocket_io: Literal["direct", "library"] = _flag(
        "direct",
        _WIRE,
        choice_of("direct", "library"),
        "read WebSocket frames by the server's own code, or by that of the websockets library, which is slower; to find"
        " out which of the two a fault comes from",
    )
    status: bool = _flag(default=True, group=_WIRE, kind=SWITCH, text="send status frames at all")

    record: str | None = _flag(
        None,
        _RECORD,
        FILE,
        "record into this bag: NAME.bag is ROS 1, NAME.mcap ROS 2, any other name a folder of ROS 2",
    )
    record_topics: tuple[str, ...] = _flag(
        (), _RECORD, PATTERNS, "topics to record, in place of the simulator's and its commands'; repeatable"
    )

    log_level: Literal["debug", "info", "warning", "error"] = _flag(
        "info", _LOG, choice_of("debug", "info", "warning", "error"), "least level of the log on stderr"
    )
    log_format: Literal["text", "json"] = _flag(
        "text", _LOG, choice_of("text", "json"), "lines for people, or one JSON object a line with the date in UTC"
    )
    quiet_clients: bool = _flag(
        default=False, group=_LOG, kind=SWITCH, text="write no log lines about mistakes of clients"
    )
    config: str | None = _flag(
        None, _LOG, text_of("a TOML file", "FILE.toml"), "settings by their flags' names; paths are from its folder"
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
