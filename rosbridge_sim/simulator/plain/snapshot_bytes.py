"""A snapshot as bytes: a head that says what it fits, the state, and a checksum.

    8 bytes   magic: a byte beyond ASCII and a line end, so that a transfer as text is noticed
    2         version of the format
    4         length of the head
    ...       the head, as `plain_bytes` writes it: a dict, see `SnapshotHead`
    ...       the state, likewise
    16        checksum of all before it: BLAKE2b

All numbers are little-endian. The head is compared with the simulator before the state is decoded.
"""

from __future__ import annotations

import struct
from hashlib import blake2b
from typing import Final, NamedTuple

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.records import Record
from rosbridge_sim.simulator.plain.plain_bytes import PlainData, decode, encode
from rosbridge_sim.simulator.plain.typed_plain import as_plain, read_as

MAGIC: Final = b"\x89RBSIM\r\n"
VERSION: Final = 3
CHECKSUM_SIZE: Final = 16

MAX_MAPS: Final = 16
"""Maps that one snapshot may need: that in use, and those of scenarios that wait."""

MAX_OWN: Final = 1_000
"""Snapshots of this process that are known by their bytes: ten times as many as are kept, at 300 bytes each."""

OWN_DIGEST_SIZE: Final = 32
"""Of a digest that stands for bytes [bytes]: nobody can make other bytes with the same one. The checksum is too short
for that, since a client may choose both."""

_START: Final = struct.Struct("<HI")
_HEAD_AT: Final = len(MAGIC) + _START.size


class SnapshotHead(Record):
    """Conditions for a restore of a snapshot, and the state that it gives.

    Attributes:
        layout: stands for the columns of the world's arrays.
        definitions: stands for the definitions of the messages, which differ from release to release.
        profile: the profile in words, for comparison and for errors.
        dynamics: the model of the egos in words, likewise.
        maps: names and digests of the maps that it needs.
        recording: name and digest of the bag that moves the world; None for none.
        frame: of the world.
        state_hash: of the state.
    """

    layout: bytes
    definitions: bytes
    profile: str
    dynamics: str
    maps: tuple[tuple[str, bytes], ...]
    recording: tuple[str, bytes] | None
    frame: int
    state_hash: str


def pack(head: SnapshotHead, state: PlainData) -> bytes:
    """Return a snapshot as bytes; equal ones have equal bytes."""
    plain = encode(as_plain(head))
    parts = [MAGIC, _START.pack(VERSION, len(plain)), plain, encode(state)]
    checksum = blake2b(digest_size=CHECKSUM_SIZE)
    for part in parts:
        checksum.update(part)
    return b"".join([*parts, checksum.digest()])


def unpack(data: bytes) -> tuple[SnapshotHead, bytes]:
    """Return the head of a snapshot, and the bytes of its state, which `decode` reads.

    Args:
        data: from anywhere.

    Raises:
        DocumentError: they are no snapshot, one of another version, or damaged.
    """
    if not data.startswith(MAGIC):
        raise DocumentError(f"data: expected a snapshot of rosbridge-sim, got {len(data):,} bytes that begin otherwise")
    if len(data) < _HEAD_AT + CHECKSUM_SIZE:
        raise DocumentError(f"data: expected more than {len(data)} bytes: the snapshot is cut off")
    version, size = _START.unpack_from(data, len(MAGIC))
    if version != VERSION:
        raise DocumentError(f"data: expected a snapshot of version {VERSION}, got one of version {version}")
    if blake2b(data[:-CHECKSUM_SIZE], digest_size=CHECKSUM_SIZE).digest() != data[-CHECKSUM_SIZE:]:
        raise DocumentError("data: the checksum is wrong: the snapshot is damaged or cut off")
    end = len(data) - CHECKSUM_SIZE
    if _HEAD_AT + size > end:
        raise DocumentError("data: the head is longer than the snapshot")
    head = read_as(SnapshotHead, decode(data[_HEAD_AT : _HEAD_AT + size]), "head")
    if not 0 < len(head.maps) <= MAX_MAPS or head.frame < 0:
        raise DocumentError(f"head: expected 1..{MAX_MAPS} maps, and a frame")
    return head, data[_HEAD_AT + size : end]


class OwnKey(NamedTuple):
    """A key by which bytes that this process has made are recognized.

    Attributes:
        checksum: the last of the bytes.
        length: of all.
        digest: of all.
    """

    checksum: bytes
    length: int
    digest: bytes

    @classmethod
    def of(cls, data: bytes) -> OwnKey:
        """Return the key of bytes from `pack`, or from anywhere."""
        return cls(data[-CHECKSUM_SIZE:], len(data), blake2b(data, digest_size=OWN_DIGEST_SIZE).digest())


class OwnBytes:
    """Digests of the snapshots that this process has made: bytes that come back unchanged need no distrust."""

    def __init__(self) -> None:
        self._known: dict[bytes, tuple[OwnKey, str, SnapshotHead]] = {}  # by their checksums

    def note(self, key: OwnKey, name: str, head: SnapshotHead) -> None:
        """Take note of bytes that are given to a client; the oldest of too many are forgotten.

        Args:
            key: of bytes from `pack`.
        """
        self._known.pop(key.checksum, None)
        if len(self._known) >= MAX_OWN:
            del self._known[next(iter(self._known))]
        self._known[key.checksum] = key, name, head

    def find(self, data: bytes) -> tuple[str, SnapshotHead] | None:
        """Return the name and the head of a snapshot whose bytes are exactly these; None if it is not known.

        Args:
            data: from anywhere.
        """
        known = self._known.get(data[-CHECKSUM_SIZE:])
        if known is None or known[0].length != len(data) or known[0] != OwnKey.of(data):
            return None
        return known[1], known[2]
