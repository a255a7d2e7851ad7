"""What is read of a bag, ours or a stranger's, whole or broken, for a replay."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Literal

import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from rosbridge_sim import DocumentError
from rosbridge_sim.morai.messages.convert import Converter
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.bags.bag import open_bag
from rosbridge_sim.shell.bags.bag_reader import MAX_EGO_TOPICS, read_recording
from rosbridge_sim.shell.bags.message_writer import BagMessageWriter
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.simulator.replays.recorded_drive import EGO_COLUMNS, Recording
from rosbridge_sim.simulator.replays.recorded_plans import MAX_CLOUD_BYTES, MAX_PLAN_MESSAGE, MAX_PLAN_TOPICS
from rosbridge_sim.simulator.replays.recording_builder import MAX_NOTES, RecordingBuilder

FRAME_NS = 20_000_000
STATUS = "/sim/process/state/msg/MoraiSimProcStatus"
EGO, OBJECTS, INFO = "morai_msgs/EgoVehicleStatus", "morai_msgs/ObjectStatusList", "morai_msgs/ReplayInfo"


@cache
def types_of(release: str, ros: Literal[1, 2] = 1) -> Store:
    """All types; made once, for nothing changes them."""
    return Store(read_definitions(release), leniency=LENIENCY, ros=ros)


def read(path: Path, release: str = "22.R2") -> Recording:
    reading = RecordingBuilder(path.name, Converter(types_of(release)))
    return read_recording(path, reading, read_definitions(release))


def write(path: Path, topics: dict[str, tuple[str, list[dict[str, Any]]]], release: str = "22.R2") -> Path:
    """A bag with messages 20 ms apart on each topic."""
    ros: Literal[1, 2] = 1 if path.suffix == ".bag" else 2
    store = types_of(release, ros)
    writer = BagMessageWriter(open_bag(path), store)
    for topic, (type_name, messages) in topics.items():
        writer.add(topic, type_name)
        message_type = store.message(type_name)
        for i, fields in enumerate(messages):
            raw = message_type.encode_raw(message_type.check(fields, (i + 1) * FRAME_NS))
            writer._write(topic, raw, (i + 1) * FRAME_NS)
    writer.close()
    return path


def ways(*xs: float) -> list[dict[str, Any]]:
    return [{"position": {"x": x}, "heading": 90.0, "accel": 0.5} for x in xs]


def shown(recording: Recording, index: int = 0) -> list[float]:
    return list(recording.egos[index].values[0])


# What is in a bag


@pytest.mark.parametrize("name", ["a.bag", "a.mcap", "a"])
def test_egos_and_objects_are_read(tmp_path: Path, name: str) -> None:
    objects = [{"npc_list": [{"unique_id": 4, "name": "Bus", "position": {"x": x}}]} for x in (1.0, 2.0)]
    path = write(
        tmp_path / name,
        {
            "/Ego_topic": (EGO, ways(1.0, 2.0)),
            "/Ego-3/Ego_topic": (EGO, ways(7.0)),
            "/Object_topic": (OBJECTS, objects),
            "/Ego-3/Object_topic": (OBJECTS, []),
            "/ReplayInfo_topic": (INFO, [{}]),
            "/chatter": ("std_msgs/String", [{"data": "x"}]),
        },
    )
    recording = read(path)
    assert shown(recording) == [1.0, 2.0]
    assert shown(recording, 3) == [7.0]
    assert recording.objects is not None
    assert recording.objects.values[0].tolist() == [1.0, 2.0]
    assert recording.duration_ns == FRAME_NS
    assert recording.notes == ()


@pytest.mark.parametrize("name", ["a.bag", "a.mcap"])
def test_replay_info_supplies_missing_topics(tmp_path: Path, name: str) -> None:
    info = {"ego_acc": 0.25, "npc_list": [{"unique_id": 4, "name": "Bus", "position": {"x": 9.0}}]}
    alone = read(write(tmp_path / name, {"/ReplayInfo_topic": (INFO, [info])}))
    assert not alone.egos[0].has_place
    assert alone.egos[0].values[EGO_COLUMNS.index("throttle")].tolist() == [0.25]
    assert alone.objects is not None
    both = read(write(tmp_path / f"b-{name}", {"/r": (INFO, [info]), "/e": (EGO, ways(1.0))}))
    assert both.egos[0].has_place
    assert both.objects is not None
    assert both.objects.values[0].tolist() == [9.0]


def test_default_topic_is_read_of_two_with_one_type(tmp_path: Path) -> None:
    recording = read(write(tmp_path / "a.bag", {"/AAA": (EGO, ways(7.0)), "/Ego_topic": (EGO, ways(1.0))}))
    assert shown(recording) == [1.0]
    assert recording.notes == ("/AAA is left out: /Ego_topic is replayed",)


def test_custom_topic_names_are_assigned_by_message_ids(tmp_path: Path) -> None:
    second = [{**way, "unique_id": 2} for way in ways(7.0)]
    first = [{**way, "unique_id": -1} for way in ways(1.0)]
    recording = read(write(tmp_path / "a.bag", {"/a/second": (EGO, second), "/car/state": (EGO, first)}))
    assert (shown(recording), shown(recording, 2)) == ([1.0], [7.0])
    assert recording.notes == ()


def test_bag_without_morai_topics_is_empty(tmp_path: Path) -> None:
    assert read(write(tmp_path / "a.bag", {"/chatter": ("std_msgs/String", [{"data": "x"}])})).is_empty
    assert read(write(tmp_path / "b.bag", {"/Ego_topic": (EGO, [])})).is_empty


@pytest.mark.parametrize(("written", "used"), [("22.R2", "26.R1"), ("26.R1", "22.R2")])
def test_bag_of_the_other_release_is_read_by_its_own_definitions(tmp_path: Path, written: str, used: str) -> None:
    steering = "wheel_angle" if written == "22.R2" else "front_steer_angle"
    path = write(tmp_path / "a.mcap", {"/Ego_topic": (EGO, [{"position": {"x": 3.0}, steering: 0.5}])}, written)
    recording = read(path, used)
    assert shown(recording) == [3.0]
    steer = recording.egos[0].values[EGO_COLUMNS.index("steer"), 0]
    assert steer == pytest.approx(0.5 if written == "22.R2" else 0.5 * 3.14159265 / 180)


# Plans of programs

PATH = "nav_msgs/Path"
Topics = dict[str, tuple[str, list[dict[str, Any]]]]


@pytest.mark.parametrize("name", ["a.bag", "a.mcap"])
def test_plans_with_bad_names_are_left_out_with_a_note(tmp_path: Path, name: str) -> None:
    names = ("/bad name", "/" + "x" * 9_001, "/a\0b")
    recording = read(write(tmp_path / name, {"/Ego_topic": (EGO, ways(1.0)), **{one: (PATH, [{}]) for one in names}}))
    assert recording.plans == ()
    assert [note.endswith("is not a valid graph name: it is left out") for note in recording.notes] == [True] * 3
    assert max(map(len, recording.notes)) < 200


@pytest.mark.slow
def test_number_of_plan_topics_and_of_remarks_is_bounded(tmp_path: Path) -> None:
    paths: Topics = {f"/plan/{i}": (PATH, [{}]) for i in range(MAX_PLAN_TOPICS + 3)}
    recording = read(write(tmp_path / "a.bag", {"/Ego_topic": (EGO, ways(1.0)), **paths}))
    assert len(recording.plans) == MAX_PLAN_TOPICS
    assert recording.notes == (f"3 topics with plans are left out: at most {MAX_PLAN_TOPICS} are replayed",)
    egos = {f"/Ego_topic_{i}": (EGO, ways(1.0)) for i in range(50)}
    notes = read(write(tmp_path / "b.bag", {"/Ego_topic": (EGO, ways(1.0)), **egos})).notes
    assert len(notes) == MAX_NOTES + 1
    assert notes[-1] == f"and {50 - MAX_NOTES} more remarks like these"


def test_number_of_egos_is_bounded_and_their_one_type_is_compiled_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    topics = {f"/Ego-{i}/Ego_topic": (EGO, ways(1.0)) for i in range(1, MAX_EGO_TOPICS + 10)}
    path = write(tmp_path / "a.bag", topics)
    compiled: list[str] = []
    compile_type = Typestore.register

    def count(store: Typestore, types: Any) -> None:  # noqa: ANN401 - the library's
        compiled.extend(types)
        compile_type(store, types)

    monkeypatch.setattr(Typestore, "register", count)
    recording = read(path)
    assert len(recording.egos) == MAX_EGO_TOPICS
    assert compiled.count(f"morai_msgs/msg/{EGO.rpartition('/')[2]}") == 1
    assert recording.notes[0].endswith(f"is left out: there are more than {MAX_EGO_TOPICS} egos")


@pytest.mark.parametrize("name", ["a.bag", "a.mcap"])
def test_plans_are_read_without_compiling_anything_later(tmp_path: Path, name: str) -> None:
    marks = {"markers": [{"points": [{"x": 1.0}]}]}
    topics = {f"/plan/{i}": ("visualization_msgs/MarkerArray", [marks]) for i in range(3)}
    recording = read(write(tmp_path / name, {"/Ego_topic": (EGO, ways(1.0)), **topics}))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("builtins.compile", _refuse)
        patch.setattr("builtins.exec", _refuse)
        decoded: list[Any] = [plan.decode(plan.raws[0]) for plan in recording.plans]
    assert [one["markers"][0]["points"][0]["x"] for one in decoded] == [1.0] * 3


def _refuse(*_args: object) -> None:
    raise AssertionError("compiled too late")


@pytest.mark.slow
def test_long_messages_of_plans_are_left_out(tmp_path: Path) -> None:
    cloud = "sensor_msgs/PointCloud2"
    points = {"data": "A" * (MAX_CLOUD_BYTES // 2)}  # base64
    too_many = {"fields": [{"name": "x" * 100}] * (MAX_PLAN_MESSAGE // 100)}
    path = {"poses": [{"header": {"frame_id": "x" * 1_000_000}}] * 2}
    topics: Topics = {"/cloud": (cloud, [points, too_many]), "/path": (PATH, [path, {}])}
    recording = read(write(tmp_path / "a.bag", {"/Ego_topic": (EGO, ways(1.0)), **topics}))
    clouds, paths = recording.plans
    assert (len(clouds.raws), len(paths.raws)) == (2, 1)
    assert recording.notes == ("1 messages with plans are left out: above 1.5 MB, or 8 MB of a cloud",)
    first: Any = clouds.decode(clouds.raws[0])
    assert len(first["data"]) == MAX_CLOUD_BYTES // 2 * 3 // 4
    with pytest.raises(DocumentError, match="expected at most 1,500,000 bytes beside those of its points"):
        clouds.decode(clouds.raws[1])


# Strangers' bags

HEADER = "=" * 80 + "\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
VECTOR = "=" * 80 + "\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
OTHER_STATUS = (
    "Header header\nObjectStatus[] npc_list\n"
    + ("=" * 80)
    + "\nMSG: morai_msgs/ObjectStatus\nint32 unique_id\nstring name\nfloat64 heading\nfloat64 extra\n"
    "geometry_msgs/Vector3 velocity\ngeometry_msgs/Vector3 acceleration\ngeometry_msgs/Vector3 size\n"
    "geometry_msgs/Vector3 position\n"
)


def write_strange(
    path: Path,
    text: str,
    raw_of: Callable[[Typestore], bytes],
    topic: str = "/Object_topic",
    name: str = "ObjectStatusList",
) -> Path:
    """A ROS 1 bag with one message of a definition of somebody's own."""
    full_name = f"morai_msgs/msg/{name}"
    types = get_typestore(Stores.EMPTY)
    types.register(get_types_from_msg(text, full_name))
    with Writer1(path) as writer:
        connection = writer.add_connection(topic, full_name, msgdef=text, md5sum="0" * 32)
        broken = writer.add_connection("/odd", "odd_msgs/msg/Odd", msgdef="§ this is no definition", md5sum="0" * 32)
        writer.write(connection, FRAME_NS, raw_of(types))
        writer.write(broken, FRAME_NS, b"\1\2\3")
    return path


