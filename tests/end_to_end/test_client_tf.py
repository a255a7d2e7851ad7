"""Transforms through the client libraries' TFClients, by every route, in both ROS versions."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from tests.conftest import Connect, Serve
from tests.end_to_end.programs import finish, start

pytestmark = [pytest.mark.client, pytest.mark.slow]

WAYS = (
    ("roslibpy-twisted", "service"),
    ("roslibpy-asyncio", "service"),
    ("roslib1", "topics"),
    ("roslib1", "service"),
    ("roslib2", "topics"),
    ("roslib2", "action"),
)

START = [40.0, -1.75, 0.0]
"""Where the demo's ego begins [m]."""

MIDDLE = [40.0 + 4.47 / 2 - 0.89, -1.75, 1.45 / 2]
"""Where the middle of the box around it is then [m]."""


@pytest.mark.parametrize("ros", ["1", "2"])
@pytest.mark.parametrize(("library", "way"), WAYS)
async def test_tf_client_of_each_library_sees_the_car_move(
    serve: Serve, connect: Connect, library: str, way: str, ros: str
) -> None:
    server = serve("--ros", ros)
    seen = finish(start(library, "tf", server.port, "follow", way))
    places = seen["places"]
    assert places[0] == [*START, 0.0, 0.0, 0.0, 1.0]
    assert seen["first_center"] == pytest.approx(MIDDLE)
    for before, after in pairwise(places):
        assert math.dist(before[:2], after[:2]) > 0.1, "less than was asked for"
    assert places[-1][0] > START[0] + 1.0
    client = await connect(server.url)
    topics = (await client.values("/rosapi/topics"))["topics"]
    assert not [topic for topic in topics if "tf_repub" in topic], "the topic of the service stayed behind"
