"""Damaged files: bags, settings and definitions are read, or refused in one error line."""

from __future__ import annotations

import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from rosbridge_sim.errors import DocumentError, SettingError
from rosbridge_sim.morai.messages.convert import Converter
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.bags.bag import open_bag
from rosbridge_sim.shell.bags.bag_reader import read_recording
from rosbridge_sim.shell.bags.repair import repair
from rosbridge_sim.shell.config.loading import read_settings
from rosbridge_sim.shell.config.settings_file import read_network
from rosbridge_sim.shell.config.toml_text import lines_of
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.simulator.replays.object_list_decoder import decode_object_lists
from rosbridge_sim.simulator.replays.recorded_drive import Recording
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder
from tests.mutations import Flip, damage, examples, flips

STEP_NS = 20_000_000
SUFFIXES = {1: ".bag", 2: ".mcap"}
TYPES = {
    "/Ego_topic": "morai_msgs/EgoVehicleStatus",
    "/Object_topic": "morai_msgs/ObjectStatusList",
    "/ReplayInfo_topic": "morai_msgs/ReplayInfo",
}
BODIES = {
    "/Ego_topic": {"position": {"x": 1.0}, "heading": 90.0, "accel": 0.5},
    "/Object_topic": {
        "npc_list": [{"unique_id": 4, "name": "Bus"}],
        "obstacle_list": [{"unique_id": 5, "name": "Box"}],
    },
    "/ReplayInfo_topic": {"ego_acc": 0.25, "npc_list": [{"unique_id": 4, "name": "Bus"}], "orientation": {"w": 1.0}},
}
TOPICS = [(), ("/Ego_topic",), ("/Ego_topic", "/Object_topic"), ("/ReplayInfo_topic",), tuple(TYPES)]


@contextmanager
def folder() -> Iterator[Path]:
    """A folder for one example: a fixture would be one for all."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


def is_one_line(text: str) -> bool:
    return 0 < len(text) < 1_500 and len(text.splitlines()) == 1


@cache
def store(ros: Generation) -> Store:
    return Store(read_definitions("22.R2"), leniency=LENIENCY, ros=ros)


@cache
def raw_of(topic: str, ros: Generation) -> bytes:
    message_type = store(ros).message(TYPES[topic])
    return message_type.encode_raw(message_type.check(BODIES[topic], STEP_NS))


def read(path: Path) -> Recording | None:
    """The recording in a file; None where it is refused in one line."""
    reading = RecordingBuilder(path.name, Converter(store(1)))
    try:
        return read_recording(path, reading, read_definitions("22.R2"))
    except DocumentError as error:
        assert is_one_line(str(error)), error  # noqa: PT017 - either is right
        return None


Change = Callable[[str, bytes], bytes]


def unchanged(_topic: str, raw: bytes) -> bytes:
    return raw


def write(path: Path, topics: tuple[str, ...], change: Change = unchanged) -> Path:
    bag = open_bag(path)
    for topic in topics:
        channel = bag.add(topic, TYPES[topic], store(bag.ros).full_text(TYPES[topic]))
        for i in range(1, 6):
            raw = raw_of(topic, bag.ros)
            bag.write(channel, i * STEP_NS, change(topic, raw) if i == 3 else raw)
            bag.flush()
    bag.close()
    return path


@cache
def whole(ros: Generation, topics: tuple[str, ...]) -> bytes:
    with folder() as at:
        return write(at / f"whole{SUFFIXES[ros]}", topics).read_bytes()


@cache
def whole_db3() -> bytes:
    """The one file of a bag as rosbag2 wrote it by default for years."""
    with folder() as at:
        with Writer2(at / "a", version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
            for topic, type_name in TYPES.items():
                full_name = type_name.replace("/", "/msg/")
                text = store(2).full_text(type_name)
                connection = writer.add_connection(topic, full_name, msgdef=text, rihs01="RIHS01_0")
                for i in range(1, 4):
                    writer.write(connection, i * STEP_NS, raw_of(topic, 2))
        return (at / "a" / "a.db3").read_bytes()


def test_undamaged_files_are_valid() -> None:
    with folder() as at:
        for ros, suffix in SUFFIXES.items():
            recording = read(write(at / f"good{suffix}", tuple(TYPES)))
            assert recording is not None, suffix
            assert len(recording.egos[0].values[0]) == 5, ros
        (at / "good.db3").write_bytes(whole_db3())
        assert read(at / "good.db3") is not None


ros_generations = st.sampled_from([1, 2])


@pytest.mark.slow
@examples(20)
@given(ros=ros_generations, topics=st.sampled_from(TOPICS), changes=flips())
def test_damaged_bag_is_read_repaired_or_gives_one_error_line(
    ros: Generation, topics: tuple[str, ...], changes: list[Flip]
) -> None:
    with folder() as at:
        path = at / f"a{SUFFIXES[ros]}"
        path.write_bytes(damage(whole(ros, topics), changes))
        read(path)
        mended = at / f"b{SUFFIXES[ros]}"
        try:
            repair(path, mended)
        except DocumentError as error:
            assert is_one_line(str(error)), error  # noqa: PT017 - either is right
            assert not mended.exists()
        else:
            read(mended)


@pytest.mark.slow
@examples(20)
@given(ros=ros_generations, topic=st.sampled_from(sorted(TYPES)), changes=flips())
def test_messages_of_odd_bytes_are_read_or_give_one_error_line(
    ros: Generation, topic: str, changes: list[Flip]
) -> None:
    def bend(name: str, raw: bytes) -> bytes:
        return damage(raw, changes) if name == topic else raw

    with folder() as at:
        read(write(at / f"a{SUFFIXES[ros]}", tuple(TYPES), bend))
    if topic != "/Ego_topic":
        with suppress(ValueError):
            decode_object_lists(
                damage(raw_of(topic, ros), changes), is_cdr=ros == 2, has_pedals=topic == "/ReplayInfo_topic"
            )


@pytest.mark.slow
@examples(25)
@given(ros=ros_generations, changes=flips(), lines=st.integers(0, 60))
def test_foreign_definition_is_read_or_gives_one_error_line(ros: Generation, changes: list[Flip], lines: int) -> None:
    topic = "/Ego_topic"
    text = store(ros).full_text(TYPES[topic])
    rows = text.splitlines()
    bent = damage("\n".join([*rows[:lines], *rows[lines + 1 :]]).encode(), changes[1:]).decode("utf-8", "replace")
    with folder() as at:
        bag = open_bag(at / f"a{SUFFIXES[ros]}")
        try:
            channel = bag.add(topic, TYPES[topic], bent, digest="0" * 32)
        except Exception:  # noqa: BLE001 - the library writes no such definition; what it writes must be read
            bag.abort()
            return
        bag.write(channel, STEP_NS, raw_of(topic, ros))
        bag.close()
        read(at / f"a{SUFFIXES[ros]}")


@pytest.mark.slow
@examples(25)
@given(changes=flips(), column=st.sampled_from(["messages.data", "topics.type", "topics.name", "messages.timestamp"]))
def test_damaged_db3_is_read_or_gives_one_error_line(changes: list[Flip], column: str) -> None:
    with folder() as at:
        path = at / "a.db3"
        path.write_bytes(damage(whole_db3(), changes))
        read(path)
        path.write_bytes(whole_db3())
        table, name = column.split(".")
        database = sqlite3.connect(path)
        database.execute(f"UPDATE {table} SET {name} = ?", (damage(b"/Ego_topic", changes),))  # noqa: S608 - from the list above
        database.commit()
        database.close()
        read(path)


# Settings

SETTINGS = """# a comment
port = 0
scenario = "demo"
ping-interval = 5.5
allow-publish = ["/a/*", '/b']
max-frame-size = "1MiB"
world = true
[publishers]
"/Ego_topic" = { name = "/car/state", rate = 25, on = true }
"/clock" = { on = false }
[subscribers."/ctrl_cmd"]
name = "/drive"
[services]
"/Morai_TLSrv" = { on = false }
"""

PIECES = [
    *(
        "port",
        "=",
        "[",
        "]",
        "[[",
        "{",
        "}",
        '"',
        "'",
        '"""',
        "'''",
        "\n",
        "#",
        ".",
        ",",
        "publishers",
        "config",
        "token",
    ),
    *(
        "1979-05-27T07:32:00Z",
        "2021-13-45",
        "nan",
        "-inf",
        "1e400",
        "9" * 5_000,
        "0xffffffffffffffff",
        "true",
        "\\u0000",
    ),
    *("[" * 200, "{a=" * 200, "a." * 200, "\x00", "\u00fc", "\r\n", "'''\nx = " + "[" * 3_000 + "\n'''"),
]


