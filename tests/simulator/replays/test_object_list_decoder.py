"""Object lists decoded from bytes: equal to the library's result, and an error for anything else."""

from __future__ import annotations

import struct
from functools import cache
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.simulator.replays.object_list_decoder import decode_object_lists
from rosbridge_sim.world.state.world import Kind
from tests.mutations import examples

VECTORS = st.fixed_dictionaries(dict.fromkeys("xyz", st.floats(allow_nan=False)))
STATUSES = st.fixed_dictionaries(
    {
        "unique_id": st.integers(-(2**31), 2**31 - 1),
        "type": st.integers(-1, 2),
        "name": st.text(st.characters(blacklist_characters="\0", blacklist_categories=["Cs"]), max_size=9),
        "heading": st.floats(allow_nan=False),
        "velocity": VECTORS,
        "size": VECTORS,
        "position": VECTORS,
    }
)
LISTS = st.fixed_dictionaries(
    {
        "header": st.fixed_dictionaries({"frame_id": st.sampled_from(["", "a", "ab", "abc", "ObjectInfo"])}),
        **dict.fromkeys(("npc_list", "pedestrian_list", "obstacle_list"), st.lists(STATUSES, max_size=3)),
    }
)


@cache
def stores(ros: Literal[1, 2]) -> tuple[Store, Typestore]:
    store = Store(read_definitions("22.R2"), ros=ros)
    types = get_typestore(Stores.EMPTY)
    for name in ("ObjectStatusList", "ReplayInfo"):
        found = get_types_from_msg(store.full_text(f"morai_msgs/{name}"), f"morai_msgs/msg/{name}")
        types.register({key: value for key, value in found.items() if key not in types.fielddefs})
    return store, types


def encode(ros: Literal[1, 2], name: str, fields: dict[str, Any]) -> tuple[bytes, Any]:
    """Bytes of a message, and what the library finds in them."""
    store, types = stores(ros)
    message_type = store.message(f"morai_msgs/{name}")
    raw = message_type.encode_raw(message_type.check(fields, 12_000_000_034))
    decode = types.deserialize_ros1 if ros == 1 else types.deserialize_cdr
    return raw, decode(raw, f"morai_msgs/msg/{name}")


@examples(15)
@given(fields=LISTS, ros=st.sampled_from([1, 2]), name=st.sampled_from(["ObjectStatusList", "ReplayInfo"]))
def test_decoder_agrees_with_the_library(fields: dict[str, Any], ros: Literal[1, 2], name: str) -> None:
    raw, message = encode(ros, name, fields)
    found = decode_object_lists(raw, is_cdr=ros == 2, has_pedals=name == "ReplayInfo")
    lists = ((Kind.VEHICLE, "npc_list"), (Kind.PEDESTRIAN, "pedestrian_list"), (Kind.OBSTACLE, "obstacle_list"))
    everybody = [(kind, one) for kind, key in lists for one in getattr(message, key) if one.type != -1]
    assert found.who == [(one.unique_id, kind, one.name) for kind, one in everybody]
    figures = [(one.heading, *[getattr(part, axis) for part in _parts(one) for axis in "xyz"]) for _, one in everybody]
    assert list(struct.iter_unpack("<13d", found.figures)) == figures
    stamp = message.header.stamp
    assert found.stamp_ns == stamp.sec * 10**9 + stamp.nanosec


def _parts(one: Any) -> tuple[Any, ...]:  # noqa: ANN401 - the library's own class
    return one.velocity, one.acceleration, one.size, one.position


@pytest.mark.parametrize("ros", [1, 2])
def test_pedals_are_decoded_by_name(ros: Literal[1, 2]) -> None:
    fields = {
        "ego_acc": 0.1,
        "ego_brake": 0.2,
        "ego_steer": 0.3,
        "orientation": {"x": 1.0, "y": 2.0, "z": 3.0, "w": 4.0},
        "linear_acceleration": {"x": 5.0},
        "angular_velocity": {"z": 6.0},
    }
    raw, _ = encode(ros, "ReplayInfo", fields)
    pedals = decode_object_lists(raw, is_cdr=ros == 2, has_pedals=True).pedals
    assert pedals is not None
    assert (pedals.ego_acc, pedals.ego_brake, pedals.ego_steer) == (0.1, 0.2, 0.3)
    turn = pedals.orientation
    assert (turn.x, turn.y, turn.z, turn.w) == (1.0, 2.0, 3.0, 4.0)
    assert (pedals.linear_acceleration.x, pedals.angular_velocity.z) == (5.0, 6.0)


@pytest.mark.parametrize("ros", [1, 2])
def test_truncated_bytes_are_refused(ros: Literal[1, 2]) -> None:
    raw, _ = encode(ros, "ObjectStatusList", {"npc_list": [{"name": "Bus"}], "obstacle_list": [{"name": "Box"}]})
    for size in range(len(raw)):
        with pytest.raises(ValueError, match=r"too short|plain CDR"):
            decode_object_lists(raw[:size], is_cdr=ros == 2, has_pedals=False)


def test_other_byte_orders_are_refused() -> None:
    raw, _ = encode(2, "ObjectStatusList", {})
    with pytest.raises(ValueError, match="expected plain CDR, little-endian"):
        decode_object_lists(b"\0\0" + raw[2:], is_cdr=True, has_pedals=False)
