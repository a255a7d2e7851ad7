"""The table of all topics and services of MORAI's manual: one live check for each.

`python -m tests.end_to_end.test_manual_pages` prints it. A row is green when its effect was seen by a rosbridge client
on a live server, in each release that has it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import Connect
from tests.deployment import Bridges, Place
from tests.end_to_end import rows_ego, rows_lights, rows_replay, rows_scene, rows_sensors, rows_synchronous
from tests.end_to_end.table_rows import Row, SceneClient, write_scenes
from tests.simulator.pages import INTERFACES, RELEASES, REPLACED, Interface
from tests.support import Client

pytestmark = pytest.mark.slow

TABLES = (rows_ego, rows_scene, rows_lights, rows_sensors, rows_replay, rows_synchronous)
ROWS = [row for rows in TABLES for row in rows.TABLE]

KNOWN = {interface.name: interface for interface in (*INTERFACES, *REPLACED.values())}


NOT_BY_THE_BOOK = {
    "/ctrl_cmd",  # the manual's longCmdType
    "/Ego_topic",  # `header.seq` by the frame: rospy counts by itself
    "/InsnControl",  # a number for a string
    "/SensorPosControl",  # a number for a list
    "/Service_MoraiSL",  # the manual's load_object_data
    "/SyncModeScenarioLoad",  # the manual's load_network_connection
    "/SyncModeWaitForTick",  # a float for an integer
    "/Morai_SimProc",  # figures that are compared to the last digit: a float32 comes out widened
    # ticks of a second: which of their topics are heard before the answer is up to its threads
    "/GetTrafficLightStatus",
    "/InsnStatus",
    "/Morai_TLSrv",
    "/SetTrafficLight",
}
"""Rows that send what rosbridge_suite refuses, or look for what it changes or does not promise."""

PLACES = (*(("serve", release) for release in RELEASES), ("attach", "26.R1"))
"""Behind our own bridge in one release: what lies between knows nothing of it. 22.R2 is behind the far side, with the
manners of rosbridge_suite, and each row that is not there is in 26.R1, too."""

STAGES = [pytest.param((kind, release), id=f"{kind}-{release}") for kind, release in PLACES]
BEHIND_THE_SUITE = [pytest.param(("quirks", "22.R2"), id="quirks-22.R2")]


@pytest.fixture(scope="module")
def scene(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, bridges: Bridges
) -> Iterator[tuple[Place, str, Path]]:
    """A simulator of a release in some place, and the folder that it writes to."""
    kind, release = request.param
    folder = tmp_path_factory.mktemp(f"stage-{kind}-{release}")
    write_scenes(folder)
    flags = ["--release", release, "--start", "sync", "--sync-on-loss", "wait", "--scenario-path", str(folder)]
    flags += ["--scenario", str(folder / "page.json"), "--data-dir", str(folder / "data")]
    place = Place(kind, folder / "log.txt", flags, bridges)
    yield place, release, folder / "data"
    place.simulator.stop_cleanly()


# `scene` and `row` are parametrized apart: together, pytest would start a simulator for each row.
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
@pytest.mark.parametrize("scene", STAGES, indirect=True)
async def test_simulator_does_what_each_row_of_the_manual_says(
    scene: tuple[Place, str, Path], connect: Connect, row: Row
) -> None:
    await _check(scene, connect, row)


@pytest.mark.parametrize("row", [row for row in ROWS if row.name not in NOT_BY_THE_BOOK], ids=lambda row: row.name)
@pytest.mark.parametrize("scene", BEHIND_THE_SUITE, indirect=True)
async def test_rows_by_the_book_hold_behind_the_manners_of_rosbridge_suite(
    scene: tuple[Place, str, Path], connect: Connect, row: Row
) -> None:
    await _check(scene, connect, row)


async def _check(scene: tuple[Place, str, Path], connect: Connect, row: Row) -> None:
    place, release, data = scene
    if release not in row.releases:
        assert not await _is_there(await connect(place.url), row.name)
        return
    play = SceneClient(await connect(place.url), release, data, is_attached=place.is_attached)
    await play.begin()
    await _check_type_and_way(play, KNOWN[row.name])
    await row.act(play)


async def _check_type_and_way(play: SceneClient, interface: Interface) -> None:
    """The bus itself says of what type it is, and that the simulator is at the right end of it."""
    short = interface.type.rpartition("/")[2]
    expected = {"SyncModeSLSrv": "MoraiSyncModeSLSrv"}.get(short, short)
    values = play.client.values
    if interface.way == "service":
        answer = await values("/rosapi/service_type", {"service": interface.name})
        ends = [(await values("/rosapi/service_node", {"service": interface.name}))["node"]]
    else:
        answer = await values("/rosapi/topic_type", {"topic": interface.name})
        side = "subscribers" if interface.way == "to the simulator" else "publishers"
        ends = (await values(f"/rosapi/{side}", {"topic": interface.name}))[side]
    assert answer["type"] == f"morai_msgs/{expected}"
    if play.is_attached:
        assert len(ends) == 1, "a bridge has a name of its own for what dials it"
    else:
        assert "/morai_sim" in ends


async def _is_there(client: Client, name: str) -> bool:
    topics, services = await client.values("/rosapi/topics"), await client.values("/rosapi/services")
    return name in topics["topics"] + services["services"]


def test_every_topic_and_service_of_the_manual_has_a_row() -> None:
    rows = [(row.name, release) for row in ROWS for release in row.releases]
    wanted = {
        (REPLACED.get(one.name, one).name if release == "26.R1" else one.name, release)
        for one in INTERFACES
        for release in RELEASES
    }
    assert set(rows) == wanted
    assert len(set(rows)) == len(rows)
    assert all(row.done and row.seen for row in ROWS)


def table() -> str:
    """The rows for a reader, in the order of the manual."""
    order = list(KNOWN)
    lines = ["| name | type | direction | done | seen |", "|---|---|---|---|---|"]
    for row in sorted(ROWS, key=lambda row: order.index(row.name)):
        interface = KNOWN[row.name]
        lines.append(f"| `{row.name}` | `{interface.type}` | {interface.way} | {row.done} | {row.seen} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(table())
