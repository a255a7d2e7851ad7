"""Sums of types, as `rosmsg md5` and `rossrv md5` of Noetic print them."""

from __future__ import annotations

import pytest

from rosbridge_sim.schema.definitions.md5 import message_md5, service_md5
from rosbridge_sim.schema.store import Store
from tests.graph.bus_fixture import make_store


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1"),
        ("sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2"),
        ("sensor_msgs/PointCloud2", "1158d486dd51d683ce2f1be655c3c181"),
        ("nav_msgs/Odometry", "cd5e73d190d741a2f92e81eda573aca7"),
        ("visualization_msgs/Marker", "4048c9de2a16f4ae8e0538085ebf1b97"),
        ("actionlib_msgs/GoalStatusArray", "8b2b82f13216d0a8ea88bd3af735e619"),
        ("std_msgs/Empty", "d41d8cd98f00b204e9800998ecf8427e"),
    ],
)
def test_sums_of_messages(name: str, expected: str) -> None:
    assert message_md5(make_store(1).message(name).spec) == expected


def test_sum_of_a_service_is_over_both_parts() -> None:
    trigger = make_store(1).service("std_srvs/Trigger")
    assert service_md5(trigger.request.spec, trigger.response.spec) == "937c9679a518e3a18d831e57125ea522"


def test_text_that_multiplies_is_read_once() -> None:
    texts = {("p", "msg", f"N{i}"): f"N{i + 1} a\nN{i + 1} b # twice" for i in range(12)}
    store = Store({**texts, ("p", "msg", "N12"): "uint8 x"})
    assert message_md5(store.message("p/N0").spec) != message_md5(store.message("p/N1").spec)
