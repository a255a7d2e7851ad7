"""The commands about bags: `rosbridge-sim bag ...` and `record`."""

from __future__ import annotations

from rosbridge_sim.cli.bridge_flags import COUNT, SECONDS, add_bridge, add_without_effect
from rosbridge_sim.cli.command_line import (
    Options,
    add_definitions,
    add_json,
    command_of,
    group_of,
    make_number,
    run_tool,
)
from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import Parser

_speed = make_number(0.001, 1e4, "a factor, at most 10,000", float)


def make_bag() -> Parser:
    """Return the parser of `rosbridge-sim bag ...`."""
    absent = dict.fromkeys(
        ("check", "compress", "convert", "decompress", "filter", "fix", "migrate"),
        "bags are not changed here; the tools of the PyPI package rosbags do that without ROS",
    )
    text = "Bag files: show, play, record and repair. Only play and record need a server."
    group, add = group_of("bag", text, absent)

    parser = add("info", "files.bag_info.show_bag", "show duration, size and topics of a bag")
    parser.option("file", "FILE", _BAG)
    add_json(parser)

    _add_play(add("play", _play, "publish the messages of a bag at their times; leave out topics of the server"))
    _add_record(add("record", _record, "record topics of a rosbridge into a bag, until Ctrl-C"), "TOPIC")

    for name in ("repair", "reindex"):
        text = "copy the complete parts of a bag, whose recorder was killed, into a new bag"
        parser = add(name, "files.bag_repair.repair_bag", text)
        parser.option("file", "FILE", "NAME.bag, NAME.mcap, or a folder of rosbag2")
        parser.option("-o", "--output", "FILE", "the new bag [NAME.repaired.bag, with the old suffix]")
        add_json(parser)
    return group


_BAG = "NAME.bag, NAME.mcap, NAME.db3, or a folder of rosbag2"


# play


def _add_play(parser: Parser) -> None:
    parser.option("file", "FILE", _BAG)
    parser.option("-r", "--rate", "FACTOR", "play at FACTOR times the recorded speed [1]", type=_speed, default=1.0)
    parser.switch("-l", "--loop", "begin again at the end, until Ctrl-C", dest="is_looping")
    text = "leave out the first SECONDS"
    parser.option("-s", "--start", "--start-offset", "SECONDS", text, type=SECONDS, default=0.0)
    parser.option("-u", "--duration", "SECONDS", "end after so many seconds of the bag", type=SECONDS, default=1e9)
    parser.option("--topics", "TOPIC", "only these topics [all]", nargs="+", default=[])
    parser.option("-m", "--remap", "OLD:=NEW", "publish the topic OLD under the name NEW", nargs="+", default=[])
    add_without_effect(parser, {"--clock": ("?", "/clock of the bag is played if the server has none of its own")})
    add_bridge(parser)
    add_definitions(parser)


def _play(options: Options) -> int:
    from rosbridge_sim.cli.tools.bag_play import Selection  # noqa: PLC0415 - with the readers of bags

    pairs = [one.partition(":=") for one in options.remap]
    if not all(old and new for old, _, new in pairs):
        raise SettingError(f"--remap: expected OLD:=NEW; got {' '.join(options.remap)!r}")
    selection = Selection(
        topics=tuple(options.topics),
        names={old: new for old, _, new in pairs},
        start=options.start,
        end=options.start + options.duration,
        rate=options.rate,
        is_looping=options.is_looping,
    )
    options.end = 0 if options.is_looping else options.end
    return run_tool("tools.bag_play.play", options, selection=selection)


# record


def make_record() -> Parser:
    """Return the parser of `rosbridge-sim record`."""
    parser = command_of("record", _record, "Record topics of a rosbridge into a bag, until Ctrl-C.")
    _add_record(parser, "FILE")
    return parser


def _add_record(parser: Parser, first: str) -> None:
    """Add the flags of both commands.

    Args:
        first: meaning of the first word: `FILE`, unless -o names it; or `TOPIC`.
    """
    text = "NAME.bag is ROS 1, NAME.mcap ROS 2, else a folder of ROS 2"
    is_bag = first == "TOPIC"
    what = "topics to record, or patterns [all]" if is_bag else f"{text}; then topics to record, or patterns [all]"
    parser.option("words", "TOPIC" if is_bag else "FILE TOPIC", what, nargs="*")
    default = "the time of day, as rosbag and ros2 bag do" if is_bag else "the first word"
    parser.option("-o", "-O", "--output", "--output-name", "FILE", f"{text} [{default}]")
    parser.switch("-a", "--all", "all topics, which is the default")
    parser.add_argument("-s", "--storage", choices=("mcap",), help="the only format of ROS 2 that is written")
    parser.repeated("-t", "--topics", "PATTERN", "topics to record, such as '/Ego*'; repeatable [all]")
    parser.add_argument("-n", "--count", type=COUNT, help="end after so many messages")
    add_bridge(parser, is_waiting=True)
    add_definitions(parser)
    parser.set_defaults(end=0, has_file=not is_bag)


def _record(options: Options) -> int:
    words: list[str] = options.words
    file = options.output or (words.pop(0) if options.has_file and words else None)
    if file is None and options.has_file:
        raise SettingError("the following arguments are required: FILE; see rosbridge-sim record --help")
    return run_tool("tools.record.record", options, file=file, patterns=(*options.topics, *words))
