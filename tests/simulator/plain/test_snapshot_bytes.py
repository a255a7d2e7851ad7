"""Bytes of snapshots: those that this process has made are known again."""

from __future__ import annotations

from rosbridge_sim.simulator.plain.snapshot_bytes import CHECKSUM_SIZE, MAX_OWN, OwnBytes, OwnKey, SnapshotHead, pack

HEAD = SnapshotHead(b"layout", b"types", "profile", "--dynamics kinematic", (("map", b"digest"),), None, 5, "hash")


def test_own_bytes_are_known_and_all_others_are_not() -> None:
    own, data = OwnBytes(), pack(HEAD, {"a": 1})
    assert own.find(data) is None
    own.note(OwnKey.of(data), "name", HEAD)
    assert own.find(data) == ("name", HEAD)
    assert own.find(bytes([data[0] ^ 1]) + data[1:]) is None, "with the same checksum behind it"
    assert own.find(b"x" + data) is None
    assert own.find(data[-CHECKSUM_SIZE:]) is None
    assert own.find(b"") is None


def test_oldest_of_too_many_own_bytes_is_forgotten() -> None:
    own = OwnBytes()
    made = [pack(HEAD, i) for i in range(MAX_OWN + 1)]
    for i, data in enumerate(made):
        own.note(OwnKey.of(data), str(i), HEAD)
        own.note(OwnKey.of(made[1]), "again", HEAD)
    assert own.find(made[0]) is None
    assert [own.find(data) is not None for data in made[1:]] == [True] * MAX_OWN
