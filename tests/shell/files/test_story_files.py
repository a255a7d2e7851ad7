"""Which files a scenario of OpenSCENARIO may name, and how it is found."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.shell.files.story_files import MAX_CATALOGUES, StoryOptions, read_parameters
from tests.scenarios.openscenario.test_story import CATALOGUE, DECLARED, REFERENCE
from tests.shell.files.conftest import Lay
from tests.simulator.story.story_texts import story

LOCATIONS = "<CatalogLocations><VehicleCatalog><Directory path='{}'/></VehicleCatalog></CatalogLocations>"
WITH_CAT = REFERENCE.format("fast", "")


def test_a_story_is_found_with_and_without_suffix_behind_a_json_of_that_name(lay: Lay) -> None:
    root = lay({"a.xosc": story({"Ego": ""}), "Town/b.xosc": story({"Ego": ""}), "c.xosc": "x", "c.json": "y"})
    library = DiskLibrary([root])
    for name in ("a", "a.xosc", "b", "Town/b.xosc"):
        assert library.scenario(name).story is not None
    assert {"a", "Town/b", "c"} <= set(library.all_scenario_names())
    with pytest.raises(DocumentError, match=r"c\.json"):
        library.scenario("c")


def test_a_story_of_the_current_folder_is_named_without_a_path(lay: Lay, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(lay({"a.xosc": story({"Ego": ""}), "empty.xosc": "", "spoilt.xosc": "\x01\x02"}))
    assert DiskLibrary().opening_scenario("a.xosc").story is not None
    for name in ("empty.xosc", "spoilt.xosc"):
        with pytest.raises(DocumentError, match=rf"^{name}: line 1: not XML"):
            DiskLibrary().opening_scenario(name)
    with pytest.raises(DocumentError, match=r"^no scenario 'gone.xosc'; known are "):
        DiskLibrary().opening_scenario("gone.xosc")


def test_catalogues_are_read_from_the_folders_that_a_file_names(lay: Lay) -> None:
    text = story({"Ego": ""}, more=LOCATIONS.format("../cars"), entities=WITH_CAT)
    root = lay({"x/a.xosc": text, "cars/one.xosc": CATALOGUE, "cars/notes.txt": "nothing"})
    assert DiskLibrary().opening_scenario(str(root / "x/a.xosc")).vehicles[0].name == "Cat"


def test_paths_in_a_story_of_a_client_stay_within_the_folders(lay: Lay) -> None:
    inside, outside = LOCATIONS.format("cars"), LOCATIONS.format("../out")
    logic = "<RoadNetwork><LogicFile filepath='{}'/></RoadNetwork>"
    plain = story({"Ego": ""}, more=inside, entities=WITH_CAT)
    root = lay(
        {
            "in/good.xosc": plain,
            "in/bad.xosc": story({"Ego": ""}, more=outside, entities=WITH_CAT),
            "in/root.xosc": story({"Ego": ""}, more=LOCATIONS.format("/etc"), entities=WITH_CAT),
            "in/map.xosc": plain.replace("<RoadNetwork/>", logic.format("../out/a.xodr")),
            "in/linked.xosc": story({"Ego": ""}, more=LOCATIONS.format("link"), entities=WITH_CAT),
            "in/file.xosc": story({"Ego": ""}, more=LOCATIONS.format("files"), entities=WITH_CAT),
            "in/cars/one.xosc": CATALOGUE,
            "in/files/.keep": "",
            "out/one.xosc": CATALOGUE,
        }
    )
    (root / "in/link").symlink_to(root / "out")
    (root / "in/files/one.xosc").symlink_to(root / "out/one.xosc")
    library = DiskLibrary([root / "in"])
    library.scenario("good")
    for name in ("bad", "root", "map", "linked", "file"):
        with pytest.raises(DocumentError, match="leads out of --scenario-path"):
            library.scenario(name)


def test_the_users_own_file_may_name_any_path_and_be_loaded_again(lay: Lay) -> None:
    text = story({"Ego": ""}, more=LOCATIONS.format("../out"), entities=WITH_CAT)
    root = lay({"in/mine.xosc": text, "out/one.xosc": CATALOGUE, "folder/.keep": ""})
    library = DiskLibrary([root / "folder"])
    library.opening_scenario(str(root / "in/mine.xosc"))
    for name in ("mine", "mine.xosc"):
        assert library.scenario(name).story is not None


def test_two_maps_of_one_name_have_two_names(lay: Lay) -> None:
    logic = "<RoadNetwork><LogicFile filepath='a.xodr'/></RoadNetwork>"
    text = story({"Ego": ""}).replace("<RoadNetwork/>", logic)
    root = lay({"A/one.xosc": text, "B/two.xosc": text})
    library = DiskLibrary([root])
    names = [library.scenario(name).map_name for name in ("one", "two", "one")]
    assert names == ["a.xodr", "a.xodr (2)", "a.xodr"]


def test_many_catalogues_are_refused(lay: Lay) -> None:
    text = story({"Ego": ""}, more=LOCATIONS.format("cars"))
    root = lay({"a.xosc": text, **{f"cars/{i}.xosc": CATALOGUE for i in range(MAX_CATALOGUES + 1)}})
    with pytest.raises(DocumentError, match="at most 64 files of catalogues"):
        DiskLibrary([root]).scenario("a")


def test_parameters_from_outside_are_those_of_the_opening_file(lay: Lay) -> None:
    root = lay({"a.xosc": story({"Ego": ""}, more=DECLARED.format(3)), "b.xosc": story({"Ego": ""})})
    library = DiskLibrary([root], stories=StoryOptions({"v": "5"}))
    opened = library.opening_scenario(str(root / "a.xosc")).story
    assert opened is not None
    assert opened.parameters == {"v": "5"}
    library.scenario("b")  # it has no such parameter, and is not the file that the user meant
    with pytest.raises(DocumentError, match="no parameter 'v'"):
        DiskLibrary(stories=StoryOptions({"v": "5"})).opening_scenario(str(root / "b.xosc"))


def test_assignments_are_names_and_values() -> None:
    assert read_parameters(["a=1", "b = x=y"]) == {"a": "1", "b": "x=y"}
    with pytest.raises(DocumentError, match="--param: expected NAME=VALUE, got 'a'"):
        read_parameters(["a"])


def test_a_file_that_is_no_story_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.xosc"
    path.write_text("hello")
    with pytest.raises(DocumentError, match=r"a\.xosc: line 1: not XML"):
        DiskLibrary().opening_scenario(str(path))
