"""The disk behind `/sim/scenarios`: lists, problems and pictures."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import pytest
from PIL import Image

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files.library import DATA, DiskLibrary
from rosbridge_sim.shell.scenario_shelf import DiskShelf
from tests.shell.files.conftest import Lay
from tests.shell.files.conftest import lay as lay  # noqa: PLC0414 - the fixture

DEMO = (DATA / "scenarios" / "demo.json").read_text()


def test_own_scenarios_are_listed_first_and_broken_ones_with_their_problem(lay: Lay) -> None:
    root = lay({"Seoul/mine.json": DEMO, "broken.json": "{", "lost.json": '{"mapInfo": {"mapName": "no such map"}}'})
    found = DiskShelf(DiskLibrary([root]), root).list(0, 50)
    names = [each.name for each in found.scenarios]
    assert names[:3] == ["Seoul/mine", "broken", "lost"]
    assert set(names[3:]) == {"demo", "hills", "loop", "motorway", "parking", "roundabout", "rush_hour", "town"}
    assert found.num_scenarios == 11
    mine, broken, lost, *built_in = found.scenarios
    assert (mine.problem, mine.num_egos) == ("", 1)
    assert "broken.json" in broken.problem
    assert "no map 'no such map'" in lost.problem
    assert {each.problem for each in built_in} == {""}


def test_pages_are_cut_out_of_the_list(lay: Lay) -> None:
    shelf = DiskShelf(DiskLibrary([lay({f"s{i}.json": DEMO for i in range(4)})]), "nowhere")
    assert [each.name for each in shelf.list(1, 2).scenarios] == ["s1", "s2"]
    assert shelf.list(100, 50).scenarios == []


def test_recordings_of_the_data_folder_are_listed_with_their_size(lay: Lay) -> None:
    root = lay({"Replay/a.mcap": "12345", "b.bag": "1", "Replay/c/metadata.yaml": "", "Replay/c/c.db3": "123"})
    found = DiskShelf(DiskLibrary(), root).list(0, 50)
    assert [(each.name, each.size) for each in found.recordings] == [("a.mcap", 5), ("c", 3), ("b.bag", 1)]
    assert all(each.modified_ns > 0 for each in found.recordings)
    assert DiskShelf(DiskLibrary(), root / "none").list(0, 50).recordings == []


def test_picture_has_its_size_and_shows_roads_and_entities() -> None:
    shelf = DiskShelf(DiskLibrary(), "nowhere")
    data = shelf.picture("town", 320, 200)
    image = Image.open(BytesIO(data))
    assert (image.format, image.size) == ("PNG", (320, 200))
    assert len(image.convert("RGB").getcolors(100_000) or ()) > 20
    assert shelf.picture("town", 320, 200) is data


def test_picture_follows_changes_of_the_scenario(lay: Lay, tmp_path: Path) -> None:
    root = lay({"mine.json": DEMO})
    shelf = DiskShelf(DiskLibrary([root]), tmp_path)
    before = shelf.picture("mine", 128, 128)
    (root / "mine.json").write_text((DATA / "scenarios" / "town.json").read_text())
    assert shelf.picture("mine", 128, 128) != before


@pytest.mark.parametrize("name", ["none", "../mine", "", "\x00", "a\nb", "x" * 400])
def test_unknown_name_is_refused(name: str) -> None:
    with pytest.raises(DocumentError):
        DiskShelf(DiskLibrary(), "nowhere").picture(name, 128, 128)
