"""The message by which nodes of ROS 2 tell their names and endpoints: `rmw_dds_common/msg/ParticipantEntitiesInfo`.

It is published on `ros_discovery_info`. Its definition differs from one distribution to the next in the length of an
identity alone: 24 bytes in Humble, 16 since Iron, as in DDS.

    Gid gid; NodeEntitiesInfo[] node_entities_info_seq
    NodeEntitiesInfo: string<=256 node_namespace, node_name; Gid[] reader_gid_seq, writer_gid_seq
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Final, Literal, TypeAlias

Distro: TypeAlias = Literal["humble", "iron", "jazzy", "kilted", "rolling"]
"""A distribution of ROS 2."""

DISCOVERY_TOPIC: Final = "ros_discovery_info"
"""Name of the topic for DDS; it has no `rt` before it."""

_GID: Final = 16
_GID_OF_HUMBLE: Final = 24

_TYPE: Final = "rmw_dds_common/msg/ParticipantEntitiesInfo"
_NODE: Final = "rmw_dds_common/msg/NodeEntitiesInfo"
_KEY: Final = "rmw_dds_common/msg/Gid"

_BASE, _NAME, _ARRAY, _SEQUENCE = 1, 2, 3, 4
"""Kinds of fields, as rosbags numbers them."""

MAX_NODES: Final = 1_000
"""Most nodes of one program whose names are read."""


def discovery_type(distro: Distro) -> tuple[str, Mapping[str, object]]:
    """Return the name of the type, and all types in it in the form of rosbags: name -> fields.

    Args:
        distro: distribution whose nodes are met.
    """
    text = (_BASE, ("string", 256))
    kind, length = ("char", _GID_OF_HUMBLE) if distro == "humble" else ("uint8", _GID)
    keys = (_SEQUENCE, ((_NAME, _KEY), 0))
    return _TYPE, {
        _TYPE: [("gid", (_NAME, _KEY)), ("node_entities_info_seq", (_SEQUENCE, ((_NAME, _NODE), 0)))],
        _NODE: [
            ("node_namespace", text),
            ("node_name", text),
            ("reader_gid_seq", keys),
            ("writer_gid_seq", keys),
        ],
        _KEY: [("data", (_ARRAY, ((_BASE, (kind, 0)), length)))],
    }


def write_discovery(
    distro: Distro, program: bytes, node: tuple[str, str], readers: Sequence[bytes], writers: Sequence[bytes]
) -> bytes:
    """Return the message for a program with one node, as CDR.

    Args:
        distro: distribution whose nodes are met.
        program: identity of the program, 16 bytes.
    """
    length = _GID_OF_HUMBLE if distro == "humble" else _GID
    out = bytearray(b"\0\1\0\0" + program.ljust(length, b"\0") + struct.pack("<I", 1))
    for text in node:
        data = text.encode() + b"\0"
        out += bytes(-len(out) % 4) + struct.pack("<I", len(data)) + data
    for keys in (readers, writers):
        out += bytes(-len(out) % 4) + struct.pack("<I", len(keys))
        out += b"".join(key.ljust(length, b"\0") for key in keys)
    return bytes(out)


def node_names(distro: Distro, raw: bytes) -> dict[bytes, str]:
    """Return identity of each endpoint -> full name of its node; empty for bytes that are no such message.

    Args:
        distro: distribution whose nodes are met.
        raw: CDR of another program.
    """
    length = _GID_OF_HUMBLE if distro == "humble" else _GID
    names: dict[bytes, str] = {}
    try:
        at = 4 + length
        (num_nodes,) = struct.unpack_from("<I", raw, at)
        at += 4
        for _ in range(min(num_nodes, MAX_NODES)):
            words = []
            for _ in range(2):
                at += -at % 4
                (size,) = struct.unpack_from("<I", raw, at)
                words.append(raw[at + 4 : at + 3 + size].decode())
                at += 4 + size
            name = f"{words[0].rstrip('/')}/{words[1]}"
            for _ in range(2):
                at += -at % 4
                (count,) = struct.unpack_from("<I", raw, at)
                at += 4
                if at + count * length > len(raw):
                    return {}
                for i in range(count):
                    names[raw[at + i * length : at + i * length + _GID]] = name
                at += count * length
    except (struct.error, UnicodeDecodeError):
        return {}
    return names
