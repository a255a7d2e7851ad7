from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass

import pytest

from rosbridge_sim.records import Record, asdict, field, replace


class Point(Record):
    x: float
    y: float = 0.0
    tags: dict[str, int] = field(default_factory=dict)


class Handle(Record, eq=False):
    x: float


@dataclass(frozen=True)
class Plain:
    x: float


def test_record_is_compared_and_hashed_by_its_fields() -> None:
    assert Point(1.0) == Point(x=1.0, y=0.0)
    assert Point(1.0) != Point(2.0)
    assert Handle(1.0) != Handle(1.0)
    assert len({Handle(1.0), Handle(1.0)}) == 2
    assert repr(Point(1.0, 2.0)) == "Point(x=1.0, y=2.0, tags={})"
    assert asdict(Point(1.0, 2.0)) == {"x": 1.0, "y": 2.0, "tags": {}}


def test_field_of_a_record_cannot_be_assigned() -> None:
    point = Point(1.0)
    with pytest.raises(AttributeError):
        point.x = 2.0  # type: ignore[misc] # what is refused
    assert point.x == 1.0


def test_default_of_a_record_is_its_own() -> None:
    Point(1.0).tags["a"] = 1
    assert Point(1.0).tags == {}


@pytest.mark.parametrize("one", [Point(1.0), Plain(1.0)])
def test_copy_has_the_other_fields_as_they_were(one: Point | Plain) -> None:
    assert replace(one, x=3.0) == type(one)(3.0)
    assert one == type(one)(1.0)
    with pytest.raises(TypeError):
        replace(one, speed=1.0)


def test_record_can_be_sent_to_other_processes() -> None:
    assert pickle.loads(pickle.dumps(Point(1.0, 2.0))) == copy.deepcopy(Point(1.0, 2.0)) == Point(1.0, 2.0)  # noqa: S301 # our own
