"""A type of a package that nobody knows is relayed: told once, and remembered within bounds."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from rosbridge_sim.errors import GraphError, UnknownPackageError
from rosbridge_sim.graph import type_resolution
from rosbridge_sim.graph.type_resolution import TypeResolver
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType
from tests.graph.bus_fixture import make_store


class Room:
    """A resolver, and types that are in use for good.

    Attributes:
        num_looks: how often it has asked for the types in use.
    """

    def __init__(self, *, is_strict: bool = False) -> None:
        self.num_looks = 0
        self.in_use: list[MessageType | OpaqueType] = []
        self.types = TypeResolver(make_store(), self._look, is_strict=is_strict)

    def _look(self) -> Iterator[MessageType | OpaqueType]:
        self.num_looks += 1
        yield from self.in_use


@pytest.fixture
def room(monkeypatch: pytest.MonkeyPatch) -> Room:
    """Five types that nobody uses are many."""
    monkeypatch.setattr(type_resolution, "MAX_REMEMBERED_TYPES", 5)
    return Room()


def test_strange_type_in_use_stays_itself_and_the_others_are_bounded(room: Room) -> None:
    kept = room.types.message("strange_msgs/Kept")
    room.in_use.append(kept)
    for i in range(20):
        room.types.message(f"strange_msgs/T{i}")
    assert len(room.types._opaque) <= 10
    assert room.types.message("strange_msgs/msg/Kept") is kept


def test_new_unknown_type_costs_no_search_through_the_others(room: Room) -> None:
    for i in range(200):
        room.in_use.append(room.types.message(f"strange_msgs/T{i}"))
    assert len(room.types._opaque) == 200
    assert room.num_looks < 15


def test_unknown_packages_of_services_and_actions_are_told_once_each_and_in_bounds(
    room: Room, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(3):
        room.types.service("my_msgs/Thing")
        room.types.service("my_msgs//srv/Thing")
        room.types.action("my_msgs/Thing")
    assert [record.getMessage() for record in caplog.records] == [
        "my_msgs/Thing: its package is unknown; calls of this service are relayed unchecked",
        "my_msgs/Thing: its package is unknown; goals of this action are relayed unchecked",
    ]
    for n in range(100):
        room.types.service(f"my_msgs/T{n}")
    assert len(room.types._logged) <= 5


@pytest.mark.parametrize("kind", ["message", "service", "action"])
def test_name_of_a_strange_type_is_as_long_as_a_name_may_be(kind: str) -> None:
    with pytest.raises(GraphError, match="is not a valid graph name"):
        getattr(Room().types, kind)(f"my_msgs/{'T' * 1000}")


@pytest.mark.parametrize("kind", ["message", "service", "action"])
def test_strict_resolver_refuses_what_nobody_knows(kind: str) -> None:
    with pytest.raises(UnknownPackageError):
        getattr(Room(is_strict=True).types, kind)("my_msgs/Thing")
