"""The tools of time in the released client libraries, at the server, behind our bridge, and behind the far side."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest

from tests.deployment import Bridges, Kind, Place
from tests.end_to_end.programs import finish, start

pytestmark = [pytest.mark.client, pytest.mark.slow]

PLACES: dict[str, tuple[Kind, tuple[str, ...]]] = {
    "server": ("serve", ()),
    "server for ROS 2": ("serve", ("--ros", "2")),
    "our bridge": ("attach", ()),
    "far side": ("quirks", ()),
}


@pytest.fixture(scope="module", params=PLACES)
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Place, str]]:
    """A simulator in each place, and what stands before the names of types there."""
    kind, flags = PLACES[request.param]
    folder = tmp_path_factory.mktemp("place")
    bridges = Bridges(folder)
    place = Place(kind, folder / "log.txt", flags, bridges)
    yield place, "srv/" if flags else ""
    place.simulator.stop_cleanly()
    bridges.stop_cleanly()


@pytest.mark.parametrize("library", ["roslibpy-asyncio", "roslib2", "roslib1"])
def test_client_library_steps_saves_restores_and_reads_the_score(place: tuple[Place, str], library: str) -> None:
    where, prefix = place
    seen: dict[str, Any] = finish(start(library, "time_tools", where.port, "branch", prefix))
    result, steps, frame, ego, state_hash = seen["first"]
    assert (result, steps, frame, len(state_hash)) == (True, 30, 60, 32)
    assert json.loads(ego)["velocity"]["x"] > 2.0
    assert seen["by_name"] == seen["by_bytes"] == seen["first"], "the same steps from the same state"
    nowhere, *restored = seen["restored"]
    assert nowhere.startswith("id: no snapshot 'nowhere'")
    assert restored == ["", ""]
    assert seen["names"] == ["here"]
    assert seen["distance"] > 1.2
