"""Which scenarios and maps are found on the disk, what is refused, and what is said of it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files.library import DATA, DiskLibrary
from rosbridge_sim.world.state.world import DT
from tests.maps.opendrive.xodr_texts import document, road
from tests.shell.files.conftest import Lay

# Scenarios


@pytest.fixture
def demo() -> str:
    return (DATA / "scenarios" / "demo.json").read_text()


def test_built_in_scenario_is_found_with_and_without_suffix() -> None:
    library = DiskLibrary()
    assert library.scenario("demo").name == library.scenario("demo.json").name == "demo"
    assert "demo" in library.scenario_names()


def test_user_folders_are_searched_first_and_in_order(lay: Lay, demo: str) -> None:
    root = lay({"a/mine.json": demo, "b/mine.json": "broken", "b/other.json": demo})
    library = DiskLibrary([root / "a", root / "b"])
    library.scenario("mine")
    library.scenario("other.json")
    with pytest.raises(DocumentError, match=r"b/mine\.json"):
        DiskLibrary([root / "b", root / "a"]).scenario("mine")


def test_scenario_in_a_folder_of_its_map_is_found(lay: Lay, demo: str) -> None:
    root = lay({"Seoul/one.json": demo, "Busan [old]/two.json": demo})
    library = DiskLibrary([root])
    for name in ("one", "one.json", "Seoul/one", "Seoul\\one.json", "Busan [old]/two", "two"):
        library.scenario(name)
    with pytest.raises(DocumentError, match="no scenario 'Seoul/two'; known are Busan"):
        library.scenario("Seoul/two")


def test_scenario_name_of_two_maps_is_reported(lay: Lay, demo: str, caplog: pytest.LogCaptureFixture) -> None:
    root = lay({"A/one.json": demo, "B/one.json": "broken"})
    DiskLibrary([root]).scenario("one")
    assert caplog.messages == [
        f"took {root}/A/one.json, but several scenarios are named one.json; use MAP/NAME to choose one"
    ]


@pytest.mark.parametrize(
    "name",
    [
        "",
        ".",
        "..",
        "../secret",
        "..\\secret",
        "a/../../secret",
        "/etc/passwd",
        "C:\\secret",
        "a/b/c",
        "a//b",
        "a\0b",
        "a\nb",
        "*",
        "x" * 300,
        "한" * 84,
        "한" * 86 + "/x",
        "x" * 199 + "é" * 28 + ".json",
    ],
)
def test_name_outside_the_folder_is_refused(lay: Lay, demo: str, name: str) -> None:
    root = lay({"in/mine.json": demo, "secret.json": demo})
    with pytest.raises(DocumentError, match="is not a scenario's name") as caught:
        DiskLibrary([root / "in"]).scenario(name)
    assert "\n" not in str(caught.value)


def test_link_outside_the_folder_is_refused(lay: Lay, demo: str) -> None:
    root = lay({"in/mine.json": demo, "out/secret.json": demo})
    (root / "in/link.json").symlink_to(root / "out/secret.json")
    (root / "in/linked").symlink_to(root / "out")
    (root / "in/alias.json").symlink_to(root / "in/mine.json")
    library = DiskLibrary([root / "in"])
    for name in ("link", "secret", "linked/secret"):
        with pytest.raises(DocumentError, match="leads out of --scenario-path"):
            library.scenario(name)
    library.scenario("alias")


def test_unknown_scenario_error_lists_the_known_ones(lay: Lay, demo: str) -> None:
    root = lay({"mine.json": demo, "Seoul/one.json": demo})
    with pytest.raises(DocumentError, match="no scenario 'nothing'; known are Seoul/one, mine, demo") as caught:
        DiskLibrary([root]).scenario("nothing")
    assert str(caught.value).endswith(", town, and --scenario-path takes a folder")


def test_command_line_may_name_any_file(lay: Lay, demo: str, monkeypatch: pytest.MonkeyPatch) -> None:
    root = lay({"mine.json": demo, "sub/other": demo})
    monkeypatch.chdir(root)
    library = DiskLibrary()
    for name in ("mine.json", str(root / "mine.json"), "sub/../mine.json", "./sub/other", "demo", "demo.json"):
        library.opening_scenario(name)
    with pytest.raises(DocumentError, match=r"nowhere/x\.json: cannot be read: No such file"):
        library.opening_scenario("nowhere/x.json")
    with pytest.raises(DocumentError, match=r"no scenario 'x\.json'"):
        library.opening_scenario("x.json")


def test_clients_may_load_the_file_that_the_server_was_started_with(lay: Lay, demo: str) -> None:
    empty = json.dumps({"mapInfo": {"mapName": "track"}})
    root = lay({"at/mine.json": demo, "at/other.json": demo, "at/plain": demo, "in/mine.json": empty})
    library = DiskLibrary()
    with pytest.raises(DocumentError, match="no scenario 'mine'"):
        library.scenario("mine")
    library.opening_scenario(str(root / "at/mine.json"))
    assert [library.scenario(name).egos != () for name in ("mine", "mine.json")] == [True, True]
    for name in ("other", "at/mine"):
        with pytest.raises(DocumentError, match=f"no scenario '{name}'; known are mine, demo"):
            library.scenario(name)
    library.opening_scenario(str(root / "at/plain"))
    assert library.scenario("plain").egos != ()
    # A folder that is given for clients comes first.
    library = DiskLibrary([root / "in"])
    library.opening_scenario(str(root / "at/mine.json"))
    assert library.scenario("mine").egos == ()


def test_missing_scenario_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="expected a folder with scenarios; there is none"):
        DiskLibrary([tmp_path / "nowhere"])


# Maps


def test_built_in_map_is_found() -> None:
    assert DiskLibrary().map("track").name == "track"


@pytest.mark.parametrize("name", ["", "..", "nothing", "../maps/track", "/etc", "한" * 86, "a\0b"])
def test_unknown_map_error_lists_the_known_ones(name: str) -> None:
    with pytest.raises(
        DocumentError, match=r"no map .*; known are hills, loop, motorway, parking, roundabout, town, track"
    ):
        DiskLibrary().map(name)


def test_user_map_replaces_every_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(DATA / "maps" / "track", tmp_path / "Seoul")
    monkeypatch.chdir(tmp_path)
    for own_map in (str(tmp_path / "Seoul"), "./Seoul", "Seoul"):
        assert DiskLibrary(own_map=own_map).map("anything").name == "Seoul"
    assert DiskLibrary(own_map="track").map("anything").name == "track"
    with pytest.raises(DocumentError, match="no map 'Busan'"):
        DiskLibrary(own_map="Busan").map("track")


def test_opendrive_file_is_a_map_by_its_suffix_or_its_root(tmp_path: Path) -> None:
    for name in ("a.xodr", "B.XODR", "c.xml"):
        (tmp_path / name).write_bytes(document(road()))
        assert DiskLibrary(own_map=str(tmp_path / name)).map("any").roads.ids == ("1.0.-1",)
    assert DiskLibrary(own_map=str(tmp_path / "a.xodr")).map("any").name == "a"
    (tmp_path / "d.xml").write_text("<osm/>")
    with pytest.raises(DocumentError, match="OpenStreetMap is not read"):
        DiskLibrary(own_map=str(tmp_path / "d.xml")).map("any")


def test_scenario_names_an_opendrive_map_in_its_folders(tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "Town.xodr").write_bytes(document(road()))
    (tmp_path / "outside.xodr").write_bytes(document(road()))
    (tmp_path / "inner" / "link.xodr").symlink_to(tmp_path / "outside.xodr")
    library = DiskLibrary([tmp_path / "inner"])
    town = library.map("Town")
    assert town is library.map("Town.xodr")
    assert (town.name, library.map_files("Town")) == ("Town", [tmp_path / "inner" / "Town.xodr"])
    for name in ("../outside", "outside", "link", "link.xodr", "inner/Town"):
        with pytest.raises(DocumentError, match="no map"):
            library.map(name)


def test_signal_plan_of_the_user_is_read_again_when_it_changes(tmp_path: Path) -> None:
    plan = tmp_path / "plan.json"
    light = '<signals><signal id="T" s="60" t="-4" type="1000001" orientation="+" dynamic="yes"/></signals>'
    (tmp_path / "a.xodr").write_bytes(document(road(more=light)))
    library = DiskLibrary(own_map=str(tmp_path / "a.xodr"), own_signal_plan=plan)
    for seconds in (5, 12):
        phases = [{"green": ["T"], "seconds": seconds}]
        plan.write_text(json.dumps({"junctions": {"signal T": {"phases": phases, "yellow": 0, "all_red": 1}}}))
        found = library.map("any").plan
        assert found is not None
        assert found.cycle[0] == (seconds + 1) / DT
    with pytest.raises(DocumentError, match="cannot be read"):
        DiskLibrary(own_signal_plan=tmp_path / "gone").map("track")


def test_map_folder_without_its_files_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=r"node_set\.json is missing"):
        DiskLibrary(own_map=str(tmp_path)).map("track")
