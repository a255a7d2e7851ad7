"""Every documented field exists on the wire, or is accepted under its documented name."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.errors import FieldError
from rosbridge_sim.schema.definitions.parse import Field
from rosbridge_sim.schema.message_type import MessageType
from tests.simulator.pages import INTERFACES, RELEASES, RENAMED, REPLACED, SLIPS, TABLES
from tests.simulator.sim_harness import make_store

_GONE = {f"morai_msgs/msg/{name.strip('/')}": f"morai_msgs/{new.name.strip('/')}" for name, new in REPLACED.items()}
"""Types that 26.R1 has under another name, with the same fields."""

_STANDARD = {"Header": "std_msgs/Header", "Time": "time", "Quaternion": "geometry_msgs/Quaternion"}

SAMPLES: dict[str, Any] = {
    **dict.fromkeys(("int8", "int16", "int32", "uint32", "unit32", "uint64"), 3),
    **dict.fromkeys(("float32", "float64"), 0.5),
    "int8[]": [3],
    "int32[]": [3],
    "float32[]": [0.5],
    "float64[]": [0.5],
    "bool": True,
    "string": "7",  # which is also an intersection's number
    "Header": {"frame_id": "here"},
    "Time": {"secs": 3, "nsecs": 0},
    "Vector3": {"x": 1.0, "y": 2.0, "z": 3.0},
    "Quaternion": {"x": 0.0, "y": 0.0, "z": 0.5, "w": 0.5},
    "CtrlCmd": {"accel": 0.5},
    "EgoVehicleStatus": {"unique_id": 2},
    "ObjectStatus": [{"unique_id": 2}],  # printed as one, meant as a list
    "ObjectStatus[]": [{"unique_id": 2}],
    "VehicleCollision[]": [{"crashed_vehicles": [{"unique_id": 2}]}],
}

MESSAGES = [name for name in TABLES if "/srv/" not in name]
SERVICES = [name for name in TABLES if "/srv/" in name]


def printed(field: Field) -> str:
    """The field's type as the pages write it."""
    short = {full: name for name, full in _STANDARD.items()}.get(field.type, field.type)
    return short.rpartition("/")[2] + ("[]" if field.array is not None else "")


def shown(kind: MessageType, values: dict[str, Any]) -> dict[str, Any]:
    """What stands on the wire of a message that a client sends so."""
    message: dict[str, Any] = json.loads(kind.encode_json(kind.check(values, 0)))
    return message


@pytest.mark.parametrize("release", RELEASES)
@pytest.mark.parametrize("name", MESSAGES)
def test_every_documented_message_field_exists(release: str, name: str) -> None:
    store = make_store(release)
    kind = store.message(name if release == "22.R2" else _GONE.get(name, name))
    wire = {field.name: printed(field) for field in kind.definition.fields}
    empty = shown(kind, {})
    for documented_type, documented in TABLES[name]:
        field = RENAMED.get((store.canonical(name), documented), {}).get(release, documented)
        assert field in wire, f"{name} has no {documented}"
        assert wire[field] == SLIPS.get(name, {}).get(documented, documented_type), documented
        if field == "front_steer_angle":
            continue  # goes out alone; whoever reads it knows that it is degrees
        message = shown(kind, {documented: SAMPLES[documented_type]})
        assert message[field] != empty[field], f"{documented} has arrived as {field}"
        assert {other: message[other] for other in message if other != field} == {
            other: empty[other] for other in empty if other != field
        }, "and nothing else has"


@pytest.mark.parametrize("release", RELEASES)
@pytest.mark.parametrize("name", SERVICES)
def test_every_documented_service_has_the_documented_messages(release: str, name: str) -> None:
    kind = make_store(release).service(name)
    for half, (documented_type, documented) in zip((kind.request, kind.response), TABLES[name], strict=True):
        (field,) = half.definition.fields
        assert (printed(field), field.name) == (SLIPS.get(name, {}).get(documented, documented_type), documented)


def test_every_name_with_a_table_is_covered() -> None:
    assert {interface.type for interface in INTERFACES} <= TABLES.keys()
    assert len({interface.name for interface in INTERFACES}) == len(INTERFACES) == 30
    assert SLIPS.keys() <= TABLES.keys()


def test_unknown_field_is_refused_by_name() -> None:
    for release in RELEASES:
        store = make_store(release)
        for name in MESSAGES:
            kind = store.message(name if release == "22.R2" else _GONE.get(name, name))
            with pytest.raises(FieldError, match="nobody"):
                kind.check({"nobody": 1}, 0)