def read_texts(content: bytes) -> None:
    """Read a file as settings and as network settings."""
    with folder() as at:
        path = at / "a.toml"
        path.write_bytes(content)
        for read_one in (lambda: read_settings(["--config", str(path)], {}), lambda: read_network(path)):
            try:
                read_one()
            except SettingError as error:
                lines = str(error).splitlines()  # several settings that do not exist have a line each
                assert all(map(is_one_line, lines)), error  # noqa: PT017 - either is right
                assert all(line.startswith(str(path)) for line in lines), error  # noqa: PT017 - either is right


@pytest.mark.slow
@examples(60)
@given(changes=flips(), pieces=st.lists(st.tuples(st.floats(0, 1), st.sampled_from(PIECES)), max_size=3))
def test_odd_settings_are_read_or_give_one_error_line(changes: list[Flip], pieces: list[tuple[float, str]]) -> None:
    text = SETTINGS
    for where, piece in pieces:
        at = int(where * len(text))
        text = text[:at] + piece + text[at:]
    read_texts(text.encode())
    read_texts(damage(text.encode(), changes))


@examples(30)
@given(
    key=st.sampled_from([line.partition(" ")[0] for line in SETTINGS.splitlines() if " = " in line]),
    value=st.sampled_from(PIECES),
)
def test_setting_with_an_odd_value_is_read_or_gives_one_error_line(key: str, value: str) -> None:
    lines = [f"{key} = {value}" if line.startswith(f"{key} = ") else line for line in SETTINGS.splitlines()]
    read_texts("\n".join(lines).encode())


@pytest.mark.parametrize(
    "value", ["9" * 5_000, "'''\nx = " + "[" * 3_000 + "\n'''", "'''\nx = " + "9" * 5_000 + "\n'''"]
)
def test_overlong_numbers_and_texts_give_one_error_line(value: str) -> None:
    read_texts(f"scenario = {value}\n".encode())
    with suppress(SettingError):
        lines_of(f"scenario = {value}\n")
