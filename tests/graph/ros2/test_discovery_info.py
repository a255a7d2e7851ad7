"""The message about nodes, against a reader of rosbags for the same definition."""

from __future__ import annotations

from typing import Any

import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from rosbridge_sim.graph.ros2.discovery_info import Distro, discovery_type, node_names, write_discovery

PROGRAM, READER, WRITER = (bytes([each] * 16) for each in (1, 2, 3))


def read(distro: Distro, raw: bytes) -> Any:  # noqa: ANN401 - made from a definition
    name, types = discovery_type(distro)
    store = get_typestore(Stores.EMPTY)
    found: Any = {each: ([], fields) for each, fields in types.items()}
    store.register(found)
    return store.deserialize_cdr(raw + bytes(-len(raw) % 4), name)


def test_kinds_of_fields_have_the_numbers_of_rosbags() -> None:
    assert [kind.value for kind in (Nodetype.BASE, Nodetype.NAME, Nodetype.ARRAY, Nodetype.SEQUENCE)] == [1, 2, 3, 4]


@pytest.mark.parametrize(("distro", "length"), [("humble", 24), ("jazzy", 16)])
def test_other_nodes_read_name_and_endpoints(distro: Distro, length: int) -> None:
    raw = write_discovery(distro, PROGRAM, ("/sim1", "rosbridge_sim"), [READER, READER], [WRITER])
    message = read(distro, raw)
    assert bytes(message.gid.data) == PROGRAM.ljust(length, b"\0")
    (node,) = message.node_entities_info_seq
    assert (node.node_namespace, node.node_name) == ("/sim1", "rosbridge_sim")
    assert [bytes(key.data)[:16] for key in node.reader_gid_seq] == [READER, READER]
    assert [bytes(key.data)[:16] for key in node.writer_gid_seq] == [WRITER]


@pytest.mark.parametrize("distro", ["humble", "jazzy"])
def test_names_of_other_nodes_are_read(distro: Distro) -> None:
    raw = write_discovery(distro, PROGRAM, ("/", "planner"), [READER], [WRITER])
    assert node_names(distro, raw) == {READER: "/planner", WRITER: "/planner"}


@pytest.mark.parametrize("distro", ["humble", "jazzy"])
def test_names_of_any_length_keep_what_follows_in_its_place(distro: Distro) -> None:
    for length in range(1, 5):
        node = "/" + "s" * length, "n" * (9 - length) + "x" * length * 2
        raw = write_discovery(distro, PROGRAM, node, [READER], [WRITER, WRITER])
        (found,) = read(distro, raw).node_entities_info_seq
        assert (found.node_namespace, found.node_name) == node
        assert [bytes(key.data)[:16] for key in found.writer_gid_seq] == [WRITER, WRITER]
        assert node_names(distro, raw) == dict.fromkeys([READER, WRITER], "/".join(node))


def test_bytes_that_are_no_such_message_name_nobody() -> None:
    whole = write_discovery("jazzy", PROGRAM, ("/", "planner"), [READER], [WRITER])
    for length in range(len(whole)):
        assert node_names("jazzy", whole[:length]) in ({}, {READER: "/planner"})
    assert node_names("jazzy", b"\0\1\0\0" + PROGRAM + b"\xff" * 200) == {}
