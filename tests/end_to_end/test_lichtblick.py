"""Lichtblick's packages for rosbridge, step by step: everything in `cbor-raw`, without a given type."""

from __future__ import annotations

import pytest

from tests.conftest import Simulate
from tests.end_to_end.programs import finish, start
from tests.schema.reference_readers import alike

pytestmark = [pytest.mark.client, pytest.mark.slow]

TOPICS = ("/Ego_topic", "/Object_topic", "/clock")


@pytest.mark.parametrize("ros", [1, 2])
def test_lichtblick_reads_the_world(simulate: Simulate, ros: int) -> None:
    place = simulate("--ros", str(ros))
    seen = finish(start("lichtblick", "lichtblick", place.port, "read", *TOPICS))
    assert seen["version"] == ros
    assert seen["problems"] == {}, "each definition can be parsed"
    assert set(TOPICS) <= set(seen["types"])
    if not place.is_attached:  # a bridge has a name of its own for what dials it
        assert dict.fromkeys(TOPICS, "/morai_sim").items() <= seen["publishers"].items()
    assert seen["serviceType"] == ("rosapi/TopicType" if ros == 1 else "rosapi_msgs/srv/TopicType")
    assert seen["answer"] == {"type": seen["types"]["/Ego_topic"]}
    for topic, message in seen["messages"].items():
        assert alike(message["raw"], message["json"]), topic
    assert seen["messages"]["/Object_topic"]["raw"]["num_of_npcs"] > 0