def test_other_layout_is_read_by_the_bags_own_definition(tmp_path: Path) -> None:
    def raw_of(types: Typestore) -> bytes:
        kinds: dict[str, Any] = types.types  # classes that are made at run time
        vector = kinds["geometry_msgs/msg/Vector3"]
        stamp = kinds["std_msgs/msg/Header"](0, kinds["builtin_interfaces/msg/Time"](1, 0), "")
        status = kinds["morai_msgs/msg/ObjectStatus"](
            5, "Bus", 90.0, 1.0, *(vector(float(i), float(i + 1), float(i + 2)) for i in (1, 4, 7, 10))
        )
        message = kinds["morai_msgs/msg/ObjectStatusList"](stamp, [status])
        return bytes(types.serialize_ros1(message, "morai_msgs/msg/ObjectStatusList"))

    recording = read(write_strange(tmp_path / "a.bag", OTHER_STATUS + HEADER + VECTOR, raw_of))
    assert recording.objects is not None
    assert recording.objects.values[:3, 0].tolist() == [10.0, 11.0, 12.0]
    assert recording.objects.actors[0].uid == 5


def test_message_without_required_fields_is_an_error(tmp_path: Path) -> None:
    path = write_strange(tmp_path / "a.bag", "float64 x\n", lambda _types: bytes(8), "/Ego_topic", "EgoVehicleStatus")
    with pytest.raises(DocumentError, match=r"a\.bag: a message does not fit its type: /Ego_topic: .*'header'"):
        read(path)


