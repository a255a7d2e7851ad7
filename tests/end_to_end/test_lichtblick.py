"""Lichtblick's packages for rosbridge, step by step: everything in `cbor-raw`, without a given type."""

from __future__ import annotations

import pytest

from tests.conftest import Simulate
from tests.end_to_end.programs import finish, start
from tests.schema.reference_readers import alike

pytestmark = [pytest.mark.client, pytest.mark.slow]

SCENE = ("/sim/scene/map", "/sim/scene/objects")
TOPICS = ("/Ego_topic", "/Object_topic", "/clock", *SCENE)


@pytest.mark.parametrize("ros", [1, 2])
def test_lichtblick_reads_the_world(simulate: Simulate, ros: int, request: pytest.FixtureRequest) -> None:
    is_attached = request.node.callspec.params["simulate"] == "attach"
    place = simulate("--ros", str(ros), *(["--scene"] if is_attached else []))
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
    lanes, cars = (
        [marker for marker in seen["messages"][topic]["raw"]["markers"] if marker["ns"] == ns]
        for topic, ns in zip(SCENE, ("lanes", "vehicles"), strict=True)
    )
    assert lanes[0]["header"]["frame_id"] == "map"
    assert len(lanes[0]["points"]) % 3 == 0, "corners of triangles"
    assert cars[0]["scale"]["x"] > 3.0
