"""The files of a mock: its own, and those beside it that it names."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rosbridge_sim.documents.yaml_reading import MAX_YAML_BYTES, YamlDocument, read_yaml
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.mock.mock_model import MockRecording
from rosbridge_sim.mock.mock_plan import MockFiles
from rosbridge_sim.mock.recorded_topics import RecordedFile, RecordedTrack, choose_topics
from rosbridge_sim.schema.plain_values import plain_message
from rosbridge_sim.shell.bags.bag_reader import BagTypes, open_reader, read_messages
from rosbridge_sim.shell.files.bounded_read import read_bounded
from rosbridge_sim.shell.files.definitions import Texts

if TYPE_CHECKING:  # as in bag_reader
    from rosbags.interfaces import Connection
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

SHORTEST_LOOP_NS: Final = 100_000_000
"""Shortest time in which a recording is played [ns]; one of a single message has no length."""

MAX_FILE: Final = 20_000_000
"""Longest picture or table [bytes]."""

MAX_RECORDED: Final = 200_000_000
"""Most bytes of all messages of a mock's recordings together; they are kept in memory."""


def read_mock(path: Path) -> YamlDocument:
    """Read a mock's file.

    Raises:
        DocumentError: it cannot be read, is no YAML, or has nothing.
    """
    document = read_yaml(read_bounded(path, MAX_YAML_BYTES), path.name)
    if document.value is None:
        raise DocumentError(f"{path.name}: expected topics, services or other keys of a mock, got an empty file")
    return document


class DiskMockFiles(MockFiles):
    """Files in the folder of a mock's file; `MockPath` has refused all others."""

    def __init__(self, folder: Path, texts: Texts) -> None:
        """Know the folder.

        Args:
            texts: definitions for bags without their own.
        """
        self._folder = folder
        self._texts = texts
        self._num_bytes = 0

    def read(self, path: str) -> bytes:
        """Return the content of a file.

        Raises:
            DocumentError: it cannot be read, or is too long.
        """
        return read_bounded(self._folder / path, MAX_FILE)

    def record(self, recording: MockRecording, others: Collection[str]) -> RecordedFile:
        """Return the messages of a bag.

        Args:
            others: topics that are left out.

        Raises:
            DocumentError: it cannot be read, is too long, or has none of the topics.
        """
        path = self._folder / recording.file
        types = BagTypes(self._texts, is_ros1=path.suffix == ".bag")
        with open_reader(path) as bag:
            found: dict[str, list[Connection]] = {}
            for one in bag.connections:
                if one.msgcount:
                    found.setdefault(one.topic, []).append(one)
            names = choose_topics(list(found), recording.topics, others)
            tracks = [self._track(bag, found[name], path, types, recording.speed) for name in names]
            start_ns, end_ns = bag.start_time, bag.end_time
        if not tracks:
            raise DocumentError(f"{recording.file}: expected messages of topics that `topics` does not have, got none")
        num = max(len(track.times_ns) for track in tracks)
        gap_ns = (end_ns - start_ns) // max(1, num - 1)  # between the last message and the first one again
        return RecordedFile(max(SHORTEST_LOOP_NS, round((end_ns - start_ns + gap_ns) / recording.speed)), tuple(tracks))

    def _track(
        self, bag: Reader1 | Reader2, connections: list[Connection], path: Path, types: BagTypes, speed: float
    ) -> RecordedTrack:
        """Return the messages of a topic; errors as for `record`."""
        read, fields = types.decoder(connections[0]), types.fields_of(connections[0])
        times_ns, messages = [], []
        for _, stamp_ns, raw in read_messages(bag, connections, path):
            self._num_bytes += len(raw)
            if self._num_bytes > MAX_RECORDED:
                raise DocumentError(f"{path.name}: expected at most {MAX_RECORDED:,} bytes of recorded messages")
            times_ns.append(round((stamp_ns - bag.start_time) / speed))
            messages.append(bytes(raw))
        type_name = connections[0].msgtype.replace("/msg/", "/")
        return RecordedTrack(
            connections[0].topic, type_name, times_ns, messages, lambda raw: plain_message(read(raw), fields)
        )