def test_bag_without_definitions_uses_the_built_in_ones(tmp_path: Path) -> None:
    store = types_of("26.R1", 2)
    message_type = store.message(EGO)
    path = tmp_path / "old"
    with Writer2(path, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        full_name = EGO.replace("/", "/msg/")
        connection = writer.add_connection("/Ego_topic", full_name, msgdef=store.full_text(EGO), rihs01="RIHS01_0")
        raw = message_type.encode_raw(message_type.check(ways(5.0)[0], FRAME_NS))
        writer.write(connection, FRAME_NS, raw)
    import sqlite3  # noqa: PLC0415 - takes the definitions out, as they were not in there before

    with sqlite3.connect(path / "old.db3") as database:
        database.execute("DELETE FROM message_definitions")
    database.close()
    assert shown(read(path, "26.R1")) == [5.0]


# Broken ones


@pytest.mark.parametrize("name", ["a.bag", "a.mcap"])
def test_broken_bag_gives_one_error_line(tmp_path: Path, name: str) -> None:
    whole = write(tmp_path / name, {"/Ego_topic": (EGO, ways(*range(200)))}).read_bytes()
    path = tmp_path / f"b-{name}"
    texts = []
    for content in (b"", b"no bag at all", whole[: len(whole) // 2], whole[:-20], whole[100:]):
        path.write_bytes(content)
        with pytest.raises(DocumentError) as caught:
            read(path)
        texts.append(str(caught.value))
    assert all(text.startswith(f"b-{name}: ") and "\n" not in text for text in texts)
    assert all("is not a bag, or has no index" in text for text in texts[:3])


@pytest.mark.slow
def test_any_damaged_bytes_give_a_recording_or_a_reason(tmp_path: Path) -> None:
    for name in ("a.bag", "a.mcap"):
        whole = write(tmp_path / name, {"/Ego_topic": (EGO, ways(*range(20)))}).read_bytes()
        for at in range(0, len(whole), len(whole) // 12):
            path = tmp_path / f"b-{name}"
            path.write_bytes(whole[:at] + b"\xff\xfe\xfd\xfc" + whole[at + 4 :])
            with suppress(DocumentError):
                assert isinstance(read(path), Recording)
